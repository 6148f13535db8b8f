// SPDX-License-Identifier: Apache-2.0
#include "train/eval/statistics.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad::train {
namespace {

std::vector<std::vector<double>> NumbersOf(std::span<const std::vector<Score>> classes,
                                           const ScoreMeasure& measure) {
  std::vector<std::vector<double>> out(classes.size());
  for (std::size_t c = 0; c < classes.size(); ++c) {
    for (const Score& score : classes[c]) {
      if (const auto number = measure.Of(score)) out[c].push_back(*number);
    }
  }
  return out;
}

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
  if (!d.difference.error) return "too few models to tell";
  return d.tie() ? "a tie" : d.better() ? "better" : "worse";
}

}  // namespace

ClassMeans::ClassMeans(const Dataset& dataset, std::span<const int> models)
    : dataset_(dataset), models_(models.begin(), models.end()) {
  for (std::size_t i = 0; i < models.size(); ++i) {
    const ModelInfo& info = dataset.model(models[i]);
    members_[info.class_index][ShapeOf(info)].push_back(i);
  }
}

void ClassMeans::Describe(std::span<const Score> scores, Evaluation* out) const {
  out->dataset_source = dataset_.info().source;
  std::map<int, int> counts;
  for (std::size_t i = 0; i < models_.size(); ++i) {
    const ModelInfo& info = dataset_.model(models_[i]);
    out->models.push_back({dataset_.ClassOf(info), info.id, scores[i], info.shape});
    ++counts[info.class_index];
  }
  for (const auto& [class_index, count] : counts) {
    out->classes.push_back(dataset_.info().classes[static_cast<std::size_t>(class_index)]);
    out->class_models.push_back(count);
  }
}

EvaluationRow ClassMeans::Row(const std::string& method, std::span<const Score> scores) const {
  EvaluationRow row{.method = method, .classes = {}, .mean = {}};
  std::vector<std::vector<Score>> shapes_of_classes;
  for (const auto& [class_index, shapes] : members_) {
    std::vector<Score> of_class;
    for (const auto& [shape, indices] : shapes) {
      std::vector<Score> of_shape;
      for (const std::size_t i : indices) of_shape.push_back(scores[i]);
      of_class.push_back(MeanScore(of_shape));
    }
    row.classes.push_back(MeanScore(of_class));
    shapes_of_classes.push_back(std::move(of_class));
  }
  row.mean = MeanScore(row.classes);
  row.error = StandardErrors(shapes_of_classes);
  return row;
}

ClassedMean MeanOverClasses(std::span<const std::vector<double>> classes) {
  double means = 0, squares = 0, shares = 0;
  std::size_t count = 0, freedom = 0;
  for (const std::vector<double>& numbers : classes) {
    if (numbers.empty()) continue;
    const auto n = static_cast<double>(numbers.size());
    const double mean = std::accumulate(numbers.begin(), numbers.end(), 0.0) / n;
    for (const double x : numbers) squares += (x - mean) * (x - mean);
    means += mean;
    shares += 1 / n;
    freedom += numbers.size() - 1;
    ++count;
  }
  if (count == 0) return {};
  const auto c = static_cast<double>(count);
  if (freedom == 0) return {means / c, std::nullopt};
  return {means / c, std::sqrt(squares / static_cast<double>(freedom) * shares) / c};
}

std::optional<Score> StandardErrors(std::span<const std::vector<Score>> classes) {
  Score out;
  for (const ScoreMeasure& measure : kMeasures) {
    const auto error = MeanOverClasses(NumbersOf(classes, measure)).error;
    if (!error && measure.value == nullptr) return std::nullopt;
    measure.Set(error, &out);
  }
  return out;
}

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
