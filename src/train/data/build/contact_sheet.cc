// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/contact_sheet.h"

#include <algorithm>
#include <span>

#include "io/image_file.h"
#include "render/picture/composite.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

constexpr int kModels = 6, kSheetViews = 3;
constexpr int kSheetGap = 4;  // pixels between models and rows

// Up to kModels models of a class, evenly spread.
std::vector<int> Pick(const Dataset& dataset, int class_index) {
  std::vector<int> all, out;
  for (std::size_t i = 0; i < dataset.models().size(); ++i) {
    if (dataset.models()[i].class_index == class_index) all.push_back(static_cast<int>(i));
  }
  const std::size_t n = std::min<std::size_t>(kModels, all.size());
  for (std::size_t i = 0; i < n; ++i) out.push_back(all[i * all.size() / n]);
  return out;
}

}  // namespace

Status WriteContactSheet(const Dataset& dataset) {
  const DatasetInfo& info = dataset.info();
  const int size = info.image_size, views = std::min(kSheetViews, info.views);
  const int step_x = views * size + kSheetGap, step_y = size + kSheetGap;
  const int rows = static_cast<int>(info.classes.size());
  ImageU8 sheet(kModels * step_x + kSheetGap, rows * step_y + kSheetGap, 3, ToByte(kPaper));
  const std::size_t plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  for (int row = 0; row < rows; ++row) {
    const auto models = Pick(dataset, row);
    for (std::size_t column = 0; column < models.size(); ++column) {
      TILEGRAD_ASSIGN(const auto images, dataset.LoadImages(models[column]));
      for (int v = 0; v < views; ++v) {
        const auto view = static_cast<std::size_t>(v * info.views / views);
        const auto planes = std::span(images).subspan(4 * view * plane, 4 * plane);
        const PlanarRgba<std::uint8_t> image{planes.first(3 * plane), planes.subspan(3 * plane),
                                             size, size};
        Paste(OverGrey(image, kPaper), kSheetGap + static_cast<int>(column) * step_x + v * size,
              kSheetGap + row * step_y, &sheet);
      }
    }
  }
  return io::SavePng(ContactSheetPath(dataset.folder()), sheet);
}

}  // namespace tilegrad::train
