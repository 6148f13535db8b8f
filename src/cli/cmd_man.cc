// SPDX-License-Identifier: Apache-2.0
// tilegrad man: manual pages of the program and its commands.
#include <utility>

#include "base/did_you_mean.h"
#include "base/error.h"
#include "base/file.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/man_page.h"

namespace tilegrad::cli {
namespace {

struct ManOptions {
  std::string command, out;
};

// All pages, into a folder: what the installation does.
Status WriteManPages(const std::vector<CommandNode>& tree, const Path& folder) {
  TILEGRAD_TRY(MakeFolder(folder));
  TILEGRAD_TRY(WriteTextAtomic(folder / "tilegrad.1", ProgramManPage(tree)));
  for (const CommandNode& command : std::span(tree).subspan(1)) {
    TILEGRAD_TRY(
        WriteTextAtomic(folder / ("tilegrad-" + command.name + ".1"), CommandManPage(command)));
  }
  return {};
}

Status RunMan(const std::vector<CommandNode>& tree, const ManOptions& options) {
  if (!options.out.empty()) return WriteManPages(tree, options.out);
  if (options.command.empty()) {
    Print("{}", ProgramManPage(tree));
    return {};
  }
  std::vector<std::string> names;
  for (const CommandNode& command : std::span(tree).subspan(1)) {
    if (command.name == options.command) {
      Print("{}", CommandManPage(command));
      return {};
    }
    names.push_back(command.name);
  }
  return InvalidArgument("unknown command \"{}\"{}; see tilegrad --help", options.command,
                         DidYouMean(options.command, names));
}

}  // namespace

void AddMan(CommandList* list) {
  auto options = std::make_shared<ManOptions>();
  Command& command = list->emplace_back(
      Command{"man", "Print a manual page, e.g. for: tilegrad man fit | man -l -"});
  command.Add("command", &options->command, "the command that it is about [the program]");
  command.Add("--out", &options->out, "write all pages into this folder instead");
  command.action = [list, options] {
    const ManOptions given = std::exchange(*options, {});  // else the page took them for defaults
    return RunMan(ReadCommandTree(*list), given);
  };
}

}  // namespace tilegrad::cli
