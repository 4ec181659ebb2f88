// No file above 600 lines and no function above 80, but where the reason is written there ("// Long: reason", for a file
// among its first lines, for a function above or at its first).
#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "source_tree.hpp"

namespace heft {
namespace {

using test::SourceFile;

constexpr std::size_t kLongestFile = 600, kLongestFunction = 80;
const char* const kReason = "// Long: ";

/// Code without what is in comments, strings and characters, line by line.
std::vector<std::string> code_of(const std::vector<std::string>& lines) {
  std::vector<std::string> code;
  bool in_comment = false;
  std::string raw_end;  // of a raw string that goes on over lines
  for (const std::string& line : lines) {
    std::string kept;
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (!raw_end.empty()) {
        const std::size_t end = line.find(raw_end, i);
        if (end == std::string::npos) break;
        i = end + raw_end.size() - 1;
        raw_end.clear();
      } else if (in_comment) {
        const std::size_t end = line.find("*/", i);
        if (end == std::string::npos) break;
        i = end + 1;
        in_comment = false;
      } else if (line.compare(i, 2, "//") == 0) {
        break;
      } else if (line.compare(i, 2, "/*") == 0) {
        in_comment = true;
        ++i;
      } else if (line.compare(i, 2, "R\"") == 0) {
        const std::size_t open = line.find('(', i);
        raw_end = ")" + line.substr(i + 2, open - i - 2) + "\"";
        i = open;
      } else if (line[i] == '"' ||
                 (line[i] == '\'' && (i == 0 || !std::isalnum(static_cast<unsigned char>(line[i - 1]))))) {
        const char quote = line[i];
        for (++i; i < line.size() && line[i] != quote; ++i) i += line[i] == '\\' ? 1 : 0;
        kept += "_";
      } else {
        kept += line[i];
      }
    }
    code.push_back(kept.empty() || kept.front() != '#' ? kept : "");
  }
  return code;
}

struct Function {
  std::string name;
  std::size_t first{0}, last{0};  ///< lines, from 0; first is that of the name
  std::size_t lines() const { return last - first + 1; }
};

/// The words before a brace, where it opens the body of a function: its name; else nothing.
std::string function_name(const std::string& head) {
  static const std::vector<std::string> others = {"namespace", "class", "struct", "enum", "union", "="};
  const std::size_t open = head.find('(');
  if (open == std::string::npos || head.find(')') == std::string::npos) return "";
  std::istringstream words(head.substr(0, open));
  std::string word, last;
  while (words >> word) {
    if (std::find(others.begin(), others.end(), word) != others.end() && word != "class") return "";
    last = word;
  }
  const std::size_t begin = last.find_first_not_of("*&~");
  return begin == std::string::npos ? "" : last.substr(begin);
}

/// Functions with their bodies, in the form that clang-format gives them. What is inside a function, lambdas and local
/// classes, is part of it.
std::vector<Function> functions_in(const std::vector<std::string>& lines) {
  std::vector<Function> functions;
  const std::vector<std::string> code = code_of(lines);
  std::string head;  // since the last statement or scope
  std::size_t head_line = 0;
  std::vector<char> open;  // 'f' a function, 's' a scope of declarations, 'i' an initialiser
  std::size_t depth = 0;   // of braces inside the function
  for (std::size_t n = 0; n < code.size(); ++n) {
    const std::string& line = code[n];
    for (std::size_t i = 0; i < line.size(); ++i) {
      const char c = line[i];
      if (depth > 0) {
        depth += c == '{' ? 1 : 0;
        depth -= c == '}' ? 1 : 0;
        if (depth == 0) {
          functions.back().last = n;
          head.clear();
        }
        continue;
      }
      if (c == '{') {
        // A body follows a blank; {} directly behind a name initialises a member.
        const bool scope = !head.empty() && head.back() == ' ';
        const std::string name = scope ? function_name(head) : "";
        if (!name.empty()) {
          functions.push_back({name, head_line, n});
          depth = 1;
        } else {
          open.push_back(scope || head.empty() ? 's' : 'i');
          if (open.back() == 's') head.clear();
        }
      } else if (c == '}') {
        const bool initialiser = !open.empty() && open.back() == 'i';
        if (!open.empty()) open.pop_back();
        if (!initialiser) head.clear();
      } else if (c == ';' && (open.empty() || open.back() != 'i')) {
        head.clear();
      } else if (!(head.empty() && std::isspace(static_cast<unsigned char>(c)))) {
        if (head.empty()) head_line = n;
        head += c;
      }
    }
    if (!head.empty()) head += ' ';
  }
  return functions;
}

/// True where a reason is given on one of some lines.
bool has_reason(const std::vector<std::string>& lines, std::size_t first, std::size_t last) {
  for (std::size_t i = first; i < std::min(last, lines.size()); ++i) {
    const std::size_t at = lines[i].find(kReason);
    if (at != std::string::npos && lines[i].size() > at + std::string(kReason).size()) return true;
  }
  return false;
}

TEST(Sizes, OfFilesAndFunctionsAreWithinBounds) {
  for (const SourceFile& file : test::sources_in({"include/heft", "src", "tools"})) {
    EXPECT_TRUE(file.lines.size() <= kLongestFile || has_reason(file.lines, 0, 10))
        << file.path << " has " << file.lines.size()
        << " lines; split it, or write the reason there: " << kReason << "...";
    for (const Function& f : functions_in(file.lines)) {
      const std::size_t above = std::min<std::size_t>(f.first, 3);
      EXPECT_TRUE(f.lines() <= kLongestFunction || has_reason(file.lines, f.first - above, f.first + 3))
          << file.path << ": " << f.name << " has " << f.lines()
          << " lines; split it, or write the reason there: " << kReason << "...";
    }
  }
}

TEST(Sizes, ALongFunctionIsSeen) {
  std::vector<std::string> file = {"namespace a {", "/// One.", "template <class T>", "int f(T x,",
                                   "      int y) {"};
  for (int i = 0; i < 90; ++i) file.push_back("  if (x) { g(\"}\", '}', [] { return 1; }); }  // }");
  file.insert(file.end(),
              {"}", "struct S {", "  S() : a_{1}, b_(2) { a_ = {3}; }", "  int a_{0}, b_ = {1};", "};",
               "const int kTable[] = {1, f({2})};", "void g() {", "}", "}  // namespace a"});
  const std::vector<Function> functions = functions_in(file);
  ASSERT_EQ(functions.size(), 3U);
  EXPECT_EQ(functions[0].name, "f");
  EXPECT_EQ(functions[0].first, 2U);
  EXPECT_EQ(functions[0].lines(), 94U);
  EXPECT_EQ(functions[1].name, "S");
  EXPECT_EQ(functions[1].lines(), 1U);
  EXPECT_EQ(functions[2].name, "g");
  EXPECT_EQ(functions[2].lines(), 2U);
}

TEST(Sizes, NearlyEveryFunctionIsFound) {
  std::size_t functions = 0, longest = 0;
  for (const SourceFile& file : test::sources_in({"include/heft", "src", "tools"})) {
    for (const Function& f : functions_in(file.lines)) {
      ++functions;
      longest = std::max(longest, f.lines());
      EXPECT_LT(f.lines(), 400U) << file.path << " " << f.name << ": is that one function?";
    }
  }
  EXPECT_GT(functions, 1500U);
}

}  // namespace
}  // namespace heft
