// What users read: every sentence in the sources, listed in strings.txt, so that a change of wording shows in review.
//
// The list holds the string literals of include, src and tools that have at least two words. Adjacent literals
// are joined, escapes stay as written, files are not named: moving code changes nothing here.
#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

/// The string literals of a C++ source, in order; adjacent ones joined, includes and comments left out.
class Literals {
 public:
  explicit Literals(std::string_view text) : text_(text) {
    while (at_ < text_.size()) step();
    finish();
  }
  const std::vector<std::string>& all() const { return all_; }

 private:
  bool starts(std::string_view what) const { return text_.substr(at_).starts_with(what); }
  bool is_word(std::size_t at) const {
    return at < text_.size() &&
           (std::isalnum(static_cast<unsigned char>(text_[at])) != 0 || text_[at] == '_');
  }
  /// Moves behind `end`, or to the end of the text where it does not occur.
  void skip_past(std::string_view end) {
    const std::size_t found = text_.find(end, at_);
    at_ = found == std::string_view::npos ? text_.size() : found + end.size();
  }

  void step() {
    if (starts("//")) {
      skip_past("\n");
    } else if (starts("/*")) {
      skip_past("*/");
    } else if (starts("#include")) {
      skip_past("\n");
    } else if (starts("R\"")) {
      raw();
    } else if (text_[at_] == '"') {
      quoted();
    } else if (text_[at_] == '\'') {
      finish();
      character();
    } else if (std::isspace(static_cast<unsigned char>(text_[at_])) != 0) {
      ++at_;
    } else {
      finish();
      token();
    }
  }

  /// A name or number as a whole, so that the R of a name and the ' in 1'000 begin no literal.
  void token() {
    if (!is_word(at_)) {
      ++at_;
      return;
    }
    while (is_word(at_) || (at_ < text_.size() && text_[at_] == '\'' && is_word(at_ + 1))) ++at_;
  }

  void character() {
    for (++at_; at_ < text_.size() && text_[at_] != '\''; ++at_) {
      if (text_[at_] == '\\') ++at_;
    }
    ++at_;
  }

  void quoted() {
    for (++at_; at_ < text_.size() && text_[at_] != '"'; ++at_) {
      if (text_[at_] == '\\') now_ += text_[at_++];
      now_ += text_[at_];
    }
    ++at_;
  }

  void raw() {
    const std::size_t open = text_.find('(', at_);
    const std::string end = ")" + std::string(text_.substr(at_ + 2, open - at_ - 2)) + "\"";
    const std::size_t begin = open + 1;
    at_ = begin;
    skip_past(end);
    for (const char c : text_.substr(begin, at_ - end.size() - begin)) {
      now_ += c == '\n' ? std::string("\\n") : std::string(1, c);
    }
  }

  /// Ends a run of adjacent literals: anything but blanks and comments came between.
  void finish() {
    if (!now_.empty()) all_.push_back(now_);
    now_.clear();
  }

  std::string_view text_;
  std::size_t at_{0};
  std::string now_;
  std::vector<std::string> all_;
};

/// Two words of at least two letters each: keys, units, formats and names of columns are none.
bool is_sentence(const std::string& text) {
  std::istringstream words(text);
  int found = 0;
  for (std::string word; words >> word;) {
    int letters = 0;
    bool run = false;
    for (const char c : word) {
      letters = std::isalpha(static_cast<unsigned char>(c)) != 0 ? letters + 1 : 0;
      run = run || letters >= 2;
    }
    found += run ? 1 : 0;
  }
  return found >= 2;
}

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::set<std::string> sentences_of_the_sources() {
  std::set<std::string> list;
  int files = 0;
  for (const char* tree : {"include", "src", "tools"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(HEFT_SOURCE_DIR) / tree)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".hpp" && extension != ".cpp") continue;
      ++files;
      const std::string source = text_of(entry.path());
      const Literals found(source);
      for (const std::string& text : found.all()) {
        if (is_sentence(text)) list.insert(text);
      }
    }
  }
  EXPECT_GT(files, 200) << "the sources of heft are not where this test looks";
  return list;
}

TEST(Literals, AreJoinedWhereOnlyBlanksAndCommentsAreBetween) {
  const Literals found("f(\"one \"  // comment\n  \"two\" /* \"no\" */ R\"x(\nthree)x\", \"four\");");
  EXPECT_EQ(found.all(), (std::vector<std::string>{"one two\\nthree", "four"}));
}

TEST(Literals, AreNotFoundInCommentsIncludesAndCharacters) {
  const Literals found(
      "#include \"a b.hpp\"\n// \"c d\"\nint n = 1'000; char c = '\"'; char e = '\\''; x = \"e\\\" f\";");
  EXPECT_EQ(found.all(), (std::vector<std::string>{"e\\\" f"}));
}

TEST(Literals, AreSentencesFromTwoWordsOn) {
  EXPECT_TRUE(is_sentence("no log"));
  EXPECT_TRUE(is_sentence("{}: not found"));
  EXPECT_FALSE(is_sentence("rmse_before"));
  EXPECT_FALSE(is_sentence("{:.3f} kg"));
  EXPECT_FALSE(is_sentence("a b"));
}

/// HEFT_GOLDEN_UPDATE=1 rewrites the list instead.
TEST(Strings, AreTheOnesThatWereReviewed) {
  const fs::path golden = fs::path(HEFT_SOURCE_DIR) / "test/golden/strings.txt";
  const std::set<std::string> now = sentences_of_the_sources();
  if (const char* update = std::getenv("HEFT_GOLDEN_UPDATE");
      update != nullptr && std::string(update) == "1") {
    std::ofstream out(golden, std::ios::binary);
    for (const std::string& text : now) out << text << '\n';
    ASSERT_TRUE(out.good()) << golden << " cannot be written";
    GTEST_SKIP() << golden << " rewritten with " << now.size() << " strings";
  }

  std::set<std::string> reviewed;
  std::istringstream in(text_of(golden));
  for (std::string line; std::getline(in, line);) reviewed.insert(line);
  std::vector<std::string> gone;
  std::vector<std::string> come;
  std::ranges::set_difference(reviewed, now, std::back_inserter(gone));
  std::ranges::set_difference(now, reviewed, std::back_inserter(come));
  std::string difference;
  for (const std::string& text : gone) difference += "- " + text + "\n";
  for (const std::string& text : come) difference += "+ " + text + "\n";
  EXPECT_TRUE(difference.empty()) << "strings that users read have changed (- before, + now):\n"
                                  << difference
                                  << "Read them once more as a user would. If they are as they should be:\n"
                                  << "  HEFT_GOLDEN_UPDATE=1 ctest --test-dir build -R Strings\n"
                                  << "and commit test/golden/strings.txt with the change.";
}

}  // namespace
