// SPDX-License-Identifier: Apache-2.0
// Completion scripts of shells: commands, options, and values that are one of a list; files
// elsewhere.
#pragma once

#include <span>
#include <string>

#include "cli/command_tree.h"

namespace tilegrad::cli {

std::string BashCompletion(std::span<const CommandNode> tree);
std::string ZshCompletion(std::span<const CommandNode> tree);
std::string FishCompletion(std::span<const CommandNode> tree);

}  // namespace tilegrad::cli
