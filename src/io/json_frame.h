// SPDX-License-Identifier: Apache-2.0
// Internal to io: a frame of a JSON file of cameras, and the file around it.
#pragma once

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "scene/camera.h"

namespace tilegrad::io {

// What the frame omits is taken from the top level. null is as good as nothing. Errors begin with
// `place`.
struct JsonFrame {
  const nlohmann::json& frame;
  const nlohmann::json& top;
  std::string place;

  static const nlohmann::json* FindIn(const nlohmann::json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && !found->is_null() ? &*found : nullptr;
  }
  const nlohmann::json* Find(const char* key) const {
    const nlohmann::json* own = FindIn(frame, key);
    return own != nullptr ? own : FindIn(top, key);
  }
  Result<double> Number(const char* key) const;
  // Of rows or flat.
  Result<std::vector<double>> Numbers(const char* key) const;
  template <std::size_t N>
  Result<std::array<double, N>> Array(const char* key) const {
    TILEGRAD_ASSIGN(const auto numbers, Numbers(key));
    if (numbers.size() != N)
      return DataLoss("{}: \"{}\" has {} numbers, not {}", place, key, numbers.size(), N);
    std::array<double, N> out;
    std::copy(numbers.begin(), numbers.end(), out.begin());
    return out;
  }
  // Of the image; 0 x 0 if neither is there.
  Result<ImageSize> Size(const char* width, const char* height) const;
  // The frame's own; nothing where that is no text.
  std::optional<std::string> Text(const char* key) const;
};

// An object, or an error that names the file.
Result<nlohmann::json> ParseJsonObject(const std::string& text, const Path& file);

// Its "frames", or the whole where there are none.
Result<std::vector<JsonFrame>> JsonFrames(const nlohmann::json& top, const Path& file);

}  // namespace tilegrad::io
