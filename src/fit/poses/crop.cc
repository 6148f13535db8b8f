// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/crop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <span>
#include <vector>

#include "base/error.h"
#include "fit/input.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

// A mean difference of colours as large as the pictures' own deviation from their mean costs this
// much, where silhouettes cost at most 1.
constexpr double kColorCost = 0.4;
constexpr double kLeastDeviation = 0.02;  // of objects of one colour, whose shades are noise

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

constexpr float kInsideShare = 0.5f;
constexpr int kCropSamples = 2;      // a side of a crop's pixel
constexpr double kCropMargin = 1.1;  // of the square, so that outlines stay inside

struct Square {
  double x = 0, y = 0, side = 0;  // pixels; the middle
};

std::optional<Square> SquareAround(const CropSource& image) {
  int left = image.width, right = -1, top = image.height, bottom = -1;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.alpha[static_cast<std::size_t>(y * image.width + x)] < kInsideShare) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  if (right < left) return std::nullopt;
  return Square{0.5 * (left + right + 1), 0.5 * (top + bottom + 1),
                kCropMargin * (std::max(right - left, bottom - top) + 1)};
}

// Adds the bilinear sample at (x, y), which counts pixel centres at +0.5, to pixel `to`.
void AddSample(const CropSource& image, double x, double y, std::size_t to, Crop* crop) {
  const double u = x - 0.5, v = y - 0.5;
  const int left = static_cast<int>(std::floor(u)), top = static_cast<int>(std::floor(v));
  const auto plane = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  for (int k = 0; k < 4; ++k) {
    const int column = left + k % 2, row = top + k / 2;
    if (column < 0 || row < 0 || column >= image.width || row >= image.height) continue;
    const double weight = (k % 2 == 1 ? u - left : 1 - (u - left)) *
                          (k / 2 == 1 ? v - top : 1 - (v - top)) / (kCropSamples * kCropSamples);
    const auto p = static_cast<std::size_t>(row * image.width + column);
    const float share = static_cast<float>(weight) * image.alpha[p];
    crop->alpha[to] += share;
    for (std::size_t c = 0; c < 3; ++c) {
      crop->color[c * kCropPixels + to] += share * image.color[c * plane + p];
    }
  }
}

// The rotation that takes -z to (x, y, -1), by the shortest way.
glm::dmat3 TurnTo(double x, double y) {
  const glm::dvec3 to = glm::normalize(glm::dvec3(x, y, -1)), from(0, 0, -1);
  const glm::dvec3 v = glm::cross(from, to);
  const glm::dmat3 k(glm::dvec3(0, v.z, -v.y), glm::dvec3(-v.z, 0, v.x), glm::dvec3(v.y, -v.x, 0));
  return glm::dmat3(1) + k + (1 / (1 + glm::dot(from, to))) * (k * k);
}

}  // namespace

std::optional<Crop> CropOf(const CropSource& image, const Camera& camera) {
  const auto square = SquareAround(image);
  if (!square) return std::nullopt;
  Crop out;
  out.alpha.resize(kCropPixels);
  out.color.resize(3 * kCropPixels);
  const double step = square->side / (kCropSide * kCropSamples);
  const double left = square->x - 0.5 * square->side, top = square->y - 0.5 * square->side;
  for (int j = 0; j < kCropSide * kCropSamples; ++j) {
    for (int i = 0; i < kCropSide * kCropSamples; ++i) {
      const auto to = static_cast<std::size_t>(j / kCropSamples * kCropSide + i / kCropSamples);
      AddSample(image, left + (i + 0.5) * step, top + (j + 0.5) * step, to, &out);
    }
  }
  out.x = (square->x - static_cast<double>(camera.cx)) / static_cast<double>(camera.fx);
  out.y = -(square->y - static_cast<double>(camera.cy)) / static_cast<double>(camera.fy);
  out.side = square->side / static_cast<double>(camera.fx);
  return out;
}

double CropCost(const Crop& a, const Crop& b, double color_weight) {
  float both = 0, either = 0, gap = 0;
  for (std::size_t p = 0; p < kCropPixels; ++p) {
    both += std::min(a.alpha[p], b.alpha[p]);
    either += std::max(a.alpha[p], b.alpha[p]);
    if (a.alpha[p] < kInsideShare || b.alpha[p] < kInsideShare) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t i = c * kCropPixels + p;
      gap += std::abs(a.color[i] - b.color[i]);
    }
  }
  const double iou = either > 0 ? static_cast<double>(both / either) : 0;
  const double color = both > 0 ? static_cast<double>(gap / (3 * both)) : 1;
  return 1 - iou + color_weight * color;
}

Camera Aligned(const Crop& seen, const Crop& wanted, const Camera& from) {
  const double distance = -static_cast<double>(from.translation[2]);
  const double depth = distance * seen.side / wanted.side;
  const glm::dmat3 turn = TurnTo(wanted.x, wanted.y);
  glm::dmat3 rotation;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rotation[c][r] = static_cast<double>(from.rotation[3 * r + c]);
  }
  const glm::dmat3 turned = turn * rotation;
  const glm::dvec3 place = turn * glm::dvec3(-seen.x * distance, -seen.y * distance, -depth);
  Camera out = from;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) out.rotation[3 * r + c] = static_cast<float>(turned[c][r]);
    out.translation[r] = static_cast<float>(place[r]);
  }
  return out;
}

Result<PosePictures> PreparePictures(const TargetImages& images, std::span<const Camera> lenses,
                                     int side) {
  PosePictures out;
  // No side of the result may vanish.
  const auto [shorter, longer] = std::minmax(images.width, images.height);
  const int factor = std::clamp(longer / side, 1, shorter);
  out.images = Reduce(images, factor);
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
