// SPDX-License-Identifier: Apache-2.0
#include "train/run/config_fields.h"

#include <toml++/toml.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <type_traits>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad::train {
namespace {

using Target = decltype(ConfigField::target);

std::string_view LastPart(std::string_view key) { return key.substr(key.rfind('.') + 1); }

std::string_view TablePart(std::string_view key) {
  return key.substr(0, key.rfind('.') == std::string_view::npos ? 0 : key.rfind('.'));
}

// " (did you mean schedule.steps?)"; a table may be missing, or another.
std::string NearKeys(const ConfigFields& fields, const std::string& key) {
  std::vector<std::string> keys, same, similar;
  for (const ConfigField& field : fields) {
    keys.push_back(field.key);
    const std::string_view name = LastPart(field.key);
    if (name == LastPart(key)) {
      same.push_back(field.key);
    } else if (IsNear(LastPart(key), name)) {
      similar.push_back(field.key);
    }
  }
  const std::string near = DidYouMean(key, keys);
  const std::vector<std::string>& elsewhere = same.empty() ? similar : same;
  if (!near.empty() || elsewhere.empty()) return near;
  return fmt::format(" (did you mean {}?)", fmt::join(elsewhere, " or "));
}

// What there is where a person has looked for it, in the same table; else where all keys are.
std::string KeysBeside(const ConfigFields& fields, const std::string& key) {
  std::vector<std::string_view> beside;
  for (const ConfigField& field : fields) {
    if (TablePart(field.key) == TablePart(key)) beside.push_back(LastPart(field.key));
  }
  const std::string_view table = TablePart(key);
  if (table.empty() || beside.empty()) return "; the config.toml of any run has all keys";
  return fmt::format("; [{}] has {}", table, fmt::join(beside, ", "));
}

Status UnknownKey(const ConfigFields& fields, const std::string& key) {
  const std::string near = NearKeys(fields, key);
  return InvalidArgument("unknown key \"{}\"{}", key,
                         near.empty() ? KeysBeside(fields, key) : near);
}

// Keys of former versions, each with the value (of a switch: 0 or 1) that says what happens without
// it, or none where no result depends on it: configurations of former runs have them.
struct GoneKey {
  std::string_view key;
  std::optional<double> value;
};
constexpr GoneKey kGone[] = {{"network.blocks", 0},
                             {"network.stiffness", 0},
                             {"network.wrap", 1},
                             {"schedule.shard_optimizer", {}}};

Status PassOver(const ConfigFields& fields, const std::string& key, const toml::node& node) {
  const auto* const gone = std::find_if(std::begin(kGone), std::end(kGone),
                                        [&](const GoneKey& g) { return g.key == key; });
  if (gone == std::end(kGone)) return UnknownKey(fields, key);
  const auto value = node.is_boolean() ? node.ref<bool>() : node.value<double>();
  if (!gone->value || value == gone->value) return {};
  return InvalidArgument("{} was removed, and this version behaves as with {}; leave it out", key,
                         node.is_boolean() ? "true" : fmt::format("{}", *gone->value));
}

Status CheckRange(const ConfigField& field, double value) {
  if (value >= field.low && value <= field.high) return {};  // false for NaN
  return InvalidArgument("{} is {}, but must be within [{}, {}]", field.key, value, field.low,
                         field.high);
}

// What a value of a field has to be.
struct Expected {
  const char* operator()(const std::string*) const { return "a string"; }
  const char* operator()(const bool*) const { return "true or false"; }
  const char* operator()(const double*) const { return "a number"; }
  template <class Integer>
  const char* operator()(const Integer*) const {
    return "a whole number";
  }
};

Status MustBe(const ConfigField& field) {
  return InvalidArgument("{} must be {}", field.key, std::visit(Expected{}, field.target));
}

// One overload for each type of target.
struct SetFromToml {
  const ConfigField& field;
  const toml::node& node;

  Status operator()(std::string* text) const {
    if (!node.is_string()) return MustBe(field);
    *text = node.ref<std::string>();
    return {};
  }
  Status operator()(bool* flag) const {
    if (!node.is_boolean()) return MustBe(field);
    *flag = node.ref<bool>();
    return {};
  }
  Status operator()(double* number) const {
    if (!node.is_number()) return MustBe(field);
    // node.value<double>() is empty for whole numbers that double does not have.
    const auto* whole = node.as_integer();
    *number = whole != nullptr ? static_cast<double>(whole->get()) : node.ref<double>();
    return CheckRange(field, *number);
  }
  template <class Integer>
  Status operator()(Integer* integer) const {
    if (!node.is_integer()) return MustBe(field);
    const std::int64_t value = node.ref<std::int64_t>();
    TILEGRAD_TRY(CheckRange(field, static_cast<double>(value)));
    *integer = static_cast<Integer>(value);
    return {};
  }
};

Status Place(const toml::node& node, const Status& status) {
  return status.Within(fmt::format("line {}", node.source().begin.line));
}

ConfigFields::const_iterator FindField(const ConfigFields& fields, std::string_view key) {
  return std::find_if(fields.begin(), fields.end(),
                      [&](const ConfigField& f) { return f.key == key; });
}

Status SetKey(const ConfigFields& fields, const std::string& key, const toml::node& node) {
  const auto field = FindField(fields, key);
  if (field == fields.end()) return PassOver(fields, key, node);
  return std::visit(SetFromToml{*field, node}, field->target);
}

Status SetTable(const ConfigFields& fields, const toml::table& table, const std::string& prefix) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (const auto* inner = node.as_table()) {
      TILEGRAD_TRY(SetTable(fields, *inner, key + "."));
      continue;
    }
    if (const Status set = SetKey(fields, key, node); !set.ok()) return Place(node, set);
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
    return InvalidArgument("line {}: not valid TOML (text needs quotes, lists need brackets): {}",
                           error.source().begin.line, error.description());
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

std::string FieldLine(const ConfigField& field) {
  const std::string setting = fmt::format("{} = {}", LastPart(field.key), TomlText(field.target));
  return fmt::format("{:<36}  # {}\n", setting, field.help);
}

Status OverrideText(const ConfigField& field, const std::string& value) {
  // Text needs no quotes here.
  std::string text = value;
  TILEGRAD_TRY(ReadFields(field.key + " = " + TomlText(&text), {field}));
  if (*std::get<std::string*>(field.target) != value)  // toml++ takes other bytes for Latin-1
    return InvalidArgument("{} must be UTF-8", field.key);
  return {};
}

Status OverrideField(const std::string& assignment, const ConfigFields& fields) {
  const auto equals = assignment.find('=');
  if (equals == std::string::npos)
    return InvalidArgument("\"{}\" is not of the form key=value", assignment);
  const std::string key = assignment.substr(0, equals), value = assignment.substr(equals + 1);
  const auto field = FindField(fields, key);
  const bool known = field != fields.end();
  if (known && std::holds_alternative<std::string*>(field->target))
    return OverrideText(*field, value);
  // Unless it is TOML of one value.
  Status set = known ? MustBe(*field) : UnknownKey(fields, key);
  const Status read = WithToml("value = " + value, [&](const toml::table& table) -> Status {
    if (table.size() == 1) set = SetKey(fields, key, *table.get("value"));
    return {};
  });
  if (read.ok() && set.ok()) return {};
  return known ? set.Within(assignment) : set;
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
    const std::string table(TablePart(field.key));
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
    if (field.affects == Affects::kReporting) continue;
    std::string text = ShortText(field.target);
    if (field.affects == Affects::kPlace && !text.empty()) text = "(a place)";
    out += fmt::format("{} = {}\n", field.key, text);
  }
  return out;
}

}  // namespace tilegrad::train
