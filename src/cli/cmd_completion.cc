// SPDX-License-Identifier: Apache-2.0
// tilegrad completion: the script that lets a shell complete commands and options.
#include "cli/command.h"
#include "cli/completion.h"
#include "cli/console.h"

namespace tilegrad::cli {

void AddCompletion(CommandList* list) {
  auto shell = std::make_shared<std::string>();
  Command& command = list->emplace_back(Command{
      "completion",
      "Print the completion script of a shell, e.g. for: source <(tilegrad completion bash)"});
  command.Add("shell", shell.get(), "bash, zsh or fish",
              {Required{}, OneOf{{"bash", "zsh", "fish"}}});
  command.action = [list, shell]() -> Status {
    const auto tree = ReadCommandTree(*list);
    Print("{}", *shell == "bash"  ? BashCompletion(tree)
                : *shell == "zsh" ? ZshCompletion(tree)
                                  : FishCompletion(tree));
    return {};
  };
}

}  // namespace tilegrad::cli
