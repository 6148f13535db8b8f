// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/contact_sheet.h"

#include <algorithm>

#include "io/image_file.h"

namespace tilegrad::train {
namespace {

constexpr int kModels = 6, kViews = 3;
constexpr int kGap = 4;  // pixels between models and rows
constexpr std::uint8_t kGrey = 225;

// `image` is [4][size][size], premultiplied.
void Paste(const std::uint8_t* image, int size, int left, int top, ImageU8* sheet) {
  const auto plane = static_cast<std::size_t>(size) * size;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const std::uint8_t* p = image + static_cast<std::size_t>(y) * size + x;
      const int behind = (255 - p[3 * plane]) * kGrey / 255;
      for (std::size_t c = 0; c < 3; ++c) {
        sheet->at(left + x, top + y)[c] =
            static_cast<std::uint8_t>(std::min(255, p[c * plane] + behind));
      }
    }
  }
}

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
  const int size = info.image_size, views = std::min(kViews, info.views);
  const int step_x = views * size + kGap, step_y = size + kGap;
  const int rows = static_cast<int>(info.classes.size());
  ImageU8 sheet(kModels * step_x + kGap, rows * step_y + kGap, 3, kGrey);
  for (int row = 0; row < rows; ++row) {
    const auto models = Pick(dataset, row);
    for (std::size_t column = 0; column < models.size(); ++column) {
      TILEGRAD_ASSIGN(const auto images, dataset.LoadImages(models[column]));
      for (int v = 0; v < views; ++v) {
        const auto view = static_cast<std::size_t>(v * info.views / views);
        Paste(images.data() + view * 4 * static_cast<std::size_t>(size) * size, size,
              kGap + static_cast<int>(column) * step_x + v * size, kGap + row * step_y, &sheet);
      }
    }
  }
  return io::SavePng(dataset.folder() / "contact_sheet.png", sheet);
}

}  // namespace tilegrad::train
