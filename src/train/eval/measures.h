// SPDX-License-Identifier: Apache-2.0
// All measures of a Score, in the order in which files and tables have them.
#pragma once

#include <cstdlib>
#include <optional>
#include <string_view>

#include "train/eval/evaluation.h"

namespace tilegrad::train {

struct ScoreMeasure {
  const char* key;                      // of eval.json
  std::optional<double> Score::*value;  // null: `iou`, which every score has
  const char* heading;
  double factor;  // of the number that people read
  int digits;     // of it, behind the point
  bool column;    // has its own column in tables; else it stands in the cells of classes
  bool less_is_better;

  std::optional<double> Of(const Score& score) const {
    return value ? score.*value : std::optional(score.iou);
  }
  void Set(std::optional<double> number, Score* score) const {
    if (value) score->*value = number;
    if (!value && number) score->iou = *number;
  }
};

inline constexpr ScoreMeasure kMeasures[] = {
    {"iou", nullptr, "3D IoU", 100, 1, false, false},
    {"f_score", &Score::f_score, "F-score", 100, 1, false, false},
    {"accuracy", &Score::accuracy, "accuracy", 100, 1, false, false},
    {"carved_iou", &Score::carved_iou, "carved IoU", 100, 1, true, false},
    {"color_l1", &Score::color_l1, "colour L1", 1, 3, true, true},
    {"shared_color_l1", &Score::shared_color_l1, "where both are", 1, 3, true, true},
    {"seen_color_l1", &Score::seen_color_l1, "seen sides", 1, 3, true, true},
    {"hidden_color_l1", &Score::hidden_color_l1, "hidden sides", 1, 3, true, true},
    {"texture_l1", &Score::texture_l1, "texture L1", 1, 4, true, true},
    {"light_angle", &Score::light_angle, "light, degrees", 1, 1, true, true},
    {"lit_l1", &Score::lit_l1, "texture + light L1", 1, 4, true, true},
    {"mask_loss", &Score::mask_loss, "2D IoU loss", 1, 3, true, true},
    {"pck", &Score::pck, "PCK@0.1", 1, 3, true, false},
};

constexpr const ScoreMeasure& MeasureOf(std::string_view key) {
  for (const ScoreMeasure& measure : kMeasures) {
    if (key == measure.key) return measure;
  }
  std::abort();
}

}  // namespace tilegrad::train
