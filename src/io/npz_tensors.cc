// SPDX-License-Identifier: Apache-2.0
#include "io/npz_tensors.h"

#include <cstring>
#include <optional>

namespace tilegrad::io {
namespace {

std::optional<nn::DType> DTypeOf(NpyType type) {
  switch (type) {
    case NpyType::kF32:
      return nn::DType::kF32;
    case NpyType::kF64:
      return nn::DType::kF64;
    case NpyType::kBool:
    case NpyType::kU8:
      return nn::DType::kU8;
    case NpyType::kI32:
      return nn::DType::kI32;
    case NpyType::kI64:
      return nn::DType::kI64;
    default:
      return std::nullopt;
  }
}

}  // namespace

Result<nn::Tensor> TensorFromNpy(const nn::Context& context, const NpyArray& array,
                                 const std::string& name) {
  const std::optional<nn::DType> dtype = DTypeOf(array.type);
  if (!dtype || array.shape.size() > static_cast<std::size_t>(nn::Shape::kMaxRank)) {
    return DataLoss(
        "{}: {} with {} axes; tensors are float32, float64, uint8, int32 or int64 with "
        "at most {}",
        name, NpyTypeName(array.type), array.shape.size(), nn::Shape::kMaxRank);
  }
  nn::Shape shape;
  for (const std::size_t extent : array.shape) {
    // Beside an extent of 0 the others may be anything.
    const bool possible = extent <= static_cast<std::size_t>(nn::Shape::kMostElements);
    if (possible) shape.Append(static_cast<std::int64_t>(extent));
    if (!possible || !shape.IsPossible()) {
      return DataLoss("{}: a tensor cannot have an extent of {}", name, extent);
    }
  }
  nn::Tensor tensor = context.Empty(shape, *dtype);
  if (!array.data.empty()) std::memcpy(tensor.raw(), array.data.data(), array.data.size());
  return tensor;
}

Result<std::vector<nn::NamedTensor>> LoadNpyTensors(const nn::Context& context, const Path& path) {
  NpzArrays arrays;
  if (path.extension() == ".npy") {
    TILEGRAD_ASSIGN(arrays[path.stem().string()], LoadNpy(path));
  } else {
    TILEGRAD_ASSIGN(arrays, LoadNpz(path));
  }
  std::vector<nn::NamedTensor> tensors;
  for (const auto& [name, array] : arrays) {
    TILEGRAD_ASSIGN(nn::Tensor tensor,
                    TensorFromNpy(context, array, path.string() + ": array \"" + name + "\""));
    tensors.push_back({name, std::move(tensor)});
  }
  return tensors;
}

}  // namespace tilegrad::io
