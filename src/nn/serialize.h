// SPDX-License-Identifier: Apache-2.0
// safetensors files: the field's plain format for named tensors.
// https://github.com/huggingface/safetensors#format: u64 header length (little endian), JSON
// header, then the data that the header's offsets point into.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "nn/layers.h"

namespace tilegrad::nn {

struct TensorFile {
  std::vector<NamedTensor> tensors;             // in file order
  std::map<std::string, std::string> metadata;  // the header's "__metadata__"
};

// Reads dtypes F32, F64, U8, I32 and I64, and F16 as F32, which is exact. Checks every length,
// offset and shape in the header against the file before it allocates; an inconsistent or truncated
// file gives kDataLoss, whose message names the tensor.
Result<TensorFile> DecodeSafetensors(Context& context, std::span<const std::uint8_t> bytes);
// The metadata alone: also of files whose tensors this cannot read.
Result<std::map<std::string, std::string>> SafetensorsMetadata(std::span<const std::uint8_t> bytes);
Result<TensorFile> ReadSafetensors(Context& context, const Path& path);

// How a file holds tensors of F32.
enum class StoredFloats {
  kFull,  // as they are
  kHalf,  // F16: each number the nearest one, ties to even
};
// Names must be unique and not "__metadata__"; they and the metadata UTF-8. kHalf: InvalidArgument
// names the tensor with a number that float16 has not: 65520 or more, or not finite.
Result<Bytes> EncodeSafetensors(const TensorFile& file, StoredFloats floats = StoredFloats::kFull);
Status WriteSafetensors(const Path& path, const TensorFile& file,
                        StoredFloats floats = StoredFloats::kFull);  // whole or not at all

}  // namespace tilegrad::nn
