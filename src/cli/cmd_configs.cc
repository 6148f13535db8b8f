// SPDX-License-Identifier: Apache-2.0
// tilegrad configs: the configurations that train --config knows by name.
#include "base/error.h"
#include "cli/command.h"
#include "cli/console.h"
#include "train/config.h"

namespace tilegrad::cli {
namespace {

// The comment that the file begins with, up to the end of its first sentence.
std::string FirstSentence(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size() && out.find(". ") == std::string::npos; ++i) {
    if (text[i] != '#' && text[i] != '\n') out += text[i];
    if (text[i] == '\n' && (i + 1 >= text.size() || text[i + 1] != '#')) break;
  }
  const std::string sentence = out.substr(0, out.find(". "));
  const auto begin = sentence.find_first_not_of(' ');
  return begin == std::string::npos ? "" : sentence.substr(begin);
}

Status RunConfigs(const std::string& name) {
  if (!name.empty()) {
    TILEGRAD_ASSIGN(const train::NamedConfig config, train::ConfigNamed(name));
    Print("{}", config.text);
    return {};
  }
  for (const train::NamedConfig& config : train::NamedConfigs())
    Print("{:<14}  {}\n", config.name, FirstSentence(config.text));
  return {};
}

}  // namespace

void AddConfigs(CommandList* list) {
  const auto [command, name] = AddCommand(
      list, "configs", "List the built-in configurations for train --config", RunConfigs);
  command->Add("name", name, "print this one instead, for example into a file to edit");
}

}  // namespace tilegrad::cli
