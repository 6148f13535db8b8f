// SPDX-License-Identifier: Apache-2.0
// The whole C++ interface. docs/embedding.md shows how to build against it; c.h is the C interface.
#pragma once

#include "tilegrad/camera.h"    // IWYU pragma: export
#include "tilegrad/options.h"   // IWYU pragma: export
#include "tilegrad/renderer.h"  // IWYU pragma: export
#include "tilegrad/scene.h"     // IWYU pragma: export
#include "tilegrad/status.h"    // IWYU pragma: export
#include "tilegrad/version.h"   // IWYU pragma: export
