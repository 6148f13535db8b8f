// SPDX-License-Identifier: Apache-2.0
// tilegrad man: manual pages of the program and its commands, tilegrad(1), tilegrad-fit(1) and so
// on, in the man(7) language.
#include <fmt/format.h>

#include <map>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/command_line.h"
#include "cli/console.h"
#include "tilegrad/version.h"

namespace tilegrad::cli {
namespace {

using Pages = std::map<std::string, std::string>;  // by command; "": the program's

// Escapes what roff would interpret: a backslash, a hyphen that is to stay one, a control character
// at the beginning of a line.
std::string Roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) out += "\\&";
    out += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
  }
  return out;
}

std::string Bold(const std::string& text) { return "\\fB" + Roff(text) + "\\fR"; }
std::string Italic(const std::string& text) { return "\\fI" + Roff(text) + "\\fR"; }

std::string ValueOf(const OptionNode& option) {
  if (option.positional || option.value.empty()) return "";
  if (option.choices.empty() || option.path) return " " + Italic(option.value);
  return " " + Roff(fmt::format("{}", fmt::join(option.choices, "|")));
}

std::string OptionsOf(const CommandNode& command) {
  std::string out = ".SH OPTIONS\n";
  for (const OptionNode& option : command.options) {
    const char* before = ".TP\n";
    for (const std::string& name : option.names)
      out += std::exchange(before, ", ") + (option.positional ? Italic(name) : Bold(name));
    out += ValueOf(option) + "\n" + Roff(option.help) + (option.required ? " (required)" : "");
    out += option.initial.empty() ? "\n" : "; default: " + Roff(option.initial) + "\n";
  }
  return out;
}

std::string Page(const std::string& name, const std::string& help, const std::string& synopsis,
                 const std::string& rest) {
  constexpr const char* kForm =
      ".TH {0} 1 \"\" \"tilegrad {1}\" \"tilegrad\"\n.SH NAME\n{0} \\- {2}\n.SH SYNOPSIS\n{3}\n{4}"
      ".SH EXIT STATUS\n0 done; 1 the work failed; 2 the command line or configuration is wrong; "
      "3 an input file is missing or broken; 130 stopped by Ctrl\\-C and 143 by SIGTERM, with "
      "everything saved.\n";
  return fmt::format(kForm, Roff(name), TILEGRAD_VERSION, Roff(help), synopsis, rest);
}

std::string ProgramPage(const std::vector<CommandNode>& tree) {
  std::string commands = ".SH COMMANDS\n";
  for (const CommandNode& command : std::span(tree).subspan(1))
    commands +=
        fmt::format(".TP\n{}(1)\n{}\n", Bold("tilegrad-" + command.name), Roff(command.help));
  constexpr const char* kEnvironment =
      ".SH ENVIRONMENT\n.TP\n.B TILEGRAD_THREADS\nnumber of threads if \\-\\-threads is not "
      "given\n.TP\n.B TILEGRAD_TARGET\nthe SIMD target to use instead of the best one; tilegrad "
      "info lists them\n.TP\n.B TILEGRAD_READ_LIMIT\nmemory limit per file, as "
      "\\-\\-read\\-limit\n";
  return Page("tilegrad", "a differentiable rasterizer for CPUs, and the training system around it",
              ".B tilegrad\n\\fIcommand\\fR [\\fIoptions\\fR]",
              commands + OptionsOf(tree[0]) + kEnvironment);
}

std::string CommandPage(const CommandNode& command) {
  std::string synopsis = ".B tilegrad " + command.name + "\n[\\fIoptions\\fR]";
  for (const OptionNode& option : command.options) {
    if (!option.positional) continue;
    const std::string name = Italic(option.names[0]) + (option.many ? " ..." : "");
    synopsis += option.required ? " " + name : " [" + name + "]";
  }
  return Page("tilegrad-" + command.name, command.help, synopsis, OptionsOf(command)) +
         ".SH SEE ALSO\n.BR tilegrad (1)\n";
}

Pages PagesOf(const std::vector<CommandNode>& tree) {
  Pages pages = {{"", ProgramPage(tree)}};
  for (const CommandNode& command : std::span(tree).subspan(1))
    pages[command.name] = CommandPage(command);
  return pages;
}

// What the installation does.
Status WritePages(const Pages& pages, const Path& folder) {
  TILEGRAD_TRY(MakeFolder(folder));
  for (const auto& [name, page] : pages) {
    const std::string file = name.empty() ? "tilegrad.1" : "tilegrad-" + name + ".1";
    TILEGRAD_TRY(WriteTextAtomic(folder / file, page));
  }
  return {};
}

Status PrintPage(const Pages& pages, const std::string& command) {
  if (const auto found = pages.find(command); found != pages.end()) {
    Print("{}", found->second);
    return {};
  }
  std::vector<std::string> names;
  for (const auto& [name, page] : pages) {
    if (!name.empty()) names.push_back(name);
  }
  return InvalidArgument("unknown command \"{}\"{}; see tilegrad --help", command,
                         DidYouMean(command, names));
}

}  // namespace

void AddMan(CommandList* list) {
  struct ManOptions {
    std::string command, out;
  };
  auto options = std::make_shared<ManOptions>();
  Command& command = list->emplace_back(
      Command{"man", "Print a manual page; read it with: tilegrad man fit | man -l -"});
  command.Add("command", &options->command, "command to document [the program itself]");
  command.Add("--out", &options->out, "write all pages into this folder instead");
  command.action = [list, options] {
    const ManOptions given = std::exchange(*options, {});  // else the page took them for defaults
    const Pages pages = PagesOf(ReadCommandTree(*list));
    return given.out.empty() ? PrintPage(pages, given.command) : WritePages(pages, given.out);
  };
}

}  // namespace tilegrad::cli
