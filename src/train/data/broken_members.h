// SPDX-License-Identifier: Apache-2.0
// Unusable members of a set. Each is skipped; too many are an error, because the folder is then a
// wrong one or an incomplete download.
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
  // InvalidArgument if more than kMostShare of `total` are broken, unless `allow`: says how many,
  // names the first of them, and that --allow-broken skips them.
  Status Check(std::size_t total, bool allow) const;
  // A line for each reason: the number of members and the first five; empty if there are none.
  // Groups reasons without the file name with which most of them begin.
  std::string Summary() const;

 private:
  std::vector<std::pair<std::string, std::string>> members_;
};

}  // namespace tilegrad::train
