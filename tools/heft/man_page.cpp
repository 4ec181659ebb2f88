#include <algorithm>
#include <cctype>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "program_text.hpp"

namespace heft::tools {
namespace {

/// Text as troff takes it: backslashes, hyphens that are to be copied as such, and no line that begins with a control character.
std::string troff(const std::string& text) {
  std::string safe;
  bool at_begin = true;
  for (const char c : text) {
    if (at_begin && (c == '.' || c == '\'')) safe += "\\&";
    at_begin = c == '\n';
    if (c == '\\') {
      safe += "\\e";
    } else if (c == '-') {
      safe += "\\-";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string head(const std::string& name, const std::string& version, std::string summary) {
  if (summary.starts_with(name + ": ")) summary.erase(0, name.size() + 2);
  return fmt::format(".TH {} 1 \"\" \"{}\" \"heft\"\n.SH NAME\n{} \\- {}\n", upper(troff(name)),
                     troff(version.substr(0, version.find('\n'))), troff(name), troff(summary));
}

std::string option_entry(const OptionText& option) {
  std::string names;
  for (const std::string& name : option.names)
    names += (names.empty() ? "" : ", ") + fmt::format("\\fB{}\\fR", troff(name));
  std::string entry = ".TP\n" + names;
  if (!option.placeholder.empty()) entry += fmt::format(" \\fI{}\\fR", troff(option.placeholder));
  entry += "\n" + troff(option.meaning);
  if (!option.words.empty())
    entry += fmt::format(" (one of {})", troff(fmt::format("{}", fmt::join(option.words, ", "))));
  if (option.required) entry += " (required)";
  return entry + "\n";
}

std::string footer_section(const std::string& footer) {
  return footer.empty() ? "" : ".SH NOTES\n.nf\n" + troff(footer) + "\n.fi\n";
}

constexpr const char* kExitCodes =
    ".SH EXIT STATUS\n"
    "0 done; 1 internal failure; 2 wrong usage; 3 bad input; 4 the data cannot answer the question, and the message says "
    "which motion is missing.\n";

std::string page_of(const ProgramText& program, const CommandText& command) {
  const std::string name = program.name + "-" + command.name;
  std::string page = head(name, program.version, command.summary);
  page += fmt::format(".SH SYNOPSIS\n\\fB{} {}\\fR", troff(program.name), troff(command.name));
  for (const OptionText& option : command.options) {
    if (option.is_argument())
      page += fmt::format(" [\\fI{}\\fR...]",
                          troff(option.placeholder.empty() ? option.names.front() : option.placeholder));
  }
  for (const OptionText& option : command.options) {
    if (option.required && !option.is_argument())
      page += fmt::format(" \\fB{}\\fR \\fI{}\\fR", troff(option.names.back()), troff(option.placeholder));
  }
  page += " [\\fIOPTIONS\\fR]\n.SH OPTIONS\n";
  for (const OptionText& option : command.options) page += option_entry(option);
  page += footer_section(command.footer);
  page += kExitCodes;
  page += fmt::format(".SH SEE ALSO\n\\fB{}\\fR(1)\n", troff(program.name));
  return page;
}

}  // namespace

std::string man_page(const ProgramText& program, const std::string& command) {
  if (!command.empty()) {
    const auto found = std::find_if(program.commands.begin(), program.commands.end(),
                                    [&](const CommandText& c) { return c.name == command; });
    if (found == program.commands.end()) throw UsageError(fmt::format("there is no command '{}'", command));
    return page_of(program, *found);
  }
  std::string page = head(program.name, program.version, program.description);
  page += fmt::format(".SH SYNOPSIS\n\\fB{0}\\fR \\fICOMMAND\\fR [\\fIOPTIONS\\fR]\n.SH COMMANDS\n",
                      troff(program.name));
  for (const CommandText& c : program.commands) {
    page += fmt::format(".TP\n\\fB{}\\fR\n{}; see \\fB{}\\fR(1)\n", troff(c.name), troff(c.summary),
                        troff(program.name + "-" + c.name));
  }
  return page + footer_section(program.footer);
}

}  // namespace heft::tools
