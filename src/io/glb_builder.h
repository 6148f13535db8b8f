// SPDX-License-Identifier: Apache-2.0
// The two chunks of a GLB file while they grow.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "base/file.h"

namespace tilegrad::io {

// The binary chunk and the JSON that describes it.
struct GlbBuilder {
  using Json = nlohmann::ordered_json;
  static constexpr int kFloat = 5126, kUnsignedInt = 5125, kArrayBuffer = 34962,
                       kElementBuffer = 34963;

  Bytes binary;
  Json json = {{"asset", {{"version", "2.0"}, {"generator", "tilegrad"}}}};

  int AddView(const void* data, std::size_t bytes, int target) {
    while (binary.size() % 4 != 0) binary.push_back(0);
    Json view = {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes}};
    if (target != 0) view["target"] = target;
    const auto* begin = static_cast<const std::uint8_t*>(data);
    binary.insert(binary.end(), begin, begin + bytes);
    json["bufferViews"].push_back(std::move(view));
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  template <class Vec>
  int AddVectors(const std::vector<Vec>& values) {
    const int view = AddView(values.data(), values.size() * sizeof(Vec), kArrayBuffer);
    json["accessors"].push_back({{"bufferView", view},
                                 {"componentType", kFloat},
                                 {"count", values.size()},
                                 {"type", fmt::format("VEC{}", Vec::length())}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  int AddIndices(const std::vector<std::uint32_t>& values) {
    const int view = AddView(values.data(), values.size() * sizeof(std::uint32_t), kElementBuffer);
    json["accessors"].push_back({{"bufferView", view},
                                 {"componentType", kUnsignedInt},
                                 {"count", values.size()},
                                 {"type", "SCALAR"}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }
};

// The file. ResourceExhausted beyond 4 GiB.
Result<Bytes> AssembleGlb(GlbBuilder& glb);

}  // namespace tilegrad::io
