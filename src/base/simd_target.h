// SPDX-License-Identifier: Apache-2.0
// The instruction set in use. Kernels are compiled for several Highway targets and the best one the
// CPU has is taken at the first call; TILEGRAD_TARGET=AVX2 (say) in the environment forces one,
// which makes results reproducible across machines.
#pragma once

#include <string>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad {

// Names ("AVX2", "SSE4", "EMU128", ...) of the targets that are compiled in and that this CPU can
// run, best first.
std::vector<std::string> RunnableTargets();
// The name of the one that kernels use now.
std::string ActiveTarget();
// Uses only `name` from now on, or the best one again if `name` is empty. Not while kernels run.
// Unknown or not runnable: an error that lists RunnableTargets().
Status ForceTarget(const std::string& name);
// The name that was forced, empty if none is.
std::string ForcedTarget();
// ForceTarget(getenv("TILEGRAD_TARGET")) where that is set. Programs call it once at start.
Status ForceTargetFromEnvironment();

// Forces a target for a scope, then what was forced before. Not while kernels run.
class TargetScope {
 public:
  explicit TargetScope(const std::string& name)
      : before_(ForcedTarget()), status_(ForceTarget(name)) {}
  ~TargetScope() { (void)ForceTarget(before_); }
  TargetScope(const TargetScope&) = delete;
  TargetScope& operator=(const TargetScope&) = delete;

  const Status& status() const { return status_; }  // of ForceTarget

 private:
  std::string before_;
  Status status_;
};

}  // namespace tilegrad
