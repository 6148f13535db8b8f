// SPDX-License-Identifier: Apache-2.0
// Members of a set that cannot be used. Each costs itself; too many end the run, because then the
// folder is another one, or half a download.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::train {

class BrokenMembers {
 public:
  static constexpr double kMostShare = 0.01;  // of a published set

  void Add(const std::string& name, const std::string& reason) {
    members_.emplace_back(name, reason);
  }
  std::size_t count() const { return members_.size(); }
  // InvalidArgument where more than kMostShare of `total` are broken, unless `allow`: how many, the
  // first of them, and that --allow-broken goes on without them.
  Status Check(std::size_t total, bool allow) const;
  // A line for each reason: how many have it, and the first five of them; empty if there are none.
  // Reasons mostly begin with the file: what is the same in several is what follows it.
  std::string Summary() const;

 private:
  std::vector<std::pair<std::string, std::string>> members_;
};

}  // namespace tilegrad::train
