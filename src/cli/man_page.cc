// SPDX-License-Identifier: Apache-2.0
#include "cli/man_page.h"

#include <fmt/format.h>

#include "tilegrad/version.h"

namespace tilegrad::cli {
namespace {

// What roff would take for its own: a backslash, a hyphen that is to stay one, a control character
// at the beginning of a line.
std::string Roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n'))
      out += std::string("\\&") + c;
    else
      out += c;
  }
  return out;
}

std::string Title(const std::string& name) {
  return fmt::format(".TH {} 1 \"\" \"tilegrad {}\" \"tilegrad\"\n", Roff(name), TILEGRAD_VERSION);
}

std::string Bold(const std::string& text) { return "\\fB" + Roff(text) + "\\fR"; }
std::string Italic(const std::string& text) { return "\\fI" + Roff(text) + "\\fR"; }

// The first letter small, as the line under NAME is written.
std::string Summary(std::string help) {
  if (help.size() > 1 && help[1] >= 'a' && help[1] <= 'z')
    help[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(help[0])));
  return Roff(help);
}

std::string Term(const OptionNode& option) {
  std::string out;
  for (const std::string& name : option.names)
    out += (out.empty() ? "" : ", ") + (option.positional ? Italic(name) : Bold(name));
  if (!option.positional && !option.value.empty()) {
    out += " " + (option.choices.empty() || option.path
                      ? Italic(option.value)
                      : Roff(fmt::format("{}", fmt::join(option.choices, "|"))));
  }
  return out;
}

std::string Entry(const OptionNode& option) {
  std::string help = Roff(option.help);
  if (option.required) help += " (required)";
  if (!option.initial.empty()) help += "; default: " + Roff(option.initial);
  return ".TP\n" + Term(option) + "\n" + help + "\n";
}

std::string Synopsis(const CommandNode& command) {
  std::string out = fmt::format(".SH SYNOPSIS\n.B tilegrad {}\n[\\fIoptions\\fR]", command.name);
  for (const OptionNode& option : command.options) {
    if (!option.positional) continue;
    const std::string name = Italic(option.names[0]) + (option.many ? " ..." : "");
    out += option.required ? " " + name : " [" + name + "]";
  }
  return out + "\n";
}

constexpr const char* kExitStatus =
    ".SH EXIT STATUS\n0 done; 1 the work failed; 2 the command line or configuration is wrong; 3 "
    "an "
    "input file is missing or broken; 130 stopped by Ctrl\\-C and 143 by SIGTERM, with everything "
    "saved.\n";

}  // namespace

std::string ProgramManPage(std::span<const CommandNode> tree) {
  std::string out = Title("TILEGRAD") +
                    ".SH NAME\ntilegrad \\- a differentiable rasterizer for "
                    "CPUs, and the training system around it\n.SH SYNOPSIS\n.B tilegrad\n"
                    "\\fIcommand\\fR [\\fIoptions\\fR]\n.SH COMMANDS\n";
  for (const CommandNode& command : tree.subspan(1)) {
    out += fmt::format(".TP\n{}(1)\n{}\n", Bold("tilegrad-" + command.name), Roff(command.help));
  }
  out += ".SH OPTIONS\n";
  for (const OptionNode& option : tree[0].options) out += Entry(option);
  out +=
      ".SH ENVIRONMENT\n.TP\n.B TILEGRAD_THREADS\nhow many threads work where \\-\\-threads is "
      "not given\n.TP\n.B TILEGRAD_TARGET\nthe SIMD target to use instead of the best one; "
      "tilegrad info lists them\n.TP\n.B TILEGRAD_READ_LIMIT\nwhat one file may become in "
      "memory, as \\-\\-read\\-limit\n";
  return out + kExitStatus;
}

std::string CommandManPage(const CommandNode& command) {
  const std::string name = "tilegrad-" + command.name;
  std::string out = Title(name) + ".SH NAME\n" + Roff(name) + " \\- " + Summary(command.help) +
                    "\n" + Synopsis(command) + ".SH OPTIONS\n";
  for (const OptionNode& option : command.options) out += Entry(option);
  return out + kExitStatus + ".SH SEE ALSO\n.BR tilegrad (1)\n";
}

}  // namespace tilegrad::cli
