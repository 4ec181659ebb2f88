#include "command_line.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "console.hpp"
#include "heft/host/words.hpp"
#include "program_text.hpp"
#include "text_layout.hpp"

namespace heft::tools {
namespace {

constexpr int kUsualWidth = 80;

int help_width() { return std::min(100, terminal_width(stdout, kUsualWidth)); }

/// Help texts whose descriptions are wrapped in a column of their own.
class WrappingFormatter : public CLI::Formatter {
 public:
  WrappingFormatter() : text_width_(static_cast<std::size_t>(help_width()) - kNameWidth) {
    column_width(kNameWidth);
    label("SUBCOMMAND", "COMMAND");
    label("REQUIRED", "(required)");
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    return wrapped_beside_name(CLI::Formatter::make_option_desc(option));
  }
  std::string make_subcommand(const CLI::App* command) const override {
    std::ostringstream out;
    CLI::detail::format_help(out, command->get_name(), wrapped_beside_name(command->get_description()),
                             column_width_);
    return out.str();
  }

 private:
  std::string wrapped_beside_name(const std::string& description) const {
    std::istringstream words(description);
    std::string word, text;
    for (std::size_t column = 0; words >> word; column += word.size() + 1) {
      if (column + word.size() > text_width_) {
        text += '\n';
        column = 0;
      } else if (!text.empty()) {
        text += ' ';
      }
      text += word;
    }
    return text;
  }

  static constexpr std::size_t kNameWidth = 34;
  std::size_t text_width_;
};

/// A check of one number. What is no number at all is left to the parser.
template <typename Fits>
CLI::Validator number_check(Fits fits, const std::string& expected, const std::string& shown) {
  return CLI::Validator(
      [fits, expected](std::string& text) {
        double value = 0.0;
        if (!CLI::detail::lexical_cast(text, value) || fits(value)) return std::string();
        return fmt::format("found {}, expected {}", text, expected);
      },
      shown);
}

constexpr const char* kFiniteCheck = "finite";

/// NaN passes every comparison that looks for what is wrong, and means nothing in any option.
CLI::Option* finite(CLI::Option* option) {
  CLI::Validator check =
      number_check([](double value) { return std::isfinite(value); }, "a finite number", "");
  return option->check(check.name(kFiniteCheck));
}

/// An option as the library holds it: the type's name has the words that are allowed behind it, "FORMAT:{cpp,urdf}".
OptionText described(const CLI::Option& option, const std::vector<DeclaredFile>& files) {
  OptionText text;
  for (const std::string& name : option.get_snames()) text.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) text.names.push_back("--" + name);
  if (text.names.empty()) text.names.push_back(option.get_name());
  text.meaning = option.get_description();
  text.required = option.get_required();
  const std::string type = option.get_expected_max() > 0 ? option.get_type_name() : "";
  text.placeholder = type.substr(0, type.find(':'));
  if (const std::size_t at = type.find(":{"); at != std::string::npos)
    text.words = CLI::detail::split(type.substr(at + 2, type.find('}', at) - at - 2), ',');
  for (const DeclaredFile& file : files) {
    if (file.option == &option) text.file = file.use;
  }
  return text;
}

}  // namespace

Option& Option::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Option& Option::description(const std::string& meaning) {
  option_->description(meaning);
  return *this;
}

Option& Option::required(bool is_required) {
  option_->required(is_required);
  return *this;
}

Option& Option::needs(const Option& other) {
  option_->needs(other.option_);
  return *this;
}

Option& Option::delimiter(char letter) {
  option_->delimiter(letter);
  return *this;
}

Option& Option::expected(int count) {
  option_->expected(count);
  return *this;
}

Option& Option::capture_default_str() {
  option_->capture_default_str();
  return *this;
}

Option& Option::positive() {
  option_->check(number_check([](double value) { return value > 0.0 && std::isfinite(value); },
                              "a finite number greater than 0", "POSITIVE"));
  return *this;
}

Option& Option::not_negative() {
  option_->check(number_check([](double value) { return value >= 0.0 && std::isfinite(value); },
                              "a finite number, at least 0", "NONNEGATIVE"));
  return *this;
}

Option& Option::between(int lowest, int highest) {
  option_->check(CLI::Range(lowest, highest));
  return *this;
}

Option& Option::between(double lowest, double highest) {
  option_->check(number_check([=](double value) { return value >= lowest && value <= highest; },
                              fmt::format("a number from {} to {}", lowest, highest),
                              fmt::format("in [{} - {}]", lowest, highest)));
  return *this;
}

Option& Option::from_to_below(double lowest, double highest) {
  option_->check(number_check([=](double value) { return value >= lowest && value < highest; },
                              fmt::format("a number of at least {} and less than {}", lowest, highest),
                              fmt::format("in [{} - {})", lowest, highest)));
  return *this;
}

Option& Option::infinity_too() {
  option_->get_validator(kFiniteCheck)->active(false);
  option_->check(number_check([](double value) { return !std::isnan(value); }, "a number", ""));
  return *this;
}

Option& Option::names_file(FileUse use) {
  for (DeclaredFile& file : *files_) {
    if (file.option != option_) continue;
    file.use = use;
    return *this;
  }
  files_->push_back({option_, use});
  option_->check(CLI::Validator(
      [](std::string& path) { return path.empty() ? "found an empty name, expected that of a file" : ""; },
      ""));
  return *this;
}

Option& Option::one_of(std::initializer_list<const char*> words) {
  option_->check(CLI::IsMember(std::vector<std::string>(words.begin(), words.end())));
  return *this;
}

Option CommandLine::add_option(const std::string& names, std::string& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning), files_);
}

Option CommandLine::add_option(const std::string& names, double& value, const std::string& meaning) {
  return Option(finite(app_->add_option(names, value, meaning)), files_);
}

Option CommandLine::add_option(const std::string& names, int& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning), files_);
}

Option CommandLine::add_option(const std::string& names, std::uint64_t& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning), files_);
}

Option CommandLine::add_option(const std::string& names, std::vector<std::string>& value,
                               const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning), files_);
}

Option CommandLine::add_option(const std::string& names, std::vector<double>& value,
                               const std::string& meaning) {
  return Option(finite(app_->add_option(names, value, meaning)), files_);
}

Option CommandLine::add_option(const std::string& names, std::vector<int>& value,
                               const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning), files_);
}

Option CommandLine::add_flag(const std::string& names, bool& value, const std::string& meaning) {
  return Option(app_->add_flag(names, value, meaning), files_);
}

Option CommandLine::get_option(const std::string& name) const {
  return Option(app_->get_option(name), files_);
}

std::size_t CommandLine::count(const std::string& name) const { return app_->count(name); }

void CommandLine::footer(const std::string& text) { app_->footer(reflowed(text, help_width())); }

void CommandLine::parse_complete_callback(std::function<void()> check) {
  app_->parse_complete_callback(std::move(check));
}

CommandParser::CommandParser(const std::string& name, const std::string& description,
                             const std::string& version, const std::string& footer)
    : app_(std::make_unique<CLI::App>(description)) {
  app_->name(name);
  app_->formatter(std::make_shared<WrappingFormatter>());  // before the commands are added: they inherit it
  app_->set_version_flag("--version", version);
  app_->require_subcommand(1);
  app_->footer(reflowed(footer, help_width()));
}

CommandParser::~CommandParser() = default;

CommandLine CommandParser::add_command(const std::string& name, const std::string& summary) {
  CLI::App* command = app_->add_subcommand(name, summary);
  command->group("Commands");
  return CommandLine(*command, files_[command]);
}

std::string CommandParser::parse(int argc, const char* const* argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != static_cast<int>(CLI::ExitCodes::Success)) {
      // A misspelt option makes the right one look missing: name what was written first.
      refuse_leftovers();
      throw UsageError(error.what());
    }
    std::ostringstream text;  // --help, --version
    app_->exit(error, text, text);
    print_to(stdout, text.str());
    return {};
  }
  return app_->get_subcommands().front()->get_name();
}

/// Words of the command line that no option took.
void CommandParser::refuse_leftovers() const {
  if (app_->get_subcommands().empty()) return;
  const CLI::App& command = *app_->get_subcommands().front();
  const std::vector<std::string> leftovers = command.remaining();
  if (leftovers.empty()) return;
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  const std::string& first = leftovers.front();
  if (first.size() > 1 && first.front() == '-') {
    const std::string name = first.substr(0, first.find('='));
    const std::string nearest = host::nearest_word(name, known);
    throw UsageError(fmt::format("there is no option '{}'{}", name,
                                 nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
  }
  const bool has_logs = std::find(known.begin(), known.end(), "--log") != known.end();
  throw UsageError(fmt::format(
      "'{}' belongs to no option; expected an option in front of every file and value, as in {} {}", first,
      has_logs           ? "--log"
      : known.size() > 1 ? known[1]
                         : "--help",
      first));
}

std::vector<GivenFile> CommandParser::files() const {
  std::vector<GivenFile> given;
  if (app_->get_subcommands().empty()) return given;
  const auto declared = files_.find(app_->get_subcommands().front());
  if (declared == files_.end()) return given;
  for (const DeclaredFile& file : declared->second) {
    const std::string name =
        file.option->get_snames().empty() ? file.option->get_name() : "-" + file.option->get_snames().front();
    // An option that was not given has its default.
    std::vector<std::string> paths = file.option->results();
    if (paths.empty() && !file.option->get_default_str().empty()) paths = {file.option->get_default_str()};
    for (const std::string& path : paths) given.push_back({name, file.use, path});
  }
  return given;
}

std::string CommandParser::help() const { return app_->help(); }

ProgramText CommandParser::describe() const {
  ProgramText program{app_->get_name(), app_->get_description(), app_->version(), app_->get_footer(), {}};
  for (const CLI::App* command : app_->get_subcommands({})) {
    CommandText text{command->get_name(), command->get_description(), command->get_footer(), {}};
    const auto files = files_.find(command);
    for (const CLI::Option* option : command->get_options()) {
      if (option == command->get_help_ptr()) continue;
      text.options.push_back(
          described(*option, files == files_.end() ? std::vector<DeclaredFile>{} : files->second));
    }
    program.commands.push_back(std::move(text));
  }
  return program;
}

}  // namespace heft::tools
