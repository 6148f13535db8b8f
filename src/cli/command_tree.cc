// SPDX-License-Identifier: Apache-2.0
#include "cli/command_tree.h"

#include <CLI/CLI.hpp>

#include "cli/command_line.h"
#include "cli/option_words.h"
#include "train/named_configs.h"

namespace tilegrad::cli {
namespace {

// Of "TEXT:{none,lambert}" what stands in the braces.
std::vector<std::string> ChoicesOf(const std::string& type) {
  const auto open = type.find('{'), close = type.find('}');
  if (open == std::string::npos || close == std::string::npos) return {};
  return PartsBetweenCommas(type.substr(open + 1, close - open - 1));
}

// What a value is called: option_text "FLOAT x 3", or the type without its range or choices.
std::string ValueOf(const CLI::Option& option) {
  if (option.get_type_size_max() == 0 || option.get_expected_max() == 0) return "";
  const std::string text =
      option.get_option_text().empty() ? option.get_type_name() : option.get_option_text();
  return text.substr(0, text.find(':'));
}

OptionNode NodeOf(const CLI::Option& option) {
  OptionNode node;
  node.positional = option.get_positional();
  if (node.positional) node.names = {option.get_single_name()};
  for (const auto& name : option.get_snames()) node.names.push_back("-" + name);
  for (const auto& name : option.get_lnames()) node.names.push_back("--" + name);
  node.required = option.get_required();
  node.many = option.get_items_expected_max() > 1000;  // CLI11's "any number"
  node.value = ValueOf(option);
  node.choices = ChoicesOf(option.get_type_name());
  node.path = node.choices.empty() && node.value == "TEXT";
  if (node.names.back() == "--config") node.choices = ConfigNames();
  node.initial = option.get_default_str();
  node.help = option.get_description();
  return node;
}

CommandNode NodeOf(const CLI::App& command) {
  CommandNode node{command.get_name(), command.get_description(), {}};
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_group().empty()) node.options.push_back(NodeOf(*option));  // else: hidden
  }
  return node;
}

}  // namespace

std::vector<std::string> ConfigNames() {
  std::vector<std::string> names;
  for (const auto& config : train::NamedConfigs()) names.emplace_back(config.name);
  return names;
}

std::vector<CommandNode> ReadCommandTree(const CommandList& commands) {
  const auto app = MakeApp(commands);
  std::vector<CommandNode> tree = {NodeOf(*app)};
  for (const CLI::App* command :
       std::as_const(*app).get_subcommands([](const CLI::App*) { return true; }))
    tree.push_back(NodeOf(*command));
  return tree;
}

}  // namespace tilegrad::cli
