// SPDX-License-Identifier: Apache-2.0
#include "train/config.h"

#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <numeric>
#include <sstream>
#include <variant>

#include "base/error.h"

namespace tilegrad::train {
namespace {

using Target = std::variant<std::string*, std::int64_t*, double*>;

struct Field {
  std::string key;  // "network.channels"
  Target target;
  double low, high;  // of numbers, bounds included
  const char* help;
};

constexpr double kHuge = 1e12;

// The one list of keys: reading, overriding, checking and writing all walk it.
std::vector<Field> Fields(TrainConfig& c) {
  return {
      {"name", &c.name, 0, 0, "of the run, for people"},
      {"network.channels", &c.network.channels, 1, 4096,
       "of the first convolution; then 2x and 4x"},
      {"network.code", &c.network.code, 1, 65536, "width of the encoder's fully connected layers"},
      {"network.hidden1", &c.network.hidden1, 1, 65536, "width of each decoder's first layer"},
      {"network.hidden2", &c.network.hidden2, 1, 65536, "width of each decoder's second layer"},
      {"network.template_level", &c.network.template_level, 0, 6,
       "subdivisions of the icosahedron; 3: 642 vertices"},
      {"network.template_radius", &c.network.template_radius, 1e-3, 10, "world units"},
      {"network.fc_deviation", &c.network.fc_deviation, 0, 10,
       "fully connected weights start as N(0, this^2); 0: uniform by fan-in"},
      {"network.output_deviation", &c.network.output_deviation, 0, 10,
       "the decoders' last weights start as N(0, this^2)"},
      {"network.color_bias", &c.network.color_bias, -1, 2, "what vertex colours start at"},
      {"loss.iou", &c.loss.iou, 0, kHuge, "weight of equation 12"},
      {"loss.color", &c.loss.color, 0, kHuge, "weight of equation 13"},
      {"loss.smoothness", &c.loss.smoothness, 0, kHuge,
       "weight of the normal difference of neighbouring faces"},
      {"loss.laplacian", &c.loss.laplacian, 0, kHuge, "weight of the Laplacian of the movement"},
      {"render.sharpness", &c.render.sharpness, 1e-3, 1e9,
       "1/delta of equation 5, per squared NDC unit"},
      {"render.sharpness_start", &c.render.sharpness_start, 1e-3, 1e9,
       "at step 0; reaches sharpness geometrically at half of the run"},
      {"render.max_alpha_error", &c.render.max_alpha_error, 0, 1, "bound on the error of alpha"},
      {"optimizer.learning_rate", &c.optimizer.learning_rate, 0, 1, "of Adam"},
      {"optimizer.final_factor", &c.optimizer.final_factor, 0, 1,
       "share of the rate at the end (half cosine); 1: constant"},
      {"optimizer.warmup", &c.optimizer.warmup, 0, kHuge, "steps of linear rise"},
      {"optimizer.beta1", &c.optimizer.beta1, 0, 0.999999, "of Adam"},
      {"optimizer.beta2", &c.optimizer.beta2, 0, 0.99999999, "of Adam"},
      {"schedule.steps", &c.schedule.steps, 1, kHuge, "steps of the whole run"},
      {"schedule.batch", &c.schedule.batch, 2, 65536, "objects a step; batch norm needs two"},
      {"schedule.views", &c.schedule.views, 1, 64,
       "rendered per object: its own view and random others"},
      {"schedule.seed", &c.schedule.seed, 0, kHuge, "of weights, order and views"},
      {"schedule.log_every", &c.schedule.log_every, 1, kHuge, "steps"},
      {"schedule.sample_every", &c.schedule.sample_every, 1, kHuge, "steps"},
      {"schedule.checkpoint_every", &c.schedule.checkpoint_every, 1, kHuge, "steps"},
      {"schedule.keep_checkpoints", &c.schedule.keep_checkpoints, 1, kHuge,
       "the newest ones are kept"},
  };
}

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

Status UnknownKey(const std::vector<Field>& fields, const std::string& key) {
  const auto closest =
      std::min_element(fields.begin(), fields.end(), [&](const Field& a, const Field& b) {
        return KeyDistance(a.key, key) < KeyDistance(b.key, key);
      });
  return InvalidArgument("unknown key \"{}\"; the closest known one is \"{}\"", key, closest->key);
}

Status CheckRange(const Field& field, double value) {
  if (value >= field.low && value <= field.high) return {};  // false for NaN
  return InvalidArgument("{} is {}, but must be within [{}, {}]", field.key, value, field.low,
                         field.high);
}

Status SetFromToml(const Field& field, const toml::node& node) {
  if (auto* text = std::get_if<std::string*>(&field.target)) {
    if (!node.is_string()) return InvalidArgument("{} must be a string", field.key);
    **text = node.ref<std::string>();
    return {};
  }
  if (auto* integer = std::get_if<std::int64_t*>(&field.target)) {
    if (!node.is_integer()) return InvalidArgument("{} must be a whole number", field.key);
    **integer = node.ref<std::int64_t>();
    return CheckRange(field, static_cast<double>(**integer));
  }
  if (!node.is_number()) return InvalidArgument("{} must be a number", field.key);
  double& number = **std::get_if<double*>(&field.target);
  // node.value<double>() is empty for whole numbers that double does not have.
  const auto* whole = node.as_integer();
  number = whole != nullptr ? static_cast<double>(whole->get()) : node.ref<double>();
  return CheckRange(field, number);
}

Status Place(const toml::node& node, const Status& status) {
  return status.Within(fmt::format("line {}", node.source().begin.line));
}

Status SetTable(const std::vector<Field>& fields, const toml::table& table,
                const std::string& prefix) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix + std::string(name.str());
    if (const auto* inner = node.as_table()) {
      TILEGRAD_TRY(SetTable(fields, *inner, key + "."));
      continue;
    }
    const auto field =
        std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.key == key; });
    if (field == fields.end()) return Place(node, UnknownKey(fields, key));
    if (const Status status = SetFromToml(*field, node); !status.ok()) return Place(node, status);
  }
  return {};
}

Status ParseInto(std::string_view text, TrainConfig* config) {
  // A key of many parts is a table in a table in a table: toml++ uses up the stack when it frees
  // some ten thousand. A configuration of all keys has less than a hundred dots.
  constexpr std::ptrdiff_t kMostDots = 4096;
  if (std::count(text.begin(), text.end(), '.') > kMostDots)
    return InvalidArgument("more than {} dots", kMostDots);
  try {
    return SetTable(Fields(*config), toml::parse(text), "");
  } catch (const toml::parse_error& error) {
    return InvalidArgument("line {}: {}", error.source().begin.line, error.description());
  }
}

std::string ValueText(const Target& target) {
  if (auto* text = std::get_if<std::string*>(&target)) {
    std::ostringstream out;
    out << toml::value<std::string>(**text);
    return out.str();
  }
  if (auto* integer = std::get_if<std::int64_t*>(&target)) return std::to_string(**integer);
  // The shortest text that reads back as the same double; TOML wants a point or an exponent.
  std::string text = fmt::format("{}", **std::get_if<double*>(&target));
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

}  // namespace

Result<TrainConfig> ReadConfig(const Path& path) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(path, 1 << 20));
  return ParseConfig(text, path.string());
}

Result<TrainConfig> ParseConfig(std::string_view text, const std::string& name) {
  TrainConfig config;
  TILEGRAD_TRY(ParseInto(text, &config).Within(name));
  return config;
}

Status ApplyOverrides(const std::vector<std::string>& assignments, TrainConfig* config) {
  for (const std::string& assignment : assignments) {
    const auto equals = assignment.find('=');
    if (equals == std::string::npos)
      return InvalidArgument("\"{}\" is not of the form key=value", assignment);
    const std::string key = assignment.substr(0, equals), value = assignment.substr(equals + 1);
    const auto fields = Fields(*config);
    const auto field =
        std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.key == key; });
    if (field == fields.end()) return UnknownKey(fields, key);
    // Text needs no quotes here.
    std::string text = value;
    auto* const* target = std::get_if<std::string*>(&field->target);
    TILEGRAD_TRY(ParseInto(key + " = " + (target != nullptr ? ValueText(&text) : value), config)
                     .Within(assignment));
    if (target != nullptr && **target != value)  // toml++ takes other bytes for Latin-1
      return InvalidArgument("{} must be UTF-8", key);
  }
  return {};
}

std::string WriteConfig(const TrainConfig& config) {
  TrainConfig copy = config;
  std::string out, section;
  for (const Field& field : Fields(copy)) {
    const auto dot = field.key.find('.');
    const std::string head = dot == std::string::npos ? "" : field.key.substr(0, dot);
    if (head != section) out += fmt::format("\n[{}]\n", section = head);
    const std::string line =
        fmt::format("{} = {}", field.key.substr(dot == std::string::npos ? 0 : dot + 1),
                    ValueText(field.target));
    out += fmt::format("{:<36}  # {}\n", line, field.help);
  }
  return out;
}

}  // namespace tilegrad::train
