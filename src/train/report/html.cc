// SPDX-License-Identifier: Apache-2.0
#include "train/report/html.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/escape_text.h"
#include "base/json_text.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

// Scripts put texts on the page as they are: marks of writing direction have to be visible by then.
nlohmann::ordered_json Shown(nlohmann::ordered_json json) {
  if (json.is_string()) return EscapeControls(json.get_ref<const std::string&>());
  if (json.is_structured()) {
    for (auto& part : json) part = Shown(std::move(part));
  }
  return json;
}

}  // namespace

std::string WithCommas(std::int64_t number) {
  std::string digits = std::to_string(number);
  for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3)
    digits.insert(static_cast<std::size_t>(at), ",");
  return digits;
}

std::string Base64(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t group = 0;
    for (std::size_t i = 0; i < 3; ++i) group = group << 8 | (i < count ? bytes[at + i] : 0u);
    for (std::size_t i = 0; i < 4; ++i)
      out += i <= count ? kDigits[group >> (18 - 6 * i) & 63] : '=';
  }
  return out;
}

std::string ScriptJson(const nlohmann::ordered_json& json) {
  std::string out = DumpJson(Shown(json));
  for (std::size_t at = out.find('<'); at != std::string::npos; at = out.find('<', at))
    out.replace(at, 1, "\\u003c");
  return out;
}

Result<std::string> PngAddress(const ImageU8& image) {
  TILEGRAD_ASSIGN(const Bytes png, io::EncodePng(image));
  return "data:image/png;base64," + Base64(png);
}

Result<std::string> FillTemplate(std::string_view text,
                                 const std::map<std::string, std::string>& values) {
  std::string out;
  for (std::size_t at = 0;;) {
    const std::size_t open = text.find("{{", at);
    out += text.substr(at, open - at);
    if (open == std::string_view::npos) return out;
    const std::size_t close = text.find("}}", open);
    const std::string name(text.substr(open + 2, close - open - 2));
    const auto value = values.find(name);
    if (close == std::string_view::npos || value == values.end())
      return InternalError("the page's template has no value for \"{}\"", name);
    out += value->second;
    at = close + 2;
  }
}

}  // namespace tilegrad::train
