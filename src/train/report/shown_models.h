// SPDX-License-Identifier: Apache-2.0
// The held-out models that a report shows: what the network sees, predicts, and what is true.
#pragma once

#include <vector>

#include "train/data/dataset.h"
#include "train/models/predictor.h"
#include "train/pictures.h"

namespace tilegrad::train {

inline constexpr int kShownViews = 3;

struct ShownModel {
  int model = 0;                         // index into Dataset::models()
  Mesh prediction;                       // from the first view
  Mesh truth;                            // empty where the source has no meshes
  std::vector<ImageU8> truth_views;      // [kShownViews] RGB, the first is the network's input
  std::vector<ImageU8> predicted_views;  // the same views of `prediction`
};

// At most `count` models of the test split, spread over the classes: one of each class, then a
// second of each, ...; where a round has more classes than are left to choose, evenly spaced ones.
std::vector<int> ChooseModels(const Dataset& dataset, int count);

// The dataset's views that are shown: the first at five sixths of the circle, which sees models
// that face +z obliquely from the front; the others a third of the circle on.
std::vector<int> ShownViews(const DatasetInfo& info);

Result<ShownModel> MakeShownModel(const Dataset& dataset, int model, const Predictor& predictor,
                                  const Workers& workers);

}  // namespace tilegrad::train
