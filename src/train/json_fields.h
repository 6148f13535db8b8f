// SPDX-License-Identifier: Apache-2.0
// Typed reading of JSON objects that came from a file: the first thing that is missing or of
// another type becomes an error that names the place and the key.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/json_nesting.h"

namespace tilegrad::train {

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
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size()));
    const auto line = first_line + std::count(text.begin(), end, '\n');
    return DataLoss("{}: line {}: not valid JSON", place, line);
  } catch (const nlohmann::json::exception& error) {  // a number beyond double; has no place
    return DataLoss("{}: from line {} on: not valid JSON: {}", place, first_line, error.what());
  }
}

class JsonFields {
 public:
  // `object` must outlive this.
  JsonFields(const nlohmann::json& object, std::string place)
      : object_(object), place_(std::move(place)) {
    if (!object.is_object()) status_ = DataLoss("{}: expected a JSON object", place_);
  }

  void Read(const char* key, std::string* out) {
    if (const auto* v = Find(key, &nlohmann::json::is_string, "a string")) *out = *v;
  }
  void Read(const char* key, double* out) {
    if (const auto* v = Find(key, &nlohmann::json::is_number, "a number")) *out = *v;
  }
  void Read(const char* key, int low, int high, int* out) {
    const auto* v = Find(key, &nlohmann::json::is_number_integer, "a whole number");
    if (v == nullptr) return;
    const bool huge = v->is_number_unsigned() && v->get<std::uint64_t>() > INT64_MAX;
    const std::int64_t n = huge ? INT64_MAX : v->get<std::int64_t>();
    if (n < low || n > high) {
      return Fail(DataLoss("{}: \"{}\" must be in [{}, {}]", place_, key, low, high));
    }
    *out = static_cast<int>(n);
  }
  void Read(const char* key, std::vector<std::string>* out) {
    const auto* v = Find(key, &nlohmann::json::is_array, "an array of strings");
    if (v == nullptr) return;
    out->clear();
    for (const auto& item : *v) {
      if (!item.is_string()) {
        return Fail(DataLoss("{}: \"{}\" must be an array of strings", place_, key));
      }
      out->push_back(item);
    }
  }

  void Fail(Status status) {
    if (status_.ok()) status_ = std::move(status);
  }
  const Status& status() const { return status_; }
  const std::string& place() const { return place_; }

 private:
  const nlohmann::json* Find(const char* key, bool (nlohmann::json::*is)() const noexcept,
                             const char* type) {
    if (!status_.ok()) return nullptr;
    const auto at = object_.find(key);
    if (at != object_.end() && ((*at).*is)()) return &*at;
    Fail(DataLoss("{}: \"{}\" must be {}", place_, key, type));
    return nullptr;
  }

  const nlohmann::json& object_;
  std::string place_;
  Status status_;
};

}  // namespace tilegrad::train
