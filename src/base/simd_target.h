// SPDX-License-Identifier: Apache-2.0
// The instruction set in use. Kernels are compiled for several Highway targets; the first call
// selects the best one that the CPU has. TILEGRAD_TARGET=AVX2 (say) in the environment forces one,
// which makes results reproducible across machines.
#pragma once

#include <string>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad {

// The targets ("AVX2", "SSE4", "EMU128", ...) compiled in that this CPU can run, best first.
std::vector<std::string> RunnableTargets();
// The target that kernels use now.
std::string ActiveTarget();
// Uses only `name` from now on, or the best target again if `name` is empty. Not while kernels run.
// An unknown or unsupported name is an error that lists RunnableTargets().
Status ForceTarget(const std::string& name);
// The forced target, empty if none.
std::string ForcedTarget();
// ForceTarget(getenv("TILEGRAD_TARGET")) if that is set. Programs call it once at start.
Status ForceTargetFromEnvironment();

// Forces a target for a scope, then restores the previous one. Not while kernels run.
class TargetScope {
 public:
  explicit TargetScope(const std::string& name)
      : before_(ForcedTarget()), status_(ForceTarget(name)) {}
  ~TargetScope() { (void)ForceTarget(before_); }
  TargetScope(const TargetScope&) = delete;
  TargetScope& operator=(const TargetScope&) = delete;

  const Status& status() const { return status_; }  // result of ForceTarget

 private:
  std::string before_;
  Status status_;
};

}  // namespace tilegrad
