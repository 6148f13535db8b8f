// SPDX-License-Identifier: Apache-2.0
// The commands as CLI11 knows them, and what it makes of a command line.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cli/command.h"

namespace CLI {
class App;
}

namespace tilegrad::cli {

// Writes to the options' targets when it parses.
std::unique_ptr<CLI::App> MakeApp(const CommandList& commands);

struct ParsedLine {
  const Command* command = nullptr;  // null: print the texts, and end with the code
  int exit_code = 0;
  std::string out = {}, note = {};  // for standard output and standard error
};
// Words behind the program's name. Sets the targets and words of the options of the command that
// they choose.
ParsedLine ParseLine(std::vector<std::string> words, CommandList* commands);

}  // namespace tilegrad::cli
