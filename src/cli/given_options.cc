// SPDX-License-Identifier: Apache-2.0
#include "cli/given_options.h"

#include <algorithm>
#include <sstream>

#include "base/error.h"
#include "cli/command_line.h"

namespace tilegrad::cli {
namespace {

constexpr const char* kGivenHead = "# What the command was given; --resume goes on with it.\n";
constexpr const char* kGivenIs = " = ";

// A line break and the backslash itself.
std::string Escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\n' || c == '\\') out += '\\';
    out += c == '\n' ? 'n' : c;
  }
  return out;
}

std::string Unescaped(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape = text[i] == '\\' && i + 1 < text.size();
    if (escape) ++i;
    out += escape && text[i] == 'n' ? '\n' : text[i];
  }
  return out;
}

// Also 1 and 1.0, and two names of a file.
bool IsSame(const std::string& a, const std::string& b) {
  const auto x = RealNumber(a), y = RealNumber(b);
  std::error_code error;
  return a == b || (x && y && *x == *y) || std::filesystem::equivalent(a, b, error);
}

Status CheckSame(const Continuation& before, const Option& option, const std::string& now) {
  const auto then = before.then.find(option.FirstName());
  const std::string was = then != before.then.end() ? then->second : option.initial;
  if (before.may_differ.contains(option.FirstName()) || IsSame(was, now)) return {};
  return InvalidArgument("{}: was {}, is {}; leave it out to resume, or start anew with --force",
                         option.FirstName(), was.empty() ? "not given" : was, now);
}

}  // namespace

GivenOptions GivenOf(const Command& command) {
  GivenOptions out;
  for (const Option& option : command.options) {
    if (!option.words.empty())
      out[option.FirstName()] = fmt::format("{}", fmt::join(option.words, ","));
  }
  return out;
}

Status WriteGiven(const Path& file, const GivenOptions& given) {
  std::string text = kGivenHead;
  for (const auto& [name, value] : given) text += name + kGivenIs + Escaped(value) + "\n";
  return WriteTextAtomic(file, text);
}

Result<GivenOptions> ReadGiven(const Path& file) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  std::istringstream lines(text);
  GivenOptions out;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.starts_with('#')) continue;
    const std::size_t is = line.find(kGivenIs);
    if (is == std::string::npos)
      return DataLoss("{}: \"{}\" is not of the form option = value", file.string(), line);
    out[line.substr(0, is)] = Unescaped(line.substr(is + std::string(kGivenIs).size()));
  }
  return out;
}

Status ContinueWith(const Continuation& before, Command* command, CommandList* list) {
  GivenOptions all = GivenOf(*command);
  for (const Option& option : command->options) {
    if (!option.words.empty()) TILEGRAD_TRY(CheckSame(before, option, all.at(option.FirstName())));
  }
  const bool instead = std::ranges::any_of(
      before.instead, [&](const std::string& name) { return all.contains(name); });
  for (const auto& [name, value] : before.then) {
    if (!instead || !before.instead.contains(name)) all.emplace(name, value);
  }
  std::vector<std::string> words = {command->name};
  for (const auto& [name, value] : all)
    words.push_back(name.starts_with('-') ? name + "=" + value : value);
  const ParsedLine line = ParseLine(std::move(words), list);
  return line.command != nullptr ? Status() : InvalidArgument("--resume: {}", line.note);
}

}  // namespace tilegrad::cli
