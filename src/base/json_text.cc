// SPDX-License-Identifier: Apache-2.0
#include "base/json_text.h"

#include <algorithm>

#include "base/text.h"

namespace tilegrad {
namespace {

// Applies `change` to every string value in `json`, but not to member names.
template <class Json, class Change>
void ChangeTexts(Json* json, const Change& change) {
  if (json->is_string()) *json = change(json->template get_ref<const std::string&>());
  if (!json->is_structured()) return;
  for (auto& item : *json) ChangeTexts(&item, change);
}

}  // namespace

std::size_t FirstNestedDeeper(std::string_view json, int most) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (c == '"') {
      quoted = !quoted;
    } else if (quoted) {
      i += c == '\\' ? 1 : 0;
    } else if (c == '{' || c == '[') {
      if (++depth > most) return i;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return std::string_view::npos;
}

template <class Json>
Json ParseJsonOrDiscard(std::string_view text) {
  return Json::parse(text, nullptr, /*allow_exceptions=*/false);
}

Result<nlohmann::json> ParseJson(std::string_view text, const std::string& place, int first_line) {
  constexpr int kMostDepth = 100;  // what this program writes is below 10
  if (FirstNestedDeeper(text, kMostDepth) != std::string_view::npos) {
    return DataLoss("{}: from line {} on: nested deeper than {} levels", place, first_line,
                    kMostDepth);
  }
  try {
    nlohmann::json json = nlohmann::json::parse(text);
    ChangeTexts(&json, NameFromJson);
    return json;
  } catch (const nlohmann::json::parse_error& error) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size()));
    const auto line = first_line + std::count(text.begin(), end, '\n');
    return DataLoss("{}: line {}: not valid JSON", place, line);
  } catch (const nlohmann::json::exception& error) {  // a number beyond double; has no position
    return DataLoss("{}: from line {} on: not valid JSON: {}", place, first_line, error.what());
  }
}

template <class Json>
std::string DumpJson(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

template <class Json>
std::string JsonText(Json json, int indent) {
  ChangeTexts(&json, JsonName);
  return DumpJson(json, indent);  // which replaces bytes in member names
}

template nlohmann::json ParseJsonOrDiscard(std::string_view);
template nlohmann::ordered_json ParseJsonOrDiscard(std::string_view);
template std::string DumpJson(const nlohmann::json&, int);
template std::string DumpJson(const nlohmann::ordered_json&, int);
template std::string JsonText(nlohmann::json, int);
template std::string JsonText(nlohmann::ordered_json, int);

}  // namespace tilegrad
