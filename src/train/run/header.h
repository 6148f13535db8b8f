// SPDX-License-Identifier: Apache-2.0
// <run>/run.json: what a run is, for people and for the commands that look at it.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

// In words, for names of the log that do not explain themselves.
using TermLabels = std::map<std::string, std::string>;

struct RunHeader {
  std::string name = {};            // the configuration's
  std::string dataset = {};         // folder, as training was given it
  std::string dataset_source = {};  // where its models are from
  int training_models = 0;
  std::int64_t parameters = 0;                                    // numbers that are trained
  std::vector<std::pair<std::string, std::string>> machine = {};  // as DescribeMachine
  TermLabels labels = {};  // of what its steps have said so far
};

Status WriteHeader(const Path& run, const RunHeader& header);
// Errors name the file and the key or line.
Result<RunHeader> ReadHeader(const Path& run);

// What a result depends on besides configuration and data, as name and value: version, compiler,
// CPU, cores, SIMD target.
std::vector<std::pair<std::string, std::string>> DescribeMachine();

}  // namespace tilegrad::train
