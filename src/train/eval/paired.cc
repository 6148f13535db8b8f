// SPDX-License-Identifier: Apache-2.0
#include "train/eval/paired.h"

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad::train {
namespace {

struct ScorePair {
  const ModelScore* first;
  const Score* second;
};

std::vector<ScorePair> PairsOf(const Evaluation& first, const Evaluation& second) {
  std::map<std::pair<std::string, std::string>, const Score*> theirs;
  for (const ModelScore& model : second.models) theirs[{model.class_name, model.id}] = &model.score;
  std::vector<ScorePair> out;
  for (const ModelScore& model : first.models) {
    const auto at = theirs.find({model.class_name, model.id});
    if (at != theirs.end()) out.push_back({&model, at->second});
  }
  return out;
}

// Nothing if one of the models lacks the measure.
std::optional<ClassedMean> DifferenceOf(const std::vector<ScorePair>& pairs,
                                        const ScoreMeasure& measure) {
  std::map<std::string, std::map<std::string, std::vector<double>>> by_class;
  for (const ScorePair& pair : pairs) {
    const auto a = measure.Of(pair.first->score), b = measure.Of(*pair.second);
    if (!a || !b) return std::nullopt;
    by_class[pair.first->class_name][ShapeOf(*pair.first)].push_back(*a - *b);
  }
  std::vector<std::vector<double>> classes;
  for (const auto& [name, shapes] : by_class) {
    std::vector<double>& numbers = classes.emplace_back();
    for (const auto& [shape, models] : shapes)
      numbers.push_back(MeanOverClasses({&models, 1}).mean);
  }
  return MeanOverClasses(classes);
}

const char* VerdictOn(const PairedDifference& d) {
  return d.tie() ? "a tie" : d.better() ? "better" : "worse";
}

}  // namespace

bool PairedDifference::tie() const {
  return !difference.error || !(std::abs(difference.mean) >= 2 * *difference.error) ||
         difference.mean == 0;
}

Result<PairedComparison> ComparePaired(const Evaluation& first, const Evaluation& second) {
  const std::vector<ScorePair> pairs = PairsOf(first, second);
  if (pairs.empty())
    return InvalidArgument("\"{}\" was scored on none of these models", second.predictor);
  if (first.voxels != second.voxels)
    return InvalidArgument("the two were scored with voxels by different rules: {} and {}",
                           first.voxels, second.voxels);
  PairedComparison out{second.predictor, static_cast<int>(pairs.size()), {}};
  const bool shapes = !Classifies(first) && !IsOfPhotographs(first);
  for (const ScoreMeasure& measure : kMeasures) {
    if (measure.value == nullptr && !shapes) continue;
    const auto difference = DifferenceOf(pairs, measure);
    if (difference) out.measures.push_back({&measure, *difference});
  }
  return out;
}

std::string FormatComparison(const PairedComparison& comparison) {
  std::string out = fmt::format("Against {}, on {} that both have scores of:\n",
                                comparison.predictor, Count(comparison.models, "model"));
  for (const PairedDifference& d : comparison.measures) {
    const ScoreMeasure& m = *d.measure;
    const std::string error =
        d.difference.error ? fmt::format("{:.{}f}", m.factor * *d.difference.error, m.digits) : "?";
    out += fmt::format("  {:<18}  {:>+8.{}f} ± {}  {}\n", m.heading, m.factor * d.difference.mean,
                       m.digits, error, VerdictOn(d));
  }
  return out + "Differences below two standard errors are called ties.\n";
}

nlohmann::ordered_json ComparisonJson(const PairedComparison& comparison) {
  nlohmann::ordered_json json = {{"predictor", comparison.predictor},
                                 {"models", comparison.models}};
  for (const PairedDifference& d : comparison.measures) {
    nlohmann::ordered_json entry = {{"difference", d.difference.mean}, {"error", nullptr}};
    if (d.difference.error) entry["error"] = *d.difference.error;
    entry["verdict"] = VerdictOn(d);
    json["measures"][d.measure->key] = std::move(entry);
  }
  return json;
}

}  // namespace tilegrad::train
