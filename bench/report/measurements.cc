// SPDX-License-Identifier: Apache-2.0
#include "report/measurements.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>

#include "base/error.h"

namespace tilegrad::bench {
namespace {

using nlohmann::ordered_json;

struct Samples {
  Measurement result;
  std::vector<double> cpu, wall;
  int family = 0;  // counts benchmarks as they were registered; they may run in any order
};

double Median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  const std::size_t half = v.size() / 2;
  return v.size() % 2 == 1 ? v[half] : (v[half - 1] + v[half]) / 2;
}

bool SplitName(const std::string& name, Measurement* out) {
  std::istringstream parts(name);
  return std::getline(parts, out->scene, '/') && std::getline(parts, out->direction, '/') &&
         std::getline(parts, out->what, '/') && std::getline(parts, out->who, '/');
}

// The counters that render_bench sets.
constexpr const char* kCounters[] = {
    "images", "pixels",   "faces",         "pairs",           "exps",          "bytes",
    "share",  "limit_ms", "limit_high_ms", "evaluated_pairs", "evaluated_exps"};

void AddSample(const ordered_json& run, Samples* samples) {
  Measurement& m = samples->result;
  for (const char* name : kCounters) {
    if (run.contains(name)) m.counters[name] = run[name].get<double>();
  }
  const double share = m.counters.count("share") > 0 ? m.counters["share"] : 1;
  samples->cpu.push_back(run.at("cpu_time").get<double>() / share);
  samples->wall.push_back(run.at("real_time").get<double>() / share);
}

Result<std::vector<Measurement>> Collect(const ordered_json& runs) {
  std::vector<Samples> all;
  std::map<std::string, std::size_t> places;
  for (const ordered_json& run : runs) {
    if (run.value("run_type", "") != "iteration" || run.value("error_occurred", false)) continue;
    const std::string name = run.at("run_name").get<std::string>();
    Measurement parts;
    if (!SplitName(name, &parts)) continue;
    const auto [at, is_new] = places.try_emplace(name, all.size());
    if (is_new) all.push_back({std::move(parts), {}, {}, 0});
    AddSample(run, &all[at->second]);
    all[at->second].family = run.value("family_index", 0);
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Samples& a, const Samples& b) { return a.family < b.family; });
  std::vector<Measurement> out;
  for (Samples& s : all) {
    s.result.cpu_ms = Median(s.cpu);
    s.result.wall_ms = Median(s.wall);
    s.result.repetitions = static_cast<int>(s.cpu.size());
    out.push_back(std::move(s.result));
  }
  if (out.empty()) return DataLoss("no benchmark named scene/direction/what/who was measured");
  return out;
}

// A counter that is 0 in all repetitions has no coefficient of variation; Google Benchmark writes
// it as NaN, which is not JSON.
std::string NanToNull(std::string json) {
  constexpr std::string_view kNan = ": NaN", kNull = ": null";
  for (auto at = json.find(kNan); at != json.npos; at = json.find(kNan, at + kNull.size())) {
    json.replace(at, kNan.size(), kNull);
  }
  return json;
}

}  // namespace

double Measurement::counter(const std::string& name) const {
  const auto at = counters.find(name);
  return at == counters.end() ? 0 : at->second;
}

Result<std::vector<Measurement>> ParseMeasurements(std::string json) {
  try {
    return Collect(ordered_json::parse(NanToNull(std::move(json))).at("benchmarks"));
  } catch (const nlohmann::json::exception& e) {
    return DataLoss("not what Google Benchmark writes: {}", e.what());
  }
}

const Measurement* Find(const std::vector<Measurement>& all, const Measurement& like,
                        const std::string& who) {
  const auto at = std::find_if(all.begin(), all.end(), [&](const Measurement& m) {
    return m.scene == like.scene && m.direction == like.direction && m.what == like.what &&
           m.who == who;
  });
  return at == all.end() ? nullptr : &*at;
}

}  // namespace tilegrad::bench
