// SPDX-License-Identifier: Apache-2.0
// The commands as CLI11 knows them, and what it makes of a command line.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "base/file.h"
#include "cli/command.h"

namespace tilegrad::cli {

// Lists whose words stand apart, in the words of a command line, joined by commas: those that are
// of the list's kind. "--errors 0 1e-3 mesh.obj" becomes "--errors 0,1e-3 mesh.obj"; the same for
// --up of three numbers, which may also be a word.
std::vector<std::string> JoinLists(std::vector<std::string> words);

struct ParsedLine {
  const Command* command = nullptr;  // null: print the texts, and end with the code
  int exit_code = 0;
  std::string out = {}, note = {};  // for standard output and standard error
};
// Words behind the program's name. Sets the targets and words of the options of the command that
// they choose.
ParsedLine ParseLine(std::vector<std::string> words, CommandList* commands);

// The commands and options of the program as CLI11 knows them, in plain records: what man pages and
// completions are written from, so that they cannot say anything else than --help.

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

// What a command was given, kept beside what it makes: --resume then needs none of it again.

// Values of options by their first names; those of a list with commas between.
using GivenOptions = std::map<std::string, std::string>;

GivenOptions GivenOf(const Command& command);

// One line each, "--fov = 40". Any bytes but 0 survive.
Status WriteGiven(const Path& file, const GivenOptions& given);
Result<GivenOptions> ReadGiven(const Path& file);

// The options that a resumed call inherits.
struct Continuation {
  GivenOptions then;
  std::set<std::string> may_differ;  // options
  // Of options that exclude each other: where one is given now, none of then counts.
  std::set<std::string> instead;
};
// Reads the command line again as if all that was given then had been given now. An error names an
// option that is given otherwise, and both values.
Status ContinueWith(const Continuation& before, Command* command, CommandList* list);

}  // namespace tilegrad::cli
