#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "program_text.hpp"

namespace heft::tools {
namespace {

using Words = std::vector<std::string>;

Words command_names(const ProgramText& program) {
  Words names;
  for (const CommandText& command : program.commands) names.push_back(command.name);
  return names;
}

/// Inside single quotes of a shell.
std::string quoted(const std::string& text) {
  std::string safe = "'";
  for (const char c : text) safe += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return safe + "'";
}

/// What bash completes after an option that takes a value.
std::string bash_value(const OptionText& option, const Words& robots) {
  if (!option.words.empty())
    return fmt::format("compgen -W {} -- \"$cur\"", quoted(fmt::format("{}", fmt::join(option.words, " "))));
  if (!option.file) return ":";
  if (*option.file == FileUse::kRobot)
    return fmt::format("compgen -W {} -- \"$cur\"; compgen -f -- \"$cur\"",
                       quoted(fmt::format("{}", fmt::join(robots, " "))));
  return *option.file == FileUse::kOutputFolder ? "compgen -d -- \"$cur\"" : "compgen -f -- \"$cur\"";
}

std::string bash(const ProgramText& program, const Words& robots) {
  std::string values, options;
  for (const CommandText& command : program.commands) {
    Words names{"--help"};
    bool takes_files = false;
    for (const OptionText& option : command.options) {
      if (option.is_argument()) {
        takes_files = true;
        continue;
      }
      names.insert(names.end(), option.names.begin(), option.names.end());
      if (option.placeholder.empty()) continue;
      Words patterns;
      for (const std::string& name : option.names) patterns.push_back(quoted(command.name + " " + name));
      values += fmt::format("    {}) found=$({}) ;;\n", fmt::join(patterns, "|"), bash_value(option, robots));
    }
    options += fmt::format("    {}) found=$(compgen -W {} -- \"$cur\"{}) ;;\n", command.name,
                           quoted(fmt::format("{}", fmt::join(names, " "))),
                           takes_files ? "; compgen -f -- \"$cur\"" : "");
  }
  return fmt::format(
      "# Completion of {0} for bash, written by `{0} --completion bash`.\n"
      "_{0}() {{\n"
      "  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} found\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
      "    found=$(compgen -W {1} -- \"$cur\")\n"
      "  else case \"${{COMP_WORDS[1]}} $prev\" in\n{2}"
      "    *) case \"${{COMP_WORDS[1]}}\" in\n{3}    esac ;;\n"
      "  esac; fi\n"
      "  local IFS=$'\\n'\n"
      "  COMPREPLY=($found)\n"
      "}}\n"
      "complete -o filenames -F _{0} {0}\n",
      program.name,
      quoted(fmt::format("{} --help --version --man --completion", fmt::join(command_names(program), " "))),
      values, options);
}

/// Text inside an argument of zsh's _arguments.
std::string zsh_text(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') safe += '\\';
    safe += c;
  }
  return safe;
}

std::string zsh_value(const OptionText& option, const Words& robots) {
  const std::string name = zsh_text(option.placeholder);
  if (!option.words.empty()) return fmt::format(":{}:({})", name, fmt::join(option.words, " "));
  if (!option.file) return fmt::format(":{}: ", name);
  if (*option.file == FileUse::kRobot)
    return fmt::format(":{}:{{_alternative \"robots:robot:({})\" \"files:file:_files\"}}", name,
                       fmt::join(robots, " "));
  return fmt::format(":{}:{}", name, *option.file == FileUse::kOutputFolder ? "_files -/" : "_files");
}

std::string zsh(const ProgramText& program, const Words& robots) {
  std::string commands, cases;
  for (const CommandText& command : program.commands) {
    commands += fmt::format("    {}\n", quoted(zsh_text(command.name) + ":" + command.summary));
    cases += fmt::format("    {}) _arguments '--help[explain the command]'", command.name);
    for (const OptionText& option : command.options) {
      if (option.is_argument()) {
        cases += " \\\n      '*:file:_files'";
        continue;
      }
      for (const std::string& name : option.names) {
        const std::string value = option.placeholder.empty() ? "" : zsh_value(option, robots);
        // An option may be given again, as --log is.
        cases += " \\\n      " + quoted(fmt::format("*{}[{}]{}", name, zsh_text(option.meaning), value));
      }
    }
    cases += " ;;\n";
  }
  return fmt::format(
      "#compdef {0}\n"
      "# Completion of {0} for zsh, written by `{0} --completion zsh`.\n"
      "_{0}() {{\n"
      "  local -a commands\n"
      "  commands=(\n{1}  )\n"
      "  if (( CURRENT == 2 )); then\n"
      "    _describe command commands\n"
      "    return\n"
      "  fi\n"
      "  shift words\n"
      "  (( CURRENT-- ))\n"
      "  case $words[1] in\n{2}  esac\n"
      "}}\n"
      "_{0} \"$@\"\n",
      program.name, commands, cases);
}

}  // namespace

std::string completion(const ProgramText& program, const std::string& shell,
                       const std::vector<std::string>& robots) {
  if (shell == "bash") return bash(program, robots);
  if (shell == "zsh") return zsh(program, robots);
  throw UsageError(fmt::format("--completion: found '{}'; expected bash or zsh", shell));
}

}  // namespace heft::tools
