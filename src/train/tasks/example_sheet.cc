// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/example_sheet.h"

#include <algorithm>

#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "train/tasks/held_out.h"

namespace tilegrad::train {
namespace {

constexpr int kCellSize = 192;  // pixels a side, or the largest multiple of a picture's below

// Of the truth of the second view, in Example::pictures: truth and prediction of each view.
constexpr std::size_t kTurnedTruth = 2;

Status AddRow(const Example& example, const UnlitPictures& request, const Workers& workers,
              std::vector<ImageU8>* cells) {
  const int zoom = request.size / request.camera_size;
  TILEGRAD_ASSIGN(auto predicted, DrawMesh(example.prediction, request, workers));
  cells->push_back(Enlarged(example.pictures[0].image, zoom));
  for (ImageU8& picture : predicted) cells->push_back(std::move(picture));
  if (predicted.size() > 1) cells->push_back(Enlarged(example.pictures[kTurnedTruth].image, zoom));
  return {};
}

}  // namespace

Status AddSheet(int image_size, const Workers& workers, Showcase* showcase) {
  if (showcase->examples.empty()) return {};
  const std::size_t views = std::min<std::size_t>(2, showcase->examples[0].cameras.size());
  const int size = image_size * std::max(1, kCellSize / image_size);
  std::vector<ImageU8> cells;
  for (const Example& example : showcase->examples) {
    const auto cameras = std::span(example.cameras).first(views);
    TILEGRAD_TRY(AddRow(example, {cameras, image_size, size}, workers, &cells));
  }
  const bool turned = views > 1;
  showcase->sheet = TileImages(cells, turned ? 4 : 2);
  showcase->sheet_columns =
      turned ? "input, prediction, prediction from another side, truth from there"
             : "input, prediction";
  return {};
}

}  // namespace tilegrad::train
