// SPDX-License-Identifier: Apache-2.0
// The commands and options of the program as CLI11 knows them, in plain records: what man pages and
// completions are written from, so that they cannot say anything else than --help.
#pragma once

#include <string>
#include <vector>

#include "cli/command.h"

namespace tilegrad::cli {

struct OptionNode {
  std::vector<std::string> names;  // "-h", "--help"; of a positional its name alone
  bool positional = false, required = false, many = false;
  std::string value;                 // "INT", "TEXT", ...; empty: a flag
  std::vector<std::string> choices;  // that the value is one of; empty: not a list
  bool path = false;                 // a text that is not one of `choices`: files may be meant
  std::string initial;               // its default; empty: none
  std::string help;
};

struct CommandNode {
  std::string name, help;
  std::vector<OptionNode> options;  // as --help lists them
};

// Those that train knows, beside files.
std::vector<std::string> ConfigNames();

// The program's own options first, under the program's name, then its commands.
std::vector<CommandNode> ReadCommandTree(const CommandList& commands);

}  // namespace tilegrad::cli
