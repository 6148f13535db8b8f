// SPDX-License-Identifier: Apache-2.0
#include "train/config.h"

#include "base/error.h"
#include "base/read_budget.h"
#include "train/tasks/registry.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOfParts(std::string* name, std::string* kind, Schedule* schedule, Task* task) {
  ConfigFields fields = {{"name", name, 0, 0, "display name of the run", Affects::kReporting},
                         {"task.kind", kind, 0, 0, "the task to train"}};
  for (const ConfigFields& part : {task->Fields(), FieldsOf(schedule)})
    fields.insert(fields.end(), part.begin(), part.end());
  return fields;
}

// Whether or not a task uses it: with stream.share = 0 a wrong one would be noticed late or never.
Status CheckCache(const ConfigFields& fields) {
  for (const ConfigField& field : fields) {
    if (field.key == "stream.cache")
      return ParseByteCount(*std::get<std::string*>(field.target)).status().Within(field.key);
  }
  return {};
}

Status ParseInto(std::string_view text, TrainConfig* config) {
  TILEGRAD_ASSIGN(config->kind, ReadStringKey(text, "task.kind", kDefaultTask));
  TILEGRAD_ASSIGN(config->task, MakeTask(config->kind));
  TILEGRAD_TRY(ReadFields(text, config->Fields()));
  return CheckCache(config->Fields());
}

}  // namespace

ConfigFields TrainConfig::Fields() { return FieldsOfParts(&name, &kind, &schedule, task.get()); }

Result<TrainConfig> ReadConfig(const Path& path) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(path, 1 << 20));
  return ParseConfig(text, path.string());
}

Result<TrainConfig> ParseConfig(std::string_view text, const std::string& name) {
  TrainConfig config;
  TILEGRAD_TRY(ParseInto(text, &config).Within(name));
  return config;
}

Status ApplyOverrides(const std::vector<std::string>& assignments, TrainConfig* config) {
  const std::string kind = config->kind;
  Status status = OverrideFields(assignments, config->Fields());
  if (std::exchange(config->kind, kind) == kind)
    return status.ok() ? CheckCache(config->Fields()) : status;
  return InvalidArgument("task.kind cannot be overridden: name the task in the configuration file");
}

std::string WriteConfig(const TrainConfig& config) {
  std::string name = config.name, kind = config.kind;
  Schedule schedule = config.schedule;
  return WriteFields(FieldsOfParts(&name, &kind, &schedule, config.task.get()));
}

}  // namespace tilegrad::train
