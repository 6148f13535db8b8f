// SPDX-License-Identifier: Apache-2.0
// JSON from files and to files: the one way in which text that need not be UTF-8 (names of files,
// of models, of classes) is written and comes back as it was (JsonName in base/text.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad {

// Guards against deeply nested JSON: the parser, and any code that copies or writes the values,
// recurses as deep as they are nested.
//
// The position of the first bracket nested within `most` others; npos if there is none. The text
// need not be valid.
inline std::size_t FirstNestedDeeper(std::string_view json, int most) {
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

// change(text) for every text in `json`, names of members left out.
template <class Json, class Change>
void ChangeTexts(Json* json, const Change& change) {
  if (json->is_string()) *json = change(json->template get_ref<const std::string&>());
  if (!json->is_structured()) return;
  for (auto& item : *json) ChangeTexts(&item, change);
}

// An error names the line. `place` is the file's name; `first_line` the number of the text's first
// line in it.
inline Result<nlohmann::json> ParseJson(std::string_view text, const std::string& place,
                                        int first_line = 1) {
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
  } catch (const nlohmann::json::exception& error) {  // a number beyond double; has no place
    return DataLoss("{}: from line {} on: not valid JSON: {}", place, first_line, error.what());
  }
}

// What ParseJson reads back as it is. `indent` -1: on one line.
template <class Json>
std::string JsonText(Json json, int indent = -1) {
  ChangeTexts(&json, JsonName);
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);  // names of members
}

}  // namespace tilegrad
