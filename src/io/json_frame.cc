// SPDX-License-Identifier: Apache-2.0
#include "io/json_frame.h"

#include <cmath>

#include "base/json_text.h"

namespace tilegrad::io {

using nlohmann::json;

Result<double> JsonFrame::Number(const char* key) const {
  const json* value = Find(key);
  if (value == nullptr) return DataLoss("{}: \"{}\" is missing", place, key);
  if (!value->is_number()) return DataLoss("{}: \"{}\" is not a number", place, key);
  return value->get<double>();
}

Result<std::vector<double>> JsonFrame::Numbers(const char* key) const {
  const json* value = Find(key);
  if (value == nullptr) return DataLoss("{}: \"{}\" is missing", place, key);
  std::vector<double> out;
  const auto add = [&](const json& x) {
    if (x.is_number()) out.push_back(x.get<double>());
    return x.is_number();
  };
  bool good = value->is_array();
  for (std::size_t i = 0; good && i < value->size(); ++i) {
    const json& row = (*value)[i];
    good = row.is_array() ? std::all_of(row.begin(), row.end(), add) : add(row);
  }
  if (!good) return DataLoss("{}: \"{}\" is not an array of numbers", place, key);
  return out;
}

Result<ImageSize> JsonFrame::Size(const char* width, const char* height) const {
  if (Find(width) == nullptr && Find(height) == nullptr) return ImageSize();
  TILEGRAD_ASSIGN(const double w, Number(width));
  TILEGRAD_ASSIGN(const double h, Number(height));
  constexpr double kMostSide = 1 << 20;
  if (!(w >= 1 && h >= 1 && w <= kMostSide && h <= kMostSide) || w != std::floor(w) ||
      h != std::floor(h)) {
    return DataLoss("{}: an image of {} x {} pixels", place, w, h);
  }
  return ImageSize{static_cast<int>(w), static_cast<int>(h)};
}

std::optional<std::string> JsonFrame::Text(const char* key) const {
  const json* value = FindIn(frame, key);
  if (value == nullptr || !value->is_string()) return std::nullopt;
  return value->get<std::string>();
}

Result<json> ParseJsonObject(const std::string& text, const Path& file) {
  TILEGRAD_ASSIGN(json parsed, ParseJson(text, file.string()));
  if (!parsed.is_object()) return DataLoss("{}: not a JSON object", file.string());
  return parsed;
}

Result<std::vector<JsonFrame>> JsonFrames(const json& top, const Path& file) {
  const json* frames = JsonFrame::FindIn(top, "frames");
  if (frames == nullptr) return std::vector<JsonFrame>{{top, top, file.string()}};
  if (!frames->is_array() || frames->empty())
    return DataLoss("{}: \"frames\" is not an array with something in it", file.string());
  std::vector<JsonFrame> out;
  for (const json& frame : *frames) {
    out.push_back({frame, top, fmt::format("{}: frame {}", file.string(), out.size())});
    if (!frame.is_object()) return DataLoss("{}: not a JSON object", out.back().place);
  }
  return out;
}

}  // namespace tilegrad::io
