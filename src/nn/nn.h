// SPDX-License-Identifier: Apache-2.0
// Everything a network needs, in one include.
#pragma once

// IWYU pragma: begin_exports
#include "nn/context.h"
#include "nn/init.h"
#include "nn/layers.h"
#include "nn/moving_average.h"
#include "nn/networks/features.h"
#include "nn/networks/gan.h"
#include "nn/networks/unet.h"
#include "nn/ops/batch_norm.h"
#include "nn/ops/conv.h"
#include "nn/ops/index.h"
#include "nn/ops/matmul.h"
#include "nn/ops/pad.h"
#include "nn/ops/pointwise.h"
#include "nn/ops/pool.h"
#include "nn/ops/reduce.h"
#include "nn/ops/resize.h"
#include "nn/ops/shape.h"
#include "nn/ops/softmax.h"
#include "nn/optim.h"
#include "nn/schedule.h"
#include "nn/serialize.h"
#include "nn/tape.h"
#include "nn/tensor.h"
// IWYU pragma: end_exports
