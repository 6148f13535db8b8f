// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/registry.h"

#include <map>

#include "base/error.h"

namespace tilegrad::train {
namespace {

std::map<std::string, TaskFactory>& Factories() {
  static std::map<std::string, TaskFactory> factories = {{kDefaultTask, &MakeSingleImageTask},
                                                         {"textured_image", &MakeTexturedImageTask},
                                                         {"photographs", &MakePhotographsTask},
                                                         {"classify", &MakeClassifyTask},
                                                         {"gan", &MakeGanTask}};
  return factories;
}

}  // namespace

void RegisterTask(const std::string& kind, TaskFactory make) { Factories()[kind] = make; }

Result<std::unique_ptr<Task>> MakeTask(const std::string& kind) {
  const auto found = Factories().find(kind);
  if (found != Factories().end()) return found->second();
  std::string known;
  for (const auto& [name, make] : Factories())
    known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", name);
  return InvalidArgument("task.kind is \"{}\", but must be one of {}", kind, known);
}

}  // namespace tilegrad::train
