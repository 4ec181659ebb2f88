#include "command_line.hpp"

#include <sstream>
#include <utility>

#include <CLI/CLI.hpp>

namespace heft::tools {
namespace {

/// Help texts whose descriptions are wrapped beside the option's name.
class WrappingFormatter : public CLI::Formatter {
 public:
  WrappingFormatter() {
    column_width(kNameWidth);
    label("SUBCOMMAND", "COMMAND");
    label("REQUIRED", "(required)");
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    std::istringstream words(CLI::Formatter::make_option_desc(option));
    std::string word, text;
    for (std::size_t column = 0; words >> word; column += word.size() + 1) {
      if (column + word.size() > kTextWidth) {
        text += '\n';
        column = 0;
      } else if (!text.empty()) {
        text += ' ';
      }
      text += word;
    }
    return text;
  }

 private:
  static constexpr std::size_t kNameWidth = 34;
  static constexpr std::size_t kTextWidth = 66;
};

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
  option_->check(CLI::PositiveNumber);
  return *this;
}

Option& Option::not_negative() {
  option_->check(CLI::NonNegativeNumber);
  return *this;
}

Option& Option::between(int lowest, int highest) {
  option_->check(CLI::Range(lowest, highest));
  return *this;
}

Option& Option::between(double lowest, double highest) {
  option_->check(CLI::Range(lowest, highest));
  return *this;
}

Option& Option::one_of(std::initializer_list<const char*> words) {
  option_->check(CLI::IsMember(std::vector<std::string>(words.begin(), words.end())));
  return *this;
}

Option CommandLine::add_option(const std::string& names, std::string& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_option(const std::string& names, double& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_option(const std::string& names, int& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_option(const std::string& names, std::uint64_t& value, const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_option(const std::string& names, std::vector<std::string>& value,
                               const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_option(const std::string& names, std::vector<double>& value,
                               const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_option(const std::string& names, std::vector<int>& value,
                               const std::string& meaning) {
  return Option(app_->add_option(names, value, meaning));
}

Option CommandLine::add_flag(const std::string& names, bool& value, const std::string& meaning) {
  return Option(app_->add_flag(names, value, meaning));
}

Option CommandLine::get_option(const std::string& name) const { return Option(app_->get_option(name)); }

std::size_t CommandLine::count(const std::string& name) const { return app_->count(name); }

void CommandLine::footer(const std::string& text) { app_->footer(text); }

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
  app_->footer(footer);
}

CommandParser::~CommandParser() = default;

CommandLine CommandParser::add_command(const std::string& name, const std::string& summary) {
  CLI::App* command = app_->add_subcommand(name, summary);
  command->group("Commands");
  return CommandLine(*command);
}

std::string CommandParser::parse(int argc, const char* const* argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != static_cast<int>(CLI::ExitCodes::Success)) throw UsageError(error.what());
    app_->exit(error);  // --help, --version
    return {};
  }
  return app_->get_subcommands().front()->get_name();
}

std::string CommandParser::help() const { return app_->help(); }

}  // namespace heft::tools
