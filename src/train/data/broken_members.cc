// SPDX-License-Identifier: Apache-2.0
#include "train/data/broken_members.h"

#include <map>

#include "base/error.h"

namespace tilegrad::train {
namespace {

std::string WithoutFile(const std::string& reason) {
  const auto colon = reason.rfind(": ");
  return colon == std::string::npos ? reason : reason.substr(colon + 2);
}

}  // namespace

Status BrokenMembers::Check(std::size_t total, bool allow) const {
  const double most = kMostShare * static_cast<double>(total);
  if (allow || static_cast<double>(members_.size()) <= most) return {};
  return InvalidArgument(
      "{} of {} cannot be used, more than {:g} %: {}: {}; --allow-broken goes on without them",
      members_.size(), total, 100 * kMostShare, members_[0].first, members_[0].second);
}

std::string BrokenMembers::Summary() const {
  struct Kind {
    int count = 0;
    std::string first;
  };
  std::map<std::string, Kind> kinds;
  for (const auto& [name, reason] : members_) {
    Kind& kind = kinds[WithoutFile(reason)];
    if (kind.count++ == 0) kind.first = name;
  }
  std::string out;
  for (const auto& [reason, kind] : kinds)
    out += fmt::format("  {:>5}  {} ({}{})\n", kind.count, reason, kind.first,
                       kind.count > 1 ? ", ..." : "");
  return out;
}

}  // namespace tilegrad::train
