// SPDX-License-Identifier: Apache-2.0
// Reads and writes JSON; text that need not be UTF-8 (names of files, models, classes) survives the
// round trip (JsonName in base/text.h). Definitions are compiled once: the parser and the
// serializer take longer to compile than the code that uses them.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/error.h"

namespace tilegrad {

// Guards against deeply nested JSON, since the parser and all code that copies or writes values
// recurse once per level.
//
// Returns the position of the first bracket nested within `most` others; npos if there is none. The
// text need not be valid.
std::size_t FirstNestedDeeper(std::string_view json, int most);

// Invalid text gives a discarded value (is_discarded()).
template <class Json = nlohmann::json>
Json ParseJsonOrDiscard(std::string_view text);

// An error names the line. `place` is the file's name; `first_line` is the number of the text's
// first line in that file.
Result<nlohmann::json> ParseJson(std::string_view text, const std::string& place,
                                 int first_line = 1);

// `indent` -1: on one line. Replaces bytes that are not UTF-8 by U+FFFD.
template <class Json>
std::string DumpJson(const Json& json, int indent = -1);

// Lossless: ParseJson restores all values, strings that are not UTF-8 included. In member names
// such bytes become U+FFFD.
template <class Json>
std::string JsonText(Json json, int indent = -1);

extern template nlohmann::json ParseJsonOrDiscard(std::string_view);
extern template nlohmann::ordered_json ParseJsonOrDiscard(std::string_view);
extern template std::string DumpJson(const nlohmann::json&, int);
extern template std::string DumpJson(const nlohmann::ordered_json&, int);
extern template std::string JsonText(nlohmann::json, int);
extern template std::string JsonText(nlohmann::ordered_json, int);

}  // namespace tilegrad
