// SPDX-License-Identifier: Apache-2.0
// tilegrad completion: the script that lets a shell complete commands and options.
#include "cli/command.h"
#include "cli/completion.h"
#include "cli/console.h"

namespace tilegrad::cli {

void AddCompletion(CLI::App& app, Action* action) {
  auto shell = std::make_shared<std::string>();
  auto* command = app.add_subcommand(
      "completion",
      "Print the completion script of a shell, e.g. for: source <(tilegrad completion bash)");
  command->add_option("shell", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->callback([&app, shell, action] {
    *action = [&app, shell]() -> Status {
      const auto tree = ReadCommandTree(app);
      Print("{}", *shell == "bash"  ? BashCompletion(tree)
                  : *shell == "zsh" ? ZshCompletion(tree)
                                    : FishCompletion(tree));
      return {};
    };
  });
}

}  // namespace tilegrad::cli
