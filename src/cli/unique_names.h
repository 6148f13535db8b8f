// SPDX-License-Identifier: Apache-2.0
// Names for files, each once: the second "chair" is "chair_2".
#pragma once

#include <fmt/core.h>

#include <set>
#include <string>

namespace tilegrad::cli {

class UniqueNames {
 public:
  // `name`, or if it is taken the first of name_2, name_3, ... that is not; taken from now on.
  std::string Take(const std::string& name) {
    std::string unique = name;
    for (int i = 2; !taken_.insert(unique).second; ++i) unique = fmt::format("{}_{}", name, i);
    return unique;
  }

 private:
  std::set<std::string> taken_;
};

}  // namespace tilegrad::cli
