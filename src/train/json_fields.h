// SPDX-License-Identifier: Apache-2.0
// Typed reading of JSON objects from files: the first missing or mistyped field becomes an error
// that names the place and the key.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/json_text.h"

namespace tilegrad::train {

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
    if (n < low || n > high)
      return Fail(DataLoss("{}: \"{}\" must be in [{}, {}]", place_, key, low, high));
    *out = static_cast<int>(n);
  }
  void Read(const char* key, std::vector<std::string>* out) {
    const auto* v = Find(key, &nlohmann::json::is_array, "an array of strings");
    if (v == nullptr) return;
    out->clear();
    for (const auto& item : *v) {
      if (!item.is_string())
        return Fail(DataLoss("{}: \"{}\" must be an array of strings", place_, key));
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
