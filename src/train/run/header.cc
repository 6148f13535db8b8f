// SPDX-License-Identifier: Apache-2.0
#include "train/run/header.h"

#include <fstream>
#include <limits>

#include "base/json_text.h"
#include "base/parallel.h"
#include "base/simd_target.h"
#include "tilegrad/version.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

std::vector<std::pair<std::string, std::string>> TextsIn(const nlohmann::json& json,
                                                         const char* key) {
  std::vector<std::pair<std::string, std::string>> out;
  if (!json.contains(key)) return out;
  for (const auto& [name, value] : json[key].items())
    out.emplace_back(name, value.is_string() ? value.get<std::string>() : DumpJson(value));
  return out;
}

std::string CpuName() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const auto begin = line.find_first_not_of(": \t", line.find(':'));
    if (line.starts_with("model name") && begin != std::string::npos) return line.substr(begin);
  }
  return "unknown";
}

}  // namespace

Status WriteHeader(const Path& run, const RunHeader& header) {
  nlohmann::ordered_json json = {{"name", header.name},
                                 {"dataset", header.dataset},
                                 {"dataset_source", header.dataset_source},
                                 {"training_models", header.training_models},
                                 {"parameters", header.parameters}};
  for (const auto& [key, value] : header.machine) json["machine"][key] = value;
  for (const auto& [name, label] : header.labels) json["labels"][name] = label;
  return WriteTextAtomic(run / "run.json", JsonText(std::move(json), 2) + "\n");
}

Result<RunHeader> ReadHeader(const Path& run) {
  const std::string place = (run / "run.json").string();
  TILEGRAD_ASSIGN(const std::string text, ReadText(place));
  TILEGRAD_ASSIGN(const nlohmann::json json, ParseJson(text, place));
  JsonFields fields(json, place);
  RunHeader header;
  const int most = std::numeric_limits<int>::max();
  int parameters = 0;
  fields.Read("dataset", &header.dataset);
  fields.Read("dataset_source", &header.dataset_source);
  fields.Read("training_models", 0, most, &header.training_models);
  fields.Read("parameters", 0, most, &parameters);
  if (!fields.status().ok()) return fields.status();
  header.parameters = parameters;
  for (const auto& [key, value] : TextsIn(json, "machine")) header.machine.emplace_back(key, value);
  for (const auto& [name, label] : TextsIn(json, "labels")) header.labels.emplace(name, label);
  return header;
}

std::vector<std::pair<std::string, std::string>> DescribeMachine() {
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "g++ " __VERSION__;
#endif
  return {{"version", TILEGRAD_VERSION},
          {"compiler", compiler},
          {"cpu", CpuName()},
          {"cores", std::to_string(AvailableCores())},
          {"simd", ActiveTarget()}};
}

}  // namespace tilegrad::train
