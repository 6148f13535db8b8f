// SPDX-License-Identifier: Apache-2.0
#include "fit/background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include "base/error.h"
#include "train/data/cutout.h"

namespace tilegrad::train {
namespace {

constexpr double kBorder = 0.02;  // of the shorter side
constexpr int kRounds = 5;        // of the fit to the border
constexpr double kKept = 2.5;     // standard deviations: what is farther off is left out
constexpr double kThreshold = 4, kLeastThreshold = 0.05;
constexpr double kToDeviation = 1.4826;  // from the median of |gaps|, of a normal distribution
constexpr double kHole = 5e-4;           // of the picture
constexpr double kSpeck = 0.02;          // of the object's largest part
constexpr double kMostUneven = 0.1;      // standard deviation of a background that is still plain
constexpr double kMostForeign = 0.3;     // share of the border that may show the object
constexpr double kLeastObject = 0.002, kMostObject = 0.95;

enum class Place : std::uint8_t { kUnknown, kBackground, kObject };

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::ranges::nth_element(*values, middle);
  return *middle;
}

class Separation {
 public:
  Separation(std::span<const float> color, int width, int height)
      : width_(width), height_(height), raw_(color), color_(Averaged(color)) {}

  BackgroundMask Run() {
    FitBorder();
    Measure();
    Flood();
    Peel();
    DropSpecks();
    return {Soft(), Doubt()};
  }

 private:
  std::size_t pixels() const {
    return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  }
  std::size_t At(int x, int y) const { return static_cast<std::size_t>(y * width_ + x); }

  bool OnBorder(std::size_t p) const {
    const int x = static_cast<int>(p) % width_, y = static_cast<int>(p) / width_;
    const int wide =
        std::max(1, static_cast<int>(std::lround(kBorder * std::min(width_, height_))));
    return std::min({x, y, width_ - 1 - x, height_ - 1 - y}) < wide;
  }

  // 1, x, y, the latter in [-1, 1].
  glm::dvec3 Terms(std::size_t p) const {
    const int x = static_cast<int>(p) % width_, y = static_cast<int>(p) / width_;
    return {1, 2.0 * (x + 0.5) / width_ - 1, 2.0 * (y + 0.5) / height_ - 1};
  }

  double Gap(std::span<const float> color, std::size_t p) const {
    const glm::dvec3 terms = Terms(p);
    double most = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = static_cast<double>(color[c * pixels() + p]);
      most = std::max(most, std::abs(value - glm::dot(model_[c], terms)));
    }
    return most;
  }

  template <class Value>  // float(std::size_t pixel)
  std::vector<float> Mean3x3(const Value& value) const {
    std::vector<float> out(pixels());
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        float sum = 0;
        for (int k = 0; k < 9; ++k) {
          sum += value(At(std::clamp(x + k % 3 - 1, 0, width_ - 1),
                          std::clamp(y + k / 3 - 1, 0, height_ - 1)));
        }
        out[At(x, y)] = sum / 9;
      }
    }
    return out;
  }

  std::vector<float> Averaged(std::span<const float> color) const {
    std::vector<float> out;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto plane = color.subspan(c * pixels(), pixels());
      const std::vector<float> mean = Mean3x3([&](std::size_t p) { return plane[p]; });
      out.insert(out.end(), mean.begin(), mean.end());
    }
    return out;
  }

  void FitBorder() {
    for (std::size_t p = 0; p < pixels(); ++p) {
      if (OnBorder(p)) border_.push_back(p);
    }
    std::vector<std::size_t> kept = border_;
    for (int round = 0; round < kRounds; ++round) {
      glm::dmat3 normal(1e-9);
      std::array<glm::dvec3, 3> right{};
      for (const std::size_t p : kept) {
        const glm::dvec3 terms = Terms(p);
        normal += glm::outerProduct(terms, terms);
        for (std::size_t c = 0; c < 3; ++c) {
          right[c] += static_cast<double>(color_[c * pixels() + p]) * terms;
        }
      }
      for (std::size_t c = 0; c < 3; ++c) model_[c] = glm::inverse(normal) * right[c];
      // The median bears with an object on half of the border.
      std::vector<double> gaps;
      for (const std::size_t p : border_) gaps.push_back(Gap(color_, p));
      deviation_ = kToDeviation * Median(&gaps);
      const double most = std::max(kKept * deviation_, kLeastThreshold / 2);
      kept.clear();
      for (const std::size_t p : border_) {
        if (Gap(color_, p) <= most) kept.push_back(p);
      }
    }
  }

  void Measure() {
    threshold_ = std::max(kLeastThreshold, kThreshold * deviation_);
    gap_.resize(pixels());
    place_.resize(pixels());
    for (std::size_t p = 0; p < pixels(); ++p) gap_[p] = static_cast<float>(Gap(color_, p));
    const auto outside = std::ranges::count_if(
        border_, [&](std::size_t p) { return static_cast<double>(gap_[p]) > threshold_; });
    foreign_ = static_cast<double>(outside) / static_cast<double>(border_.size());
  }

  void Flood() {
    const auto plain = [&](std::size_t p) { return static_cast<double>(gap_[p]) <= threshold_; };
    const auto like = [&](std::size_t p) { return static_cast<double>(gap_[p]) <= threshold_ / 2; };
    for (const std::size_t p : border_) {
      if (place_[p] == Place::kUnknown && plain(p)) Spread(p, Place::kBackground, plain);
    }
    const double least = kHole * static_cast<double>(pixels());
    for (std::size_t p = 0; p < pixels(); ++p) {
      if (place_[p] != Place::kUnknown || !like(p)) continue;
      const auto hole = Spread(p, Place::kBackground, [&](std::size_t q) {
        return place_[q] == Place::kUnknown && like(q);
      });
      if (static_cast<double>(hole.size()) >= least) continue;
      for (const std::size_t q : hole) place_[q] = Place::kObject;
    }
    for (Place& place : place_) {
      if (place == Place::kUnknown) place = Place::kObject;
    }
  }

  void Peel() {
    std::vector<double> gaps;
    for (const std::size_t p : border_) gaps.push_back(Gap(raw_, p));
    const double threshold = std::max(kLeastThreshold, kThreshold * kToDeviation * Median(&gaps));
    const std::vector<float> share =
        Mean3x3([&](std::size_t p) { return place_[p] == Place::kObject ? 1.0f : 0.0f; });
    for (std::size_t p = 0; p < pixels(); ++p) {
      if (share[p] < 1 && Gap(raw_, p) <= threshold) place_[p] = Place::kBackground;
    }
  }

  void DropSpecks() {
    std::vector<std::vector<std::size_t>> parts;
    for (std::size_t p = 0; p < pixels(); ++p) {
      if (place_[p] != Place::kObject) continue;
      parts.push_back(
          Spread(p, Place::kUnknown, [&](std::size_t q) { return place_[q] == Place::kObject; }));
    }
    std::size_t largest = 0;
    for (const auto& part : parts) largest = std::max(largest, part.size());
    for (const auto& part : parts) {
      const bool speck = static_cast<double>(part.size()) < kSpeck * static_cast<double>(largest);
      for (const std::size_t p : part) place_[p] = speck ? Place::kBackground : Place::kObject;
    }
  }

  std::vector<float> Soft() const {
    return Mean3x3([&](std::size_t p) { return place_[p] == Place::kObject ? 1.0f : 0.0f; });
  }

  std::string Doubt() const {
    if (deviation_ > kMostUneven) {
      return fmt::format("the background is not plain: it varies by {:.2f} along the border",
                         deviation_);
    }
    if (foreign_ > kMostForeign) {
      return fmt::format(
          "the background is not plain, or the object is cut off: {:.0f} % of the border differ "
          "from "
          "the rest",
          100 * foreign_);
    }
    const auto object = std::ranges::count(place_, Place::kObject);
    const double share = static_cast<double>(object) / static_cast<double>(pixels());
    if (share < kLeastObject) return "no foreground differs from the background";
    if (share > kMostObject) return "almost no pixel resembles the border: no background was found";
    return {};
  }

  // Pixels that are connected with `first` and satisfy `belongs`, which are given `mark`.
  template <class Belongs>
  std::vector<std::size_t> Spread(std::size_t first, Place mark, const Belongs& belongs) {
    std::vector<std::size_t> found = {first};
    place_[first] = mark;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const int x = static_cast<int>(found[i]) % width_, y = static_cast<int>(found[i]) / width_;
      const int next[4][2] = {{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}};
      for (const auto& [u, v] : next) {
        if (u < 0 || v < 0 || u >= width_ || v >= height_) continue;
        const std::size_t p = At(u, v);
        if (place_[p] == mark || !belongs(p)) continue;
        place_[p] = mark;
        found.push_back(p);
      }
    }
    return found;
  }

  const int width_, height_;
  const std::span<const float> raw_;
  std::vector<float> color_;         // averaged
  std::array<glm::dvec3, 3> model_;  // of each channel
  std::vector<std::size_t> border_;
  std::vector<float> gap_;  // from the model
  double deviation_ = 0, threshold_ = 0, foreign_ = 0;
  std::vector<Place> place_;
};

}  // namespace

BackgroundMask MaskFromPlainBackground(std::span<const float> color, int width, int height) {
  return Separation(color, width, height).Run();
}

bool IsOpaque(const ImageU8& image) {
  const auto channels = static_cast<std::size_t>(image.channels);
  if (channels == 1 || channels == 3) return true;
  for (std::size_t i = channels - 1; i < image.pixels.size(); i += channels) {
    if (image.pixels[i] < 255) return false;
  }
  return true;
}

Result<ImageU8> WithoutPlainBackground(const ImageU8& image) {
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t plane = image.pixels.size() / channels;
  std::vector<float> color(3 * plane);
  for (std::size_t i = 0; i < color.size(); ++i) {
    const std::size_t channel = channels >= 3 ? i / plane : 0;
    color[i] = static_cast<float>(image.pixels[channels * (i % plane) + channel]) / 255;
  }
  const BackgroundMask found = MaskFromPlainBackground(color, image.width, image.height);
  if (!found.doubt.empty()) {
    return InvalidArgument(
        "the object is not cut out, and {}; give an image with a transparent background, or a mask",
        found.doubt);
  }
  ImageU8 mask(image.width, image.height, 1);
  std::ranges::transform(found.alpha, mask.pixels.begin(),
                         [](float a) { return static_cast<std::uint8_t>(255 * a + 0.5f); });
  return WithMask(image, mask);
}

}  // namespace tilegrad::train
