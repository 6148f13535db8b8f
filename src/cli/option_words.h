// SPDX-License-Identifier: Apache-2.0
// Options of several words, and where they end. CLI11 would go on with the words behind them: of
// `--eye 0 0 4 --size 64 mesh.obj` with `--eye` last, the mesh would be a fourth number.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tilegrad::cli {

// Declares an option of exactly `count` numbers: "0 -.5 4", or "0,-.5,4" as one word.
template <class T>
CLI::Option* AddVector(CLI::App* command, const std::string& name, std::vector<T>* value, int count,
                       const std::string& help) {
  return command->add_option(name, *value, help)
      ->type_size(count)
      ->expected(1)
      ->delimiter(',')
      ->option_text("FLOAT x " + std::to_string(count));
}

// Makes the options of all commands take no word more than they need, where files may follow. Lists
// then want commas (JoinLists gives them) or their option again.
void EndOptions(CLI::App& app);

// Lists whose words stand apart, in the words of a command line, joined by commas: those that are
// of the list's kind. "--errors 0 1e-3 mesh.obj" becomes "--errors 0,1e-3 mesh.obj"; the same for
// --up of three numbers, which may also be a word.
std::vector<std::string> JoinLists(std::vector<std::string> words);

}  // namespace tilegrad::cli
