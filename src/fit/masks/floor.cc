// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/floor.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <iterator>

#include "fit/masks/holes.h"

namespace tilegrad::train {
namespace {

constexpr int kSearchSide = 40, kTexelSide = 160;  // texels along the square
constexpr int kHeights = 48, kBetween = 4;         // heights that are tried; then between them
constexpr float kSame = 0.05f;           // standard deviation of one place's colour over views
constexpr float kLeastViews = 0.4f;      // share of the views whose images must have a place
constexpr std::size_t kLeastBeside = 2;  // views that see a place beside the object
constexpr float kNoSupport = 0.25f, kFullSupport = 0.5f;  // of a colour that is believed

float Likeness(glm::vec3 a, glm::vec3 b) {
  const glm::vec3 d = a - b;
  return std::exp(-glm::dot(d, d) / (2 * kSame * kSame));
}

glm::vec3 AxisOf(const Camera& c, int i) {
  return {c.rotation[3 * i], c.rotation[3 * i + 1], c.rotation[3 * i + 2]};
}

glm::vec3 EyeOf(const Camera& c) {
  glm::vec3 eye(0);
  for (int i = 0; i < 3; ++i) eye -= c.translation[i] * AxisOf(c, i);
  return eye;
}

// A peak: a plane through what is plain agrees with itself at any height.
bool StandsOut(std::span<const float> scores, std::ptrdiff_t best) {
  constexpr std::ptrdiff_t kAside = 6;
  constexpr float kHigher = 1.1f;
  if (best < kAside || best + kAside >= std::ssize(scores)) return false;
  const auto at = [&](std::ptrdiff_t i) { return scores[static_cast<std::size_t>(i)]; };
  return at(best) > kHigher * std::max(at(best - kAside), at(best + kAside));
}

std::ptrdiff_t Highest(const std::vector<float>& scores) {
  return std::ranges::max_element(scores) - scores.begin();
}

}  // namespace

glm::vec3 UpOf(std::span<const Camera> cameras) {
  glm::mat3 sum(0);
  glm::vec3 up(0);
  for (const Camera& c : cameras) {
    sum += glm::outerProduct(AxisOf(c, 0), AxisOf(c, 0));
    up += AxisOf(c, 1);
  }
  // Power iteration, from the mean of what is up in the images to what is across all their rights.
  const glm::mat3 rest = glm::mat3(static_cast<float>(cameras.size())) - sum;
  constexpr int kIterations = 100;
  for (int i = 0; i < kIterations; ++i) up = glm::normalize(rest * up);
  return up;
}

Floor::Floor(const TargetImages& images, std::span<const Camera> cameras, const Region& region,
             const Workers& workers)
    : images_(images), cameras_(cameras), region_(region) {
  const glm::vec3& up = region_.up;
  const bool leans = std::abs(up.x) > 0.7f;
  along_ = glm::normalize(glm::cross(up, leans ? glm::vec3(0, 0, 1) : glm::vec3(1, 0, 0)));
  across_ = glm::cross(up, along_);
  Smooth(workers);
  FindHeight(workers);
  texels_.resize(std::size_t{kTexelSide} * kTexelSide);
  workers.For(kTexelSide, [&](std::size_t y, std::size_t) {
    for (std::size_t i = y * kTexelSide; i < (y + 1) * kTexelSide; ++i)
      texels_[i] = Seen(PointOf(height_, kTexelSide, i));
  });
}

void Floor::Smooth(const Workers& workers) {
  smooth_.resize(images_.color.size());
  const int w = images_.width, h = images_.height;
  workers.For(3 * cameras_.size(), [&](std::size_t k, std::size_t) {
    const float* from = &images_.color[k * images_.pixels()];
    float* to = &smooth_[k / 3 * 3 * images_.pixels() + k % 3];
    for (int p = 0; p < w * h; ++p) {
      float sum = 0;
      for (int i = 0; i < 9; ++i) {
        const int x = std::clamp(p % w + i % 3 - 1, 0, w - 1),
                  y = std::clamp(p / w + i / 3 - 1, 0, h - 1);
        sum += from[y * w + x];
      }
      to[3 * p] = sum / 9;
    }
  });
}

void Floor::FindHeight(const Workers& workers) {
  const float step = region_.reach / kHeights;
  std::vector<float> scores(kHeights), near(2 * kBetween + 1);
  workers.For(scores.size(), [&](std::size_t i, std::size_t) {
    scores[i] = ScoreAt(-step * (static_cast<float>(i) + 0.5f));
  });
  const std::ptrdiff_t best = Highest(scores);
  const auto height = [&](std::ptrdiff_t i) {
    return -step * (static_cast<float>(best) + 0.5f + static_cast<float>(i - kBetween) / kBetween);
  };
  workers.For(near.size(), [&](std::size_t i, std::size_t) {
    near[i] = ScoreAt(height(static_cast<std::ptrdiff_t>(i)));
  });
  height_ = height(Highest(near));
  found_ = StandsOut(scores, best);
}

glm::vec3 Floor::PointOf(float height, int side, std::size_t texel) const {
  const auto n = static_cast<std::size_t>(side);
  const float u = (static_cast<float>(texel % n) + 0.5f) / static_cast<float>(side) * 2 - 1,
              v = (static_cast<float>(texel / n) + 0.5f) / static_cast<float>(side) * 2 - 1;
  return region_.middle + height * region_.up + region_.reach * (u * along_ + v * across_);
}

glm::vec3 Floor::ColorAt(std::size_t pixel) const {
  const float* from = &smooth_[3 * pixel];
  return {from[0], from[1], from[2]};
}

std::optional<std::size_t> Floor::PixelOf(std::size_t view, glm::vec3 p) const {
  const Camera& c = cameras_[view];
  const float depth = -(glm::dot(AxisOf(c, 2), p) + c.translation[2]);
  if (!(depth > c.near_plane)) return std::nullopt;
  const float x = c.cx + c.fx * (glm::dot(AxisOf(c, 0), p) + c.translation[0]) / depth;
  const float y = c.cy - c.fy * (glm::dot(AxisOf(c, 1), p) + c.translation[1]) / depth;
  const bool in = x >= 0 && y >= 0 && x < static_cast<float>(images_.width) &&
                  y < static_cast<float>(images_.height);
  if (!in) return std::nullopt;
  return view * images_.pixels() +
         static_cast<std::size_t>(static_cast<int>(y) * images_.width + static_cast<int>(x));
}

// The colour that is most like the others. Its support is their sum of likenesses.
Floor::Texel Floor::Agreed(std::span<const glm::vec3> colors) {
  Texel best;
  for (const glm::vec3 a : colors) {
    float support = 0;
    glm::vec3 sum(0);
    for (const glm::vec3 b : colors) {
      const float like = Likeness(a, b);
      support += like;
      sum += like * b;
    }
    if (support > best.support) best = {sum / support, support};
  }
  return best;
}

Floor::Texel Floor::Seen(glm::vec3 point) const {
  std::vector<glm::vec3> colors;
  for (std::size_t v = 0; v < cameras_.size(); ++v) {
    if (const auto pixel = PixelOf(v, point)) colors.push_back(ColorAt(*pixel));
  }
  if (static_cast<float>(colors.size()) < kLeastViews * static_cast<float>(cameras_.size()))
    return {};
  Texel best = Agreed(colors);
  best.support /= static_cast<float>(colors.size());
  return best;
}

// `hidden` [N,H,W]: 0 where a view looks past the object. Among few views, none supports itself.
Floor::Texel Floor::SeenBeside(glm::vec3 point, const std::vector<std::uint8_t>& hidden) const {
  std::vector<glm::vec3> colors;
  for (std::size_t v = 0; v < cameras_.size(); ++v) {
    const auto pixel = PixelOf(v, point);
    if (pixel && hidden[*pixel] == 0) colors.push_back(ColorAt(*pixel));
  }
  if (colors.size() < kLeastBeside) return {};
  Texel best = Agreed(colors);
  best.support = (best.support - 1) / static_cast<float>(colors.size() - 1);
  return best;
}

void Floor::Relearn(std::span<const float> inside, std::span<const float> holes,
                    const Workers& workers) {
  // Next to the object, smoothed colours are partly its own.
  std::vector<std::uint8_t> hidden;
  for (std::size_t v = 0; v < cameras_.size(); ++v) {
    const auto of_view = inside.subspan(v * images_.pixels(), images_.pixels());
    std::ranges::copy(Dilated(of_view, {images_.width, images_.height}, 1),
                      std::back_inserter(hidden));
  }
  std::vector<std::uint8_t> hidden_or_hole = hidden;
  for (std::size_t p = 0; p < hidden.size(); ++p) hidden_or_hole[p] |= holes[p] > 0;
  workers.For(kTexelSide, [&](std::size_t y, std::size_t) {
    for (std::size_t i = y * kTexelSide; i < (y + 1) * kTexelSide; ++i) {
      const glm::vec3 point = PointOf(height_, kTexelSide, i);
      texels_[i] = SeenBeside(point, hidden_or_hole);
      if (texels_[i].support == 0) texels_[i] = SeenBeside(point, hidden);
    }
  });
}

float Floor::ScoreAt(float height) const {
  float sum = 0;
  for (std::size_t i = 0; i < std::size_t{kSearchSide} * kSearchSide; ++i)
    sum += Seen(PointOf(height, kSearchSide, i)).support;
  return sum;
}

// Null where the ray meets nothing of the square.
const Floor::Texel* Floor::TexelAt(glm::vec3 eye, glm::vec3 ray) const {
  const float above = glm::dot(eye - region_.middle, region_.up) - height_;
  const float t = -above / glm::dot(ray, region_.up);
  if (!(t > 0)) return nullptr;
  const glm::vec3 at = (eye + t * ray - region_.middle) / region_.reach;
  const float u = 0.5f * kTexelSide * (glm::dot(at, along_) + 1),
              v = 0.5f * kTexelSide * (glm::dot(at, across_) + 1);
  if (!(u >= 0 && v >= 0 && u < kTexelSide && v < kTexelSide)) return nullptr;
  return &texels_[static_cast<std::size_t>(v) * kTexelSide + static_cast<std::size_t>(u)];
}

std::vector<float> Floor::Agreement(std::size_t view, float beyond) const {
  const Camera& c = cameras_[view];
  const glm::vec3 eye = EyeOf(c);
  const auto wide = static_cast<std::size_t>(images_.width);
  std::vector<float> out(images_.pixels());
  for (std::size_t p = 0; p < out.size(); ++p) {
    const float x = (static_cast<float>(p % wide) + 0.5f - c.cx) / c.fx,
                y = -(static_cast<float>(p / wide) + 0.5f - c.cy) / c.fy;
    const Texel* texel = TexelAt(eye, x * AxisOf(c, 0) + y * AxisOf(c, 1) - AxisOf(c, 2));
    if (texel == nullptr) {
      out[p] = beyond;
      continue;
    }
    const float belief = (texel->support - kNoSupport) / (kFullSupport - kNoSupport);
    const float like = Likeness(texel->color, ColorAt(view * images_.pixels() + p));
    out[p] = std::clamp(belief, 0.0f, 1.0f) * std::clamp(3 * like - 1, -1.0f, 1.0f);
  }
  return out;
}

}  // namespace tilegrad::train
