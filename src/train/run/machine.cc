// SPDX-License-Identifier: Apache-2.0
#include "train/run/machine.h"

#include <sstream>

#include "base/file.h"
#include "base/parallel.h"
#include "base/simd_target.h"
#include "tilegrad/version.h"

namespace tilegrad::train {
namespace {

// /proc files have no size: read line by line.
std::string CpuName() {
  std::FILE* file = std::fopen("/proc/cpuinfo", "r");
  if (file == nullptr) return "unknown";
  std::string name = "unknown";
  for (char line[512]; std::fgets(line, sizeof(line), file) != nullptr;) {
    const std::string text(line);
    if (!text.starts_with("model name")) continue;
    const auto begin = text.find_first_not_of(": \t", text.find(':'));
    if (begin != std::string::npos)
      name = text.substr(begin, text.find_last_not_of('\n') - begin + 1);
    break;
  }
  std::fclose(file);
  return name;
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
