// SPDX-License-Identifier: Apache-2.0
// Everything a network needs, in one include.
#pragma once

// IWYU pragma: begin_exports
#include "nn/context.h"
#include "nn/layers.h"
#include "nn/networks.h"
#include "nn/ops.h"
#include "nn/optim.h"
#include "nn/serialize.h"
#include "nn/tape.h"
#include "nn/tensor.h"
// IWYU pragma: end_exports
