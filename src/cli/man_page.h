// SPDX-License-Identifier: Apache-2.0
// Manual pages in the man(7) language: tilegrad(1), and tilegrad-fit(1) and so on for its commands.
#pragma once

#include <span>
#include <string>

#include "cli/command_tree.h"

namespace tilegrad::cli {

// Of the program, tree[0], with its commands.
std::string ProgramManPage(std::span<const CommandNode> tree);
std::string CommandManPage(const CommandNode& command);

}  // namespace tilegrad::cli
