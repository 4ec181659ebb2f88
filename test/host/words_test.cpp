/// Words as a shell takes them, against the shell itself.
#include "heft/host/words.hpp"

#include <cstdio>
#include <string>

#include <gtest/gtest.h>

namespace heft {
namespace {

/// What sh hands on as one argument.
std::string read_by_shell(const std::string& word) {
  std::FILE* shell = ::popen(("printf '<%s>' " + word).c_str(), "r");
  std::string text;
  for (int c = std::fgetc(shell); c != EOF; c = std::fgetc(shell)) text += static_cast<char>(c);
  ::pclose(shell);
  return text;
}

TEST(ShellWord, ReachesAProgramAsItIs) {
  for (const char* word :
       {"plain-1.csv", "two words", "it's", "$HOME", "a\"b", "*", "", "a;b", "tab\there", "\\n", "'"})
    EXPECT_EQ(read_by_shell(host::shell_word(word)), "<" + std::string(word) + ">") << word;
}

TEST(ShellWord, IsQuotedOnlyWhereItNeedsTo) {
  EXPECT_EQ(host::shell_word("/data/run-1,2:3.csv"), "/data/run-1,2:3.csv");
  EXPECT_EQ(host::shell_word("two words"), "'two words'");
}

}  // namespace
}  // namespace heft
