// SPDX-License-Identifier: Apache-2.0
#include "base/progress.h"

#include "base/error.h"

namespace tilegrad {

Status Watch::At(const Progress& now) const {
  if (stopped()) return Cancelled("stopped while {}", now.stage);
  if (progress) progress(now);
  return {};
}

}  // namespace tilegrad
