// SPDX-License-Identifier: Apache-2.0
// Everything a network needs, in one include.
#pragma once

// IWYU pragma: begin_exports
#include "nn/context.h"
#include "nn/features.h"
#include "nn/gan.h"
#include "nn/layers.h"
#include "nn/ops/axis_map.h"
#include "nn/ops/batch_norm.h"
#include "nn/ops/conv.h"
#include "nn/ops/index.h"
#include "nn/ops/matmul.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/pool.h"
#include "nn/ops/reduce.h"
#include "nn/ops/shape.h"
#include "nn/optim.h"
#include "nn/serialize.h"
#include "nn/tape.h"
#include "nn/tensor.h"
#include "nn/unet.h"
// IWYU pragma: end_exports
