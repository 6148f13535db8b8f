// SPDX-License-Identifier: Apache-2.0
#include "train/run/machine.h"

#include <fstream>

#include "base/parallel.h"
#include "base/simd_target.h"
#include "tilegrad/version.h"

namespace tilegrad::train {
namespace {

std::string CpuName() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const auto begin = line.find_first_not_of(": \t", line.find(':'));
    if (line.starts_with("model name") && begin != std::string::npos) return line.substr(begin);
  }
  return "unknown";
}

}  // namespace

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
