// SPDX-License-Identifier: Apache-2.0
#include "train/report/shown_models.h"

#include <algorithm>

#include "base/error.h"

namespace tilegrad::train {

std::vector<int> ChooseModels(const Dataset& dataset, int count) {
  std::vector<std::vector<int>> rounds;  // rounds[r]: the r-th test model of each class that has it
  std::vector<std::size_t> seen(dataset.info().classes.size(), 0);
  for (const int model : dataset.Select(Split::kTest)) {
    const ModelInfo& info = dataset.models()[static_cast<std::size_t>(model)];
    const std::size_t round = seen[static_cast<std::size_t>(info.class_index)]++;
    if (round == rounds.size()) rounds.emplace_back();
    rounds[round].push_back(model);
  }
  std::vector<int> out;
  for (const auto& round : rounds) {
    const std::size_t left = static_cast<std::size_t>(count) - out.size();
    const std::size_t taken = std::min(left, round.size());
    for (std::size_t i = 0; i < taken; ++i) out.push_back(round[i * round.size() / taken]);
  }
  std::stable_sort(out.begin(), out.end(), [&](int a, int b) {
    const auto class_of = [&](int m) {
      return dataset.models()[static_cast<std::size_t>(m)].class_index;
    };
    return class_of(a) < class_of(b);
  });
  return out;
}

std::vector<int> ShownViews(const DatasetInfo& info) {
  std::vector<int> views;
  for (int k = 0; k < kShownViews; ++k)
    views.push_back((5 * info.views / 6 + k * info.views / kShownViews) % info.views);
  return views;
}

Result<ShownModel> MakeShownModel(const Dataset& dataset, int model, const Predictor& predictor,
                                  const Workers& workers) {
  const DatasetInfo& info = dataset.info();
  TILEGRAD_TRY(predictor.CheckImageSize(dataset));
  ShownModel shown;
  shown.model = model;
  TILEGRAD_ASSIGN(ModelData data, dataset.Load(model));
  shown.truth = std::move(data.mesh);
  const std::size_t bytes = data.images.size() / static_cast<std::size_t>(info.views);
  std::vector<Camera> cameras;
  for (const int view : ShownViews(info)) {
    const auto image =
        std::span(data.images).subspan(static_cast<std::size_t>(view) * bytes, bytes);
    shown.truth_views.push_back(CompositeOverPaper(image, info.image_size));
    if (cameras.empty()) {
      TILEGRAD_ASSIGN(auto meshes, predictor.Predict(image));
      shown.prediction = std::move(meshes[0]);
    }
    cameras.push_back(info.camera.View(view));
  }
  TILEGRAD_ASSIGN(shown.predicted_views,
                  DrawMesh(shown.prediction, {cameras, info.image_size, info.image_size}, workers));
  return shown;
}

}  // namespace tilegrad::train
