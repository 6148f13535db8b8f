// SPDX-License-Identifier: Apache-2.0
#include "train/run/config_fields.h"

#include <toml++/toml.h>

#include <algorithm>
#include <numeric>
#include <sstream>
#include <type_traits>

#include "base/error.h"

namespace tilegrad::train {
namespace {

using Target = decltype(ConfigField::target);

std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replace = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replace, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

std::string_view LastPart(std::string_view key) { return key.substr(key.rfind('.') + 1); }

// How far a key is from a known one: letters, but a table that is missing or another counts as one.
std::size_t KeyDistance(const std::string& known, const std::string& key) {
  return std::min(EditDistance(known, key), EditDistance(LastPart(known), LastPart(key)) + 1);
}

Status UnknownKey(const ConfigFields& fields, const std::string& key) {
  const auto closest = std::min_element(fields.begin(), fields.end(),
                                        [&](const ConfigField& a, const ConfigField& b) {
                                          return KeyDistance(a.key, key) < KeyDistance(b.key, key);
                                        });
  return InvalidArgument("unknown key \"{}\"; the closest known one is \"{}\"", key, closest->key);
}

Status CheckRange(const ConfigField& field, double value) {
  if (value >= field.low && value <= field.high) return {};  // false for NaN
  return InvalidArgument("{} is {}, but must be within [{}, {}]", field.key, value, field.low,
                         field.high);
}

// One overload for each type of target.
struct SetFromToml {
  const ConfigField& field;
  const toml::node& node;

  Status operator()(std::string* text) const {
    if (!node.is_string()) return InvalidArgument("{} must be a string", field.key);
    *text = node.ref<std::string>();
    return {};
  }
  Status operator()(bool* flag) const {
    if (!node.is_boolean()) return InvalidArgument("{} must be true or false", field.key);
    *flag = node.ref<bool>();
    return {};
  }
  Status operator()(double* number) const {
    if (!node.is_number()) return InvalidArgument("{} must be a number", field.key);
    // node.value<double>() is empty for whole numbers that double does not have.
    const auto* whole = node.as_integer();
    *number = whole != nullptr ? static_cast<double>(whole->get()) : node.ref<double>();
    return CheckRange(field, *number);
  }
  template <class Integer>
  Status operator()(Integer* integer) const {
    if (!node.is_integer()) return InvalidArgument("{} must be a whole number", field.key);
    const std::int64_t value = node.ref<std::int64_t>();
    TILEGRAD_TRY(CheckRange(field, static_cast<double>(value)));
    *integer = static_cast<Integer>(value);
    return {};
  }
};

Status Place(const toml::node& node, const Status& status) {
  return status.Within(fmt::format("line {}", node.source().begin.line));
}

Status SetTable(const ConfigFields& fields, const toml::table& table, const std::string& prefix) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (const auto* inner = node.as_table()) {
      TILEGRAD_TRY(SetTable(fields, *inner, key + "."));
      continue;
    }
    const auto field = std::find_if(fields.begin(), fields.end(),
                                    [&](const ConfigField& f) { return f.key == key; });
    if (field == fields.end()) return Place(node, UnknownKey(fields, key));
    const Status set = std::visit(SetFromToml{*field, node}, field->target);
    if (!set.ok()) return Place(node, set);
  }
  return {};
}

// use(table) of the text's tables.
template <class Use>
Status WithToml(std::string_view text, Use use) {
  // A key of many parts is a table in a table in a table: toml++ uses up the stack when it frees
  // some ten thousand. A configuration of all keys has less than a hundred dots.
  constexpr std::ptrdiff_t kMostDots = 4096;
  if (std::count(text.begin(), text.end(), '.') > kMostDots)
    return InvalidArgument("more than {} dots", kMostDots);
  try {
    return use(toml::parse(text));
  } catch (const toml::parse_error& error) {
    return InvalidArgument("line {}: {}", error.source().begin.line, error.description());
  }
}

// The shortest text that reads back as the same value.
std::string ShortText(const Target& target) {
  return std::visit([](const auto* value) { return fmt::format("{}", *value); }, target);
}

std::string TomlText(const Target& target) {
  if (auto* text = std::get_if<std::string*>(&target)) {
    std::ostringstream out;
    out << toml::value<std::string>(**text);
    return out.str();
  }
  const std::string text = ShortText(target);
  // A number that is no whole one has a point or an exponent.
  const bool whole =
      std::holds_alternative<double*>(target) && text.find_first_of(".en") == std::string::npos;
  return whole ? text + ".0" : text;
}

std::string TableOf(const ConfigField& field) {
  const auto dot = field.key.rfind('.');
  return dot == std::string::npos ? "" : field.key.substr(0, dot);
}

std::string FieldLine(const ConfigField& field) {
  const std::string setting = fmt::format("{} = {}", LastPart(field.key), TomlText(field.target));
  return fmt::format("{:<36}  # {}\n", setting, field.help);
}

Status OverrideField(const std::string& assignment, const ConfigFields& fields) {
  const auto equals = assignment.find('=');
  if (equals == std::string::npos)
    return InvalidArgument("\"{}\" is not of the form key=value", assignment);
  const std::string key = assignment.substr(0, equals), value = assignment.substr(equals + 1);
  const auto field = std::find_if(fields.begin(), fields.end(),
                                  [&](const ConfigField& f) { return f.key == key; });
  if (field == fields.end()) return UnknownKey(fields, key);
  // Text needs no quotes here.
  std::string text = value;
  auto* const* target = std::get_if<std::string*>(&field->target);
  TILEGRAD_TRY(ReadFields(key + " = " + (target != nullptr ? TomlText(&text) : value), fields)
                   .Within(assignment));
  if (target != nullptr && **target != value)  // toml++ takes other bytes for Latin-1
    return InvalidArgument("{} must be UTF-8", key);
  return {};
}

}  // namespace

Status ReadFields(std::string_view toml, const ConfigFields& fields) {
  return WithToml(toml, [&](const toml::table& table) { return SetTable(fields, table, ""); });
}

Status OverrideFields(const std::vector<std::string>& assignments, const ConfigFields& fields) {
  for (const std::string& assignment : assignments) TILEGRAD_TRY(OverrideField(assignment, fields));
  return {};
}

Result<std::string> ReadStringKey(std::string_view toml, std::string_view key,
                                  const std::string& otherwise) {
  std::string value = otherwise;
  const Status status = WithToml(toml, [&](const toml::table& table) -> Status {
    const auto node = table.at_path(key);
    if (!node) return {};
    if (!node.is_string()) return InvalidArgument("{} must be a string", key);
    value = node.ref<std::string>();
    return {};
  });
  if (!status.ok()) return status;
  return value;
}

Status CheckFields(const ConfigFields& fields) {
  for (const ConfigField& field : fields) {
    TILEGRAD_TRY(std::visit(
        [&]<class T>(const T* value) -> Status {
          if constexpr (std::is_same_v<T, std::string> || std::is_same_v<T, bool>)
            return {};
          else
            return CheckRange(field, static_cast<double>(*value));
        },
        field.target));
  }
  return {};
}

std::string WriteFields(const ConfigFields& fields) {
  std::vector<std::pair<std::string, std::string>> tables = {{"", ""}};  // name, lines
  for (const ConfigField& field : fields) {
    const std::string table = TableOf(field);
    auto at = std::find_if(tables.begin(), tables.end(),
                           [&](const auto& known) { return known.first == table; });
    if (at == tables.end()) at = tables.insert(at, {table, ""});
    at->second += FieldLine(field);
  }
  std::string out;
  for (const auto& [table, lines] : tables) {
    if (!table.empty()) out += fmt::format("\n[{}]\n", table);
    out += lines;
  }
  return out;
}

std::string ResultSettings(const ConfigFields& fields) {
  std::string out;
  for (const ConfigField& field : fields) {
    if (field.affects == Affects::kResult)
      out += fmt::format("{} = {}\n", field.key, ShortText(field.target));
  }
  return out;
}

}  // namespace tilegrad::train
