// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/watch.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace tilegrad::train {
namespace {

// As floats, whatever the tensor's type is.
std::vector<float> Numbers(const nn::Tensor& tensor) {
  std::vector<float> out;
  nn::WithFloatType(tensor.dtype(), [&]<class T>(T) {
    for (const T x : tensor.span<T>()) out.push_back(static_cast<float>(x));
  });
  return out;
}

// Which cell of [planes][cells][cells] each number of [planes][side][side] is in.
std::vector<std::uint32_t> CellOfEach(const nn::Shape& shape, std::int64_t cells) {
  const std::int64_t side = shape[3];
  std::vector<std::uint32_t> out;
  for (std::int64_t p = 0; p < shape[0] * shape[1]; ++p) {
    for (std::int64_t y = 0; y < side; ++y) {
      for (std::int64_t x = 0; x < side; ++x) {
        const std::int64_t row = p * cells + y * cells / side;
        out.push_back(static_cast<std::uint32_t>(row * cells + x * cells / side));
      }
    }
  }
  return out;
}

struct SheetCell {
  double count = 0, sum = 0, squares = 0;
  double mean() const { return sum / count; }
  double deviation() const { return std::sqrt(std::max(0.0, squares / count - mean() * mean())); }
};

// For each object the means of its cells, then their deviations.
FeatureRows CellsOf(const nn::Tensor& planes, std::int64_t cells_a_side, bool deviations) {
  const nn::Shape& shape = planes.shape();
  const std::int64_t side = std::min(cells_a_side, shape[3]);
  const auto objects = static_cast<std::size_t>(shape[0]);
  const auto count = static_cast<std::size_t>(shape[1] * side * side);
  const std::vector<float> numbers = Numbers(planes);
  const std::vector<std::uint32_t> at = CellOfEach(shape, side);
  std::vector<SheetCell> cells(objects * count);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto x = static_cast<double>(numbers[i]);
    SheetCell& cell = cells[at[i]];
    ++cell.count;
    cell.sum += x;
    cell.squares += x * x;
  }
  FeatureRows out;
  out.width = deviations ? 2 * count : count;
  for (std::size_t object = 0; object < objects; ++object) {
    const std::span<const SheetCell> own = std::span(cells).subspan(object * count, count);
    for (const SheetCell& cell : own) out.values.push_back(static_cast<float>(cell.mean()));
    if (!deviations) continue;
    for (const SheetCell& cell : own) out.values.push_back(static_cast<float>(cell.deviation()));
  }
  return out;
}

double SoftIou(std::span<const float> a, std::span<const float> b) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    both += static_cast<double>(std::min(a[i], b[i]));
    either += static_cast<double>(std::max(a[i], b[i]));
  }
  return either > 0 ? both / either : 1;
}

// The mean colour of each object over the pixels that it covers in all views.
std::vector<std::array<double, 3>> MeanColors(std::span<const float> colors,
                                              std::span<const float> cover, std::size_t objects,
                                              std::size_t views) {
  const std::size_t plane = cover.size() / objects / views;
  std::vector<std::array<double, 3>> out(objects);
  for (std::size_t i = 0; i < objects; ++i) {
    double area = 1e-9;
    for (const float share : cover.subspan(i * views * plane, views * plane))
      area += static_cast<double>(share);
    for (std::size_t v = 0; v < views; ++v) {
      for (std::size_t c = 0; c < 3; ++c) {
        for (const float x : colors.subspan(((i * views + v) * 3 + c) * plane, plane))
          out[i][c] += static_cast<double>(x) / area;
      }
    }
  }
  return out;
}

double Distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

}  // namespace

Spread SpreadOf(const ObjectViews& set, const Workers& workers) {
  const std::vector<float> cover = Numbers(set.cover), colors = Numbers(set.colors);
  const auto n = static_cast<std::size_t>(set.cover.shape()[0]);
  const std::size_t object = cover.size() / n;
  const auto means = MeanColors(colors, cover, n, static_cast<std::size_t>(set.cover.shape()[1]));
  const auto of = [&](std::size_t i) { return std::span(cover).subspan(i * object, object); };
  std::vector<Spread> rows(n);
  workers.For(n, [&](std::size_t i, std::size_t) {
    for (std::size_t j = 0; j < i; ++j) {
      rows[i].shapes += 1 - SoftIou(of(i), of(j));
      rows[i].colors += Distance(means[i], means[j]);
    }
  });
  Spread out;
  const double pairs = static_cast<double>(n) * static_cast<double>(n - 1) / 2;
  for (const Spread& row : rows) {
    out.shapes += row.shapes / pairs;
    out.colors += row.colors / pairs;
  }
  return out;
}

FeatureRows CoverFeatures(const ObjectViews& set) { return CellsOf(set.cover, kCells, false); }
FeatureRows ColorFeatures(const ObjectViews& set, std::int64_t cells) {
  return CellsOf(set.colors, cells, true);
}

GanWatch::GanWatch(const ObjectViews& truth, const Workers& workers)
    : workers_(workers),
      cover_(CoverFeatures(truth)),
      colors_(ColorFeatures(truth)),
      spread_(SpreadOf(truth, workers)) {}

Result<Watched> GanWatch::Compare(const ObjectViews& generated, GanStage stage) const {
  const bool shape = stage == GanStage::kShape;
  TILEGRAD_ASSIGN(
      const double distance,
      KernelDistance(shape ? cover_ : colors_,
                     shape ? CoverFeatures(generated) : ColorFeatures(generated), workers_));
  const Spread spread = SpreadOf(generated, workers_);
  return Watched{1000 * distance, spread.shapes / std::max(spread_.shapes, 1e-9),
                 spread.colors / std::max(spread_.colors, 1e-9)};
}

}  // namespace tilegrad::train
