// SPDX-License-Identifier: Apache-2.0
// Configurations as tables of fields: reading, checking, overriding, writing and comparing all walk
// the same table, so a key is written down once, beside its range and its comment.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

// What a key changes. A run continues only with the same results; the rest may change. kPlace: what
// lies at that path affects the result, but it may have moved since the run was started.
enum class Affects { kResult, kReporting, kPlace };

struct ConfigField {
  std::string
      key;  // "network.channels": key `channels` of table [network]; no dot: above all tables
  std::variant<std::string*, std::int64_t*, int*, double*, bool*> target;
  double low, high;  // of numbers, bounds included
  const char* help;  // the comment beside the key
  Affects affects = Affects::kResult;
};
using ConfigFields = std::vector<ConfigField>;

inline constexpr double kNoLimit = 1e12;

// TOML into the targets; missing keys keep their values. An unknown key, a wrong type or a value
// out of range is an error that names line, key and similar keys. A key of a former version may
// have the value that this version behaves as.
Status ReadFields(std::string_view toml, const ConfigFields& fields);
// "schedule.steps=100" and the like, applied in order.
Status OverrideFields(const std::vector<std::string>& assignments, const ConfigFields& fields);
// The string of one key, or `otherwise` if it is not there; looks at no other key.
Result<std::string> ReadStringKey(std::string_view toml, std::string_view key,
                                  const std::string& otherwise);
// InvalidArgument names the first number out of its range.
Status CheckFields(const ConfigFields& fields);

// Complete TOML with a comment on each key; tables appear in the order of their first keys. Reading
// it back gives the same values.
std::string WriteFields(const ConfigFields& fields);
// A line "key = value" for each field that affects the result; of a place only whether it is set.
std::string ResultSettings(const ConfigFields& fields);

}  // namespace tilegrad::train
