// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/pictures.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "fit/input.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

// A mean difference of colours as large as the pictures' own deviation from their mean costs this
// much, where silhouettes cost at most 1.
constexpr double kColorCost = 0.4;
constexpr double kLeastDeviation = 0.02;  // of objects of one colour, whose shades are noise

// The upper left part whose sides are multiples of `factor`.
TargetImages CutToMultiple(const TargetImages& images, int factor) {
  TargetImages out;
  out.width = images.width / factor * factor;
  out.height = images.height / factor * factor;
  if (out.width == images.width && out.height == images.height) return images;
  const auto copy = [&](const AlignedVector<float>& from, AlignedVector<float>* to) {
    const std::size_t planes = from.size() / images.pixels();
    to->resize(planes * out.pixels());
    for (std::size_t row = 0; row < planes * static_cast<std::size_t>(out.height); ++row) {
      const std::size_t plane = row / static_cast<std::size_t>(out.height);
      const std::size_t y = row % static_cast<std::size_t>(out.height);
      const auto* source =
          from.data() + plane * images.pixels() + y * static_cast<std::size_t>(images.width);
      std::copy_n(source, out.width, to->data() + row * static_cast<std::size_t>(out.width));
    }
  };
  copy(images.color, &out.color);
  copy(images.alpha, &out.alpha);
  return out;
}

// Mean over the object's pixels of `value`, a function of (image, channel, pixel of the plane).
template <class Value>
double MeanOnObject(const TargetImages& images, std::size_t channel, const Value& value) {
  double sum = 0, weight = 0;
  for (std::size_t i = 0; i < images.alpha.size(); ++i) {
    const std::size_t n = i / images.pixels(), p = i % images.pixels();
    const auto alpha = static_cast<double>(images.alpha[i]);
    weight += alpha;
    sum += alpha * value(images.color[(3 * n + channel) * images.pixels() + p]);
  }
  return weight > 0 ? sum / weight : 0;
}

void SetColors(PosePictures* out) {
  double deviation = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double mean =
        MeanOnObject(out->images, c, [](float x) { return static_cast<double>(x); });
    out->mean_color[c] = static_cast<float>(mean);
    deviation += MeanOnObject(out->images, c, [&](float x) { return std::abs(x - mean); }) / 3;
  }
  out->color_weight = kColorCost / std::max(kLeastDeviation, deviation);
}

}  // namespace

Result<PosePictures> PreparePictures(const TargetImages& images, std::span<const Camera> lenses,
                                     int side) {
  PosePictures out;
  // No side of the result may vanish.
  const auto [shorter, longer] = std::minmax(images.width, images.height);
  const int factor = std::clamp(longer / side, 1, shorter);
  out.images = Reduce(CutToMultiple(images, factor), factor);
  const std::size_t plane = images.pixels();
  for (std::size_t n = 0; n < lenses.size(); ++n) {
    out.lenses.push_back(ScaledCamera(lenses[n], 1.0f / static_cast<float>(factor)));
    const CropSource source{images.width, images.height,
                            std::span(images.color).subspan(3 * n * plane, 3 * plane),
                            std::span(images.alpha).subspan(n * plane, plane)};
    auto crop = CropOf(source, lenses[n]);
    if (!crop) return InvalidArgument("image {} shows no object: its mask is empty", n);
    out.crops.push_back(std::move(*crop));
  }
  SetColors(&out);
  return out;
}

std::vector<double> Unlikeness(const PosePictures& pictures) {
  const std::size_t n = pictures.crops.size();
  std::vector<double> out(n * n), all;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double cost = CropCost(pictures.crops[i], pictures.crops[j], pictures.color_weight);
      out[i * n + j] = out[j * n + i] = cost;
      all.push_back(cost);
    }
  }
  if (all.empty()) return out;
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end());
  for (double& d : out) d /= std::max(*middle, 1e-9);
  return out;
}

}  // namespace tilegrad::train
