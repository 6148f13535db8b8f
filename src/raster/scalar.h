// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/scalar.h"

namespace tilegrad::raster {

using tilegrad::RealPart;

}  // namespace tilegrad::raster
