// SPDX-License-Identifier: Apache-2.0
// What a command was given, kept beside what it makes: --resume then needs none of it again.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "base/file.h"
#include "cli/command.h"

namespace tilegrad::cli {

// Values of options by their first names; those of a list with commas between.
using GivenOptions = std::map<std::string, std::string>;

GivenOptions GivenOf(const Command& command);

// One line each, "--fov = 40". Any bytes but 0 survive.
Status WriteGiven(const Path& file, const GivenOptions& given);
Result<GivenOptions> ReadGiven(const Path& file);

// What a call goes on with.
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
