// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/high_pass.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace tilegrad::train {
namespace {

constexpr int kBinomial[3] = {1, 2, 1};

// The response at an inner pixel of one plane.
double Response(const float* plane, int width, int x, int y) {
  double blurred = 0;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      blurred +=
          kBinomial[j] * kBinomial[i] * static_cast<double>(plane[(y + j - 1) * width + x + i - 1]);
    }
  }
  return static_cast<double>(plane[y * width + x]) - blurred / 16;
}

bool Counts(std::span<const std::uint8_t> covered, int width, int x, int y) {
  if (covered.empty()) return true;
  for (int j = y - 1; j <= y + 1; ++j) {
    const auto row = covered.begin() + std::ptrdiff_t{j} * width + x - 1;
    if (std::count(row, row + 3, 0) > 0) return false;
  }
  return true;
}

Status CheckPicture(const PlanarPicture& p, std::span<const std::uint8_t> covered) {
  if (p.channels < 1 || p.height < 0 || p.width < 0)
    return InvalidArgument("high-pass energy: a picture of {} channels, {} x {} pixels", p.channels,
                           p.width, p.height);
  const auto pixels = static_cast<std::size_t>(p.height) * static_cast<std::size_t>(p.width);
  if (p.values.size() != pixels * static_cast<std::size_t>(p.channels) ||
      (!covered.empty() && covered.size() != pixels)) {
    return InvalidArgument(
        "high-pass energy: {} values and {} marks for {} channels of {} x {} pixels",
        p.values.size(), covered.size(), p.channels, p.width, p.height);
  }
  const auto finite = [](float x) { return std::isfinite(x); };
  if (std::all_of(p.values.begin(), p.values.end(), finite)) return {};
  return InvalidArgument("high-pass energy: a value of the picture is not finite");
}

}  // namespace

Result<double> HighPassEnergy(const PlanarPicture& picture, std::span<const std::uint8_t> covered) {
  TILEGRAD_TRY(CheckPicture(picture, covered));
  const std::ptrdiff_t plane = std::ptrdiff_t{picture.height} * picture.width;
  double sum = 0;
  std::int64_t count = 0;
  for (int y = 1; y + 1 < picture.height; ++y) {
    for (int x = 1; x + 1 < picture.width; ++x) {
      if (!Counts(covered, picture.width, x, y)) continue;
      for (int c = 0; c < picture.channels; ++c) {
        const double r = Response(picture.values.data() + c * plane, picture.width, x, y);
        sum += r * r;
      }
      count += picture.channels;
    }
  }
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

}  // namespace tilegrad::train
