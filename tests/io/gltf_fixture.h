// SPDX-License-Identifier: Apache-2.0
// A glTF file that a test builds array by array.
#pragma once

#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temp_folder.h"

namespace tilegrad::io {

class GltfTest : public TempFolderTest {
 protected:
  using Json = nlohmann::json;
  static constexpr int kByte = 5121, kShort = 5123, kFloat = 5126;

  // Without an array yet; `text` has empty lists of buffer views and accessors.
  void Begin(const char* text) {
    json_ = Json::parse(text);
    data_.clear();
  }
  // The index of a buffer view of these numbers.
  template <class T>
  int AddView(const std::vector<T>& values) {
    data_.resize((data_.size() + 3) / 4 * 4);
    const std::size_t at = data_.size(), size = values.size() * sizeof(T);
    data_.resize(at + size);
    std::memcpy(data_.data() + at, values.data(), size);
    json_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", size}});
    return static_cast<int>(json_["bufferViews"].size()) - 1;
  }
  // The index of an accessor of these numbers.
  template <class T>
  int Add(const std::string& type, const std::vector<T>& values) {
    const std::size_t width = type == "MAT4" ? 16 : type == "SCALAR" ? 1 : type.back() - '0';
    json_["accessors"].push_back({{"bufferView", AddView(values)},
                                  {"componentType", sizeof(T) == 1   ? kByte
                                                    : sizeof(T) == 2 ? kShort
                                                                     : kFloat},
                                  {"count", values.size() / width},
                                  {"type", type}});
    return static_cast<int>(json_["accessors"].size()) - 1;
  }
  Path File() {
    Write("a.bin", std::string(data_.begin(), data_.end()));
    json_["buffers"] = {{{"uri", "a.bin"}, {"byteLength", data_.size()}}};
    return Write("a.gltf", json_.dump());
  }

  Json json_;
  std::vector<char> data_;
};

}  // namespace tilegrad::io
