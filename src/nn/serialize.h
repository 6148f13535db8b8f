// SPDX-License-Identifier: Apache-2.0
// safetensors files: the standard format for named tensors.
// https://github.com/huggingface/safetensors#format: u64 header length (little endian), JSON
// header, then the data to which the header's offsets refer.
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
// offset and shape in the header against the file before allocating; kDataLoss for an inconsistent
// or truncated file, naming the tensor.
Result<TensorFile> DecodeSafetensors(Context& context, std::span<const std::uint8_t> bytes);
// Only the metadata, even of files with unsupported tensors.
Result<std::map<std::string, std::string>> SafetensorsMetadata(std::span<const std::uint8_t> bytes);
Result<TensorFile> ReadSafetensors(Context& context, const Path& path);

// Storage of F32 tensors in a file.
enum class StoredFloats {
  kFull,  // unchanged
  kHalf,  // F16: rounded to nearest, ties to even
};
// Names must be unique and not "__metadata__"; names and metadata must be UTF-8. kHalf:
// InvalidArgument names a tensor with numbers that float16 cannot hold: 65520 or more, or not
// finite.
Result<Bytes> EncodeSafetensors(const TensorFile& file, StoredFloats floats = StoredFloats::kFull);
Status WriteSafetensors(const Path& path, const TensorFile& file,
                        StoredFloats floats = StoredFloats::kFull);  // atomic

}  // namespace tilegrad::nn
