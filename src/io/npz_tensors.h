// SPDX-License-Identifier: Apache-2.0
// NumPy files as the tensors of the NN library: weights and data that Python wrote.
#pragma once

#include <string>
#include <vector>

#include "io/npz.h"
#include "nn/context.h"
#include "nn/named_tensors.h"

namespace tilegrad::io {

// Of float32, float64, uint8, bool (as uint8), int32 and int64 and at most five axes; an error says
// what the array is instead. `name` stands in messages.
Result<nn::Tensor> TensorFromNpy(const nn::Context& context, const NpyArray& array,
                                 const std::string& name);

// Every array of an .npz, sorted by name; of an .npy, one tensor named as the file without its
// ending. nn::CopyByName and nn::LoadState take them as they are.
Result<std::vector<nn::NamedTensor>> LoadNpyTensors(const nn::Context& context, const Path& path);

}  // namespace tilegrad::io
