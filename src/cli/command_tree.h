// SPDX-License-Identifier: Apache-2.0
// The commands and options of the program as plain records, read from CLI11's own tree: what man
// pages and completions are written from, so that they cannot say anything else than --help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

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
std::vector<CommandNode> ReadCommandTree(const CLI::App& app);

}  // namespace tilegrad::cli
