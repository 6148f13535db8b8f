// SPDX-License-Identifier: Apache-2.0
// The commands as CLI11 knows them, and parsing of a command line.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "base/file.h"
#include "cli/command.h"

namespace tilegrad::cli {

// Joins lists given as separate words of a command line by commas, as long as words are of the
// list's kind. "--errors 0 1e-3 mesh.obj" becomes "--errors 0,1e-3 mesh.obj"; the same for --up of
// three numbers, which may also be a word.
std::vector<std::string> JoinLists(std::vector<std::string> words);

struct ParsedLine {
  const Command* command = nullptr;  // null: print the texts, and end with the code
  int exit_code = 0;
  std::string out = {}, note = {};  // for standard output and standard error
};
// `words`: those after the program's name. Sets the targets and words of the chosen command's
// options.
ParsedLine ParseLine(std::vector<std::string> words, CommandList* commands);

// The commands and options of the program as CLI11 knows them, in plain records: the source of man
// pages and completions, so that they agree with --help.

struct OptionNode {
  std::vector<std::string> names;  // "-h", "--help"; a positional has only its name
  bool positional = false, required = false, many = false;
  std::string value;                 // "INT", "TEXT", ...; empty: a flag
  std::vector<std::string> choices;  // the values allowed; empty: any
  bool path = false;                 // a text without `choices`, which may be a file
  std::string initial;               // its default; empty: none
  std::string help;
};

struct CommandNode {
  std::string name, help;
  std::vector<OptionNode> options;  // as --help lists them
};

// The configurations that train knows by name.
std::vector<std::string> ConfigNames();

// The program's own options first, under the program's name, then its commands.
std::vector<CommandNode> ReadCommandTree(const CommandList& commands);

// The options given to a command, stored beside its output, so that --resume needs none of them
// again.

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
  // Mutually exclusive options: if one is given now, none of `then` counts.
  std::set<std::string> instead;
};
// Parses the command line again as if the options of `then` had been given, too. An error names an
// option with another value now, and both values.
Status ContinueWith(const Continuation& before, Command* command, CommandList* list);

}  // namespace tilegrad::cli
