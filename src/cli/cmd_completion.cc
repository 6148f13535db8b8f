// SPDX-License-Identifier: Apache-2.0
// tilegrad completion: the script that lets a shell complete commands, options, and values that are
// one of a list; files elsewhere.
#include <fmt/format.h>

#include <span>
#include <string>

#include "base/text.h"
#include "cli/command.h"
#include "cli/command_line.h"
#include "cli/console.h"

namespace tilegrad::cli {
namespace {

std::string CommandNames(std::span<const CommandNode> tree) {
  std::string out;
  for (const CommandNode& command : tree.subspan(1)) out += command.name + " ";
  return out + "help";
}

std::string OptionNames(const CommandNode& command) {
  std::vector<std::string> names;
  for (const OptionNode& option : command.options) {
    if (!option.positional) names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return fmt::format("{}", fmt::join(names, " "));
}

// ---- bash

// Arms of `case $prev`: what may stand behind an option.
std::string BashValues(const CommandNode& command) {
  std::string out;
  for (const OptionNode& option : command.options) {
    if (option.positional || option.value.empty()) continue;
    const std::string names = fmt::format("{}", fmt::join(option.names, " | "));
    const std::string list = fmt::format("{}", fmt::join(option.choices, " "));
    const bool files = option.path || option.names.back() == "--config";
    out += fmt::format("        {}) words={} files={} ;;\n", names, ShellWord(list), files ? 1 : 0);
  }
  return out;
}

// ---- zsh

// Escapes what _arguments treats as special in a specification.
std::string ZshEscaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string ZshValue(const OptionNode& option) {
  if (option.value.empty()) return "";
  std::string action = option.path ? "_files" : " ";
  if (!option.choices.empty()) action = fmt::format("({})", fmt::join(option.choices, " "));
  if (option.names.back() == "--config") action = "_tilegrad_configs";
  return ":" + ZshEscaped(option.value) + ":" + action;
}

std::string ZshOption(const OptionNode& option) {
  if (option.positional) {
    const std::string action =
        option.choices.empty() ? "_files" : fmt::format("({})", fmt::join(option.choices, " "));
    return fmt::format("        {}\n", ShellWord(fmt::format("{}:{}:{}", option.many ? "*" : "",
                                                             ZshEscaped(option.names[0]), action)));
  }
  std::string out;
  for (const std::string& name : option.names) {
    out += fmt::format("        {}\n",
                       ShellWord(fmt::format("{}{}[{}]{}", option.many ? "*" : "", name,
                                             ZshEscaped(option.help), ZshValue(option))));
  }
  return out;
}

// ---- fish

std::string FishOption(const std::string& command, const OptionNode& option) {
  std::string out =
      fmt::format("complete -c tilegrad -n '__fish_seen_subcommand_from {}'", command);
  for (const std::string& name : option.names) {
    const bool longer = name.starts_with("--");
    if (!option.positional)
      out += fmt::format(" -{} {}", longer ? "l" : "s", name.substr(longer ? 2 : 1));
  }
  if (!option.value.empty() && !option.positional) out += option.path ? " -r -F" : " -x";
  if (!option.choices.empty()) {
    if (option.positional) out += " -f";
    out += fmt::format(" -a {}", ShellWord(fmt::format("{}", fmt::join(option.choices, " "))));
    if (option.names.back() == "--config") out += " -F";
  }
  return out + fmt::format(" -d {}\n", ShellWord(option.help));
}

std::string BashCompletion(std::span<const CommandNode> tree) {
  std::string cases;
  for (const CommandNode& command : tree.subspan(1)) {
    cases += fmt::format("    {})\n      options={}\n      case $prev in\n{}      esac ;;\n",
                         command.name, ShellWord(OptionNames(command)), BashValues(command));
  }
  return fmt::format(R"(# bash completion for tilegrad
_tilegrad() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD - 1]}}
  local commands={0} options='' words='' files=1
  COMPREPLY=()
  if [ "$COMP_CWORD" = 1 ]; then
    COMPREPLY=($(compgen -W "$commands {1}" -- "$cur"))
    return
  fi
  case ${{COMP_WORDS[1]}} in
    help) words=$commands files=0 ;;
{2}  esac
  if [[ $cur == -* && $files = 1 && -z $words ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$cur"))
    return
  fi
  COMPREPLY=($(compgen -W "$words" -- "$cur"))
  [ "$files" = 0 ] || mapfile -t -O "${{#COMPREPLY[@]}}" COMPREPLY < <(compgen -f -- "$cur")
}}
complete -o filenames -F _tilegrad tilegrad
)",
                     ShellWord(CommandNames(tree)), OptionNames(tree[0]), cases);
}

std::string ZshCompletion(std::span<const CommandNode> tree) {
  std::string names, cases;
  for (const CommandNode& command : tree.subspan(1)) {
    names += fmt::format("    {}\n", ShellWord(command.name + ":" + ZshEscaped(command.help)));
    cases += fmt::format("    {})\n      _arguments -s \\\n", command.name);
    std::string options;
    for (const OptionNode& option : command.options) options += ZshOption(option);
    for (std::size_t at = 0; (at = options.find('\n', at)) != std::string::npos; at += 3)
      options.replace(at, 1, " \\\n");
    cases += options + "        && return ;;\n";
  }
  return fmt::format(R"(#compdef tilegrad
_tilegrad_configs() {{ _alternative 'names:name:({2})' 'files:file:_files' }}
_tilegrad() {{
  local -a commands=(
{0}    'help:Show the options of a command'
  )
  if (( CURRENT == 2 )); then
    _describe 'command' commands
    return
  fi
  local command=$words[2]
  shift words
  (( CURRENT-- ))
  case $command in
    help) _describe 'command' commands ;;
{1}  esac
}}
if [ "$funcstack[1]" = "_tilegrad" ]; then _tilegrad "$@"; else compdef _tilegrad tilegrad; fi
)",
                     names, cases, fmt::join(ConfigNames(), " "));
}

std::string FishCompletion(std::span<const CommandNode> tree) {
  std::string out = "# fish completion for tilegrad\n";
  for (const CommandNode& command : tree.subspan(1)) {
    out += fmt::format("complete -c tilegrad -n __fish_use_subcommand -f -a {} -d {}\n",
                       command.name, ShellWord(command.help));
  }
  out += fmt::format(
      "complete -c tilegrad -n __fish_use_subcommand -f -a help -d 'Show the options of a "
      "command'\ncomplete -c tilegrad -n '__fish_seen_subcommand_from help' -f -a {}\n",
      ShellWord(CommandNames(tree)));
  for (const CommandNode& command : tree.subspan(1)) {
    for (const OptionNode& option : command.options) {
      if (!option.positional || !option.choices.empty()) out += FishOption(command.name, option);
    }
  }
  return out;
}

}  // namespace

void AddCompletion(CommandList* list) {
  auto shell = std::make_shared<std::string>();
  Command& command = list->emplace_back(Command{
      "completion",
      "Print a shell's completion script; load it with: source <(tilegrad completion bash)"});
  command.Add("shell", shell.get(), "bash, zsh or fish",
              {Required{}, OneOf{{"bash", "zsh", "fish"}}});
  command.action = [list, shell]() -> Status {
    const auto tree = ReadCommandTree(*list);
    Print("{}", *shell == "bash"  ? BashCompletion(tree)
                : *shell == "zsh" ? ZshCompletion(tree)
                                  : FishCompletion(tree));
    return {};
  };
}

}  // namespace tilegrad::cli
