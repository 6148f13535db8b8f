// SPDX-License-Identifier: Apache-2.0
// JSON from files and to files: the one way in which text that need not be UTF-8 (names of files,
// of models, of classes) is written and comes back as it was (JsonName in base/text.h). Its
// definitions are compiled once: a parser or a serializer takes longer to compile than what uses
// it.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/error.h"

namespace tilegrad {

// Guards against deeply nested JSON: the parser, and any code that copies or writes the values,
// recurses as deep as they are nested.
//
// The position of the first bracket nested within `most` others; npos if there is none. The text
// need not be valid.
std::size_t FirstNestedDeeper(std::string_view json, int most);

// Invalid text gives a discarded value (is_discarded()).
template <class Json = nlohmann::json>
Json ParseJsonOrDiscard(std::string_view text);

// An error names the line. `place` is the file's name; `first_line` the number of the text's first
// line in it.
Result<nlohmann::json> ParseJson(std::string_view text, const std::string& place,
                                 int first_line = 1);

// `indent` -1: on one line. Bytes that are not UTF-8 become U+FFFD.
template <class Json>
std::string DumpJson(const Json& json, int indent = -1);

// What ParseJson reads back as it is.
template <class Json>
std::string JsonText(Json json, int indent = -1);

extern template nlohmann::json ParseJsonOrDiscard(std::string_view);
extern template nlohmann::ordered_json ParseJsonOrDiscard(std::string_view);
extern template std::string DumpJson(const nlohmann::json&, int);
extern template std::string DumpJson(const nlohmann::ordered_json&, int);
extern template std::string JsonText(nlohmann::json, int);
extern template std::string JsonText(nlohmann::ordered_json, int);

}  // namespace tilegrad
