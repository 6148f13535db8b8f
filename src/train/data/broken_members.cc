// SPDX-License-Identifier: Apache-2.0
#include "train/data/broken_members.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <span>

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
  constexpr std::size_t kNamed = 5;
  std::map<std::string, std::vector<std::string>> kinds;
  for (const auto& [name, reason] : members_) kinds[WithoutFile(reason)].push_back(name);
  std::string out;
  for (const auto& [reason, names] : kinds) {
    const std::span<const std::string> named(names.data(), std::min(kNamed, names.size()));
    out += fmt::format("  {:>5}  {} ({}{})\n", names.size(), reason, fmt::join(named, ", "),
                       names.size() > kNamed ? ", ..." : "");
  }
  return out;
}

}  // namespace tilegrad::train
