// SPDX-License-Identifier: Apache-2.0
// Tensors with names, as checkpoints hold them.
#pragma once

#include <string>
#include <vector>

#include "nn/tensor.h"
#include "tilegrad/status.h"

namespace tilegrad::nn {

struct NamedTensor {
  std::string name;  // "encoder.conv1.weight"
  Tensor value;      // shares the storage of the parameter or buffer
};

// The tensor of that name, or null.
const Tensor* Find(const std::vector<NamedTensor>& tensors, const std::string& name);

// Copies the tensors of `from` into those of `to` by name, converting between F32 and F64 (other
// dtypes must be equal). Every name of `to` must be there with its shape; else nothing is changed
// and the error names the first that is not. Further names in `from` are ignored.
Status CopyByName(const std::vector<NamedTensor>& from, std::vector<NamedTensor> to);

}  // namespace tilegrad::nn
