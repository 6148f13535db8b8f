// SPDX-License-Identifier: Apache-2.0
#include "base/simd_target.h"

#include <hwy/highway.h>
#include <hwy/targets.h>

#include <cstdlib>

#include "base/error.h"

namespace tilegrad {
namespace {

std::vector<int64_t> RunnableTargetBits() {
  hwy::SetSupportedTargetsForTest(0);  // forget a forced one
  // Best first: Highway gives better targets lower bits.
  std::vector<int64_t> bits;
  for (int64_t rest = hwy::SupportedTargets() & HWY_TARGETS; rest != 0; rest &= rest - 1) {
    bits.push_back(rest & -rest);
  }
  return bits;
}

std::string g_forced;  // empty: the best. Set by ForceTarget only, never while kernels run.

void Apply(int64_t bits) {
  hwy::SetSupportedTargetsForTest(bits);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace

std::vector<std::string> RunnableTargets() {
  std::vector<std::string> names;
  int64_t forced = 0;
  for (int64_t bit : RunnableTargetBits()) {
    names.emplace_back(hwy::TargetName(bit));
    if (names.back() == g_forced) forced = bit;
  }
  Apply(forced);
  return names;
}

std::string ActiveTarget() { return g_forced.empty() ? RunnableTargets().front() : g_forced; }

Status ForceTarget(const std::string& name) {
  int64_t chosen = 0;
  for (int64_t bit : RunnableTargetBits()) {
    if (name == hwy::TargetName(bit)) chosen = bit;
  }
  if (!name.empty() && chosen == 0) {
    std::string known;
    for (const auto& target : RunnableTargets()) known += (known.empty() ? "" : ", ") + target;
    return InvalidArgument("SIMD target \"{}\" cannot run here; this CPU and build offer: {}", name,
                           known);
  }
  g_forced = name;
  Apply(chosen);
  return {};
}

std::string ForcedTarget() { return g_forced; }

Status ForceTargetFromEnvironment() {
  const char* name = std::getenv("TILEGRAD_TARGET");
  return name == nullptr ? Status() : ForceTarget(name).Within("TILEGRAD_TARGET");
}

}  // namespace tilegrad
