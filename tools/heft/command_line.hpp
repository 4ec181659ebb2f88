/// @file
/// Options of the commands and the parser that reads them. The parser's library (CLI11) stays in the source file:
/// its header alone takes seconds to compile.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace heft::tools {

/// Options that cannot be read, do not go together or leave out what is needed (exit code 2).
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a command does with the file that an option names.
enum class FileUse {
  kInput,
  kMeasurements,  ///< logs and the like: refused when given twice
  kRobot,         ///< a file or the name of a robot
  kOutput,
  kOutputFolder
};

/// Options of a command that name files.
struct DeclaredFile {
  CLI::Option* option;
  FileUse use;
};

/// A file that was given.
struct GivenFile {
  std::string option;  ///< as in `--log`
  FileUse use;
  std::string path;
};

struct ProgramText;

/// One option of a command; a handle to be copied. Every call returns the option, so that calls can be chained.
class Option {
 public:
  Option(CLI::Option* option, std::vector<DeclaredFile>* files) : option_(option), files_(files) {}

  /// Placeholder of the value in the help text, such as FILE.
  Option& type_name(const std::string& name);
  /// Replaces the meaning in the help text.
  Option& description(const std::string& meaning);
  Option& required(bool is_required = true);
  /// May be given only together with `other`.
  Option& needs(const Option& other);
  /// Letter between the values of a list, in addition to the space.
  Option& delimiter(char letter);
  /// Number of values of a list.
  Option& expected(int count);
  /// Shows the value that the variable has now as the default.
  Option& capture_default_str();
  /// The value is the path of a file: every one is looked at before the command begins. Replaces an earlier use.
  Option& names_file(FileUse use);

  /// What the value has to be. Numbers are finite unless `infinity_too` is asked for.
  Option& infinity_too();
  Option& positive();
  Option& not_negative();
  Option& between(int lowest, int highest);
  Option& between(double lowest, double highest);
  /// At least `lowest` and below `highest`.
  Option& from_to_below(double lowest, double highest);
  Option& one_of(std::initializer_list<const char*> words);

 private:
  CLI::Option* option_;
  std::vector<DeclaredFile>* files_;
};

/// The options of one command; a handle. Variables have to live until the command line is parsed.
class CommandLine {
 public:
  CommandLine(CLI::App& app, std::vector<DeclaredFile>& files) : app_(&app), files_(&files) {}

  /// @param names    such as "-o,--output"; without dashes it is a positional argument
  /// @param value    gets what is given; its type says what can be given
  /// @param meaning  for the help text
  Option add_option(const std::string& names, std::string& value, const std::string& meaning);
  Option add_option(const std::string& names, double& value, const std::string& meaning);
  Option add_option(const std::string& names, int& value, const std::string& meaning);
  Option add_option(const std::string& names, std::uint64_t& value, const std::string& meaning);
  Option add_option(const std::string& names, std::vector<std::string>& value, const std::string& meaning);
  Option add_option(const std::string& names, std::vector<double>& value, const std::string& meaning);
  Option add_option(const std::string& names, std::vector<int>& value, const std::string& meaning);
  /// An option without a value.
  Option add_flag(const std::string& names, bool& value, const std::string& meaning);

  /// The option of that name, added before.
  Option get_option(const std::string& name) const;
  /// How often the option was given.
  std::size_t count(const std::string& name) const;
  /// Text below the options in the help text.
  void footer(const std::string& text);
  /// Called once all options are read; throws UsageError when they do not go together.
  void parse_complete_callback(std::function<void()> check);

 private:
  CLI::App* app_;
  std::vector<DeclaredFile>* files_;
};

/// A program with commands.
class CommandParser {
 public:
  /// @param version  what --version prints
  /// @param footer   text below the list of commands in the help text
  CommandParser(const std::string& name, const std::string& description, const std::string& version,
                const std::string& footer);
  ~CommandParser();

  CommandLine add_command(const std::string& name, const std::string& summary);
  /// Reads the command line into the variables of the options; prints the text of --help and --version.
  /// @return the command that was chosen; empty when a text was asked for and there is nothing left to do
  /// @throws UsageError
  std::string parse(int argc, const char* const* argv);
  /// The help text of the program.
  std::string help() const;
  /// The program, its commands and their options, for program_text.hpp.
  ProgramText describe() const;
  /// The files that were given to the command that parse() found, in the order of its options.
  std::vector<GivenFile> files() const;

 private:
  void refuse_leftovers() const;

  std::unique_ptr<CLI::App> app_;
  std::map<const CLI::App*, std::vector<DeclaredFile>> files_;
};

}  // namespace heft::tools
