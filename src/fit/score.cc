// SPDX-License-Identifier: Apache-2.0
#include "fit/score.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <optional>

#include "fit/cutout.h"
#include "fit/quarter_turn.h"
#include "render/picture/composite.h"

namespace tilegrad::train {
namespace {

constexpr int kSamples = 3;  // a side of a pixel
constexpr double kBestPsnr = 99;
constexpr float kCovered = 0.5f;
constexpr double kLowIou = 0.75;    // mean of all views, below which they do not fit together
constexpr double kFarBelow = 0.25;  // of one view below the mean, which is then its own fault

Picture TruthOf(const TargetImages& images, std::size_t view) {
  const std::size_t plane = images.pixels();
  Picture out;
  out.width = images.width;
  out.height = images.height;
  const auto color = std::span(images.color).subspan(3 * view * plane, 3 * plane);
  const auto alpha = std::span(images.alpha).subspan(view * plane, plane);
  out.color.assign(color.begin(), color.end());
  out.alpha.assign(alpha.begin(), alpha.end());
  return out;
}

// The numbers behind OverGrey's bytes.
std::vector<float> OverWhite(const Picture& picture) {
  const std::size_t plane = picture.alpha.size();
  std::vector<float> out(3 * plane);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = kWhite + picture.alpha[i % plane] * (picture.color[i] - kWhite);
  }
  return out;
}

double Psnr(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double gap = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += gap * gap;
  }
  const double mean = sum / static_cast<double>(a.size());
  return mean > 0 ? std::min(kBestPsnr, -10 * std::log10(mean)) : kBestPsnr;
}

// Of pixels that are covered by a half or more: products of soft edges would say less than 1 of
// equal masks.
double MaskIou(std::span<const float> a, std::span<const float> b) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    both += a[i] >= kCovered && b[i] >= kCovered;
    either += a[i] >= kCovered || b[i] >= kCovered;
  }
  return either > 0 ? both / either : 1;
}

// glm is column-major, cameras are row-major.
glm::dmat3 RotationOf(const Camera& camera) {
  glm::dmat3 m;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m[c][r] = static_cast<double>(camera.rotation[3 * r + c]);
  }
  return m;
}

glm::dvec3 TranslationOf(const Camera& c) {
  return {c.translation[0], c.translation[1], c.translation[2]};
}

glm::dvec3 CentreOf(const Camera& camera) {
  return -(glm::transpose(RotationOf(camera)) * TranslationOf(camera));
}

glm::dmat3 MatrixOf(const Similarity& a) {
  glm::dmat3 m;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m[c][r] = a.rotation[3 * r + c];
  }
  return m;
}

}  // namespace

Result<Picture> DrawView(FitRenderer& renderer, const FitScene& scene, int view, ImageSize size) {
  FitRenderer::Job job;
  job.views = {&view, 1};
  job.scale = kSamples;
  job.alpha = false;
  job.options.width = kSamples * size.width;
  job.options.height = kSamples * size.height;
  TILEGRAD_TRY(renderer.Render(scene, job));
  Picture out;
  AverageSamples(renderer.images(), kSamples, &out);
  return out;
}

Result<std::vector<ViewScore>> ScoreViews(const FitScene& scene, const FitInput& input,
                                          std::span<const int> views,
                                          std::span<const Camera> cameras, const Workers& workers,
                                          const Watch& watch) {
  FitScene seen = scene;
  seen.cameras.assign(cameras.begin(), cameras.end());
  FitRenderer renderer(workers);
  std::optional<CutoutView> cut;
  if (!scene.cutout.empty()) cut.emplace(scene, workers);
  const ImageSize size{input.images.width, input.images.height};
  std::vector<ViewScore> scores;
  for (int i = 0; i < static_cast<int>(views.size()); ++i) {
    TILEGRAD_TRY(watch.At({"scoring views", static_cast<std::uint64_t>(i), views.size(), ""}));
    const Camera& camera = cameras[static_cast<std::size_t>(i)];
    TILEGRAD_ASSIGN(Picture rendered,
                    cut ? cut->Draw(camera, size, kSamples) : DrawView(renderer, seen, i, size));
    ViewScore score;
    score.view = views[static_cast<std::size_t>(i)];
    if (!scene.gains.empty()) {
      const float gain = scene.gains[static_cast<std::size_t>(score.view)];
      for (float& x : rendered.color) x *= gain;
    }
    const Picture truth = TruthOf(input.images, static_cast<std::size_t>(score.view));
    score.psnr = Psnr(OverWhite(truth), OverWhite(rendered));
    score.iou = MaskIou(rendered.alpha, truth.alpha);
    const auto held = [&](const Picture& picture) {
      return HeldImage(input, static_cast<std::size_t>(score.view), OverGrey(picture, kWhite));
    };
    score.truth = held(truth);
    score.rendered = held(rendered);
    scores.push_back(std::move(score));
  }
  if (!views.empty()) TILEGRAD_TRY(watch.At({"scoring views", views.size(), views.size(), ""}));
  return scores;
}

Similarity AlignCameras(std::span<const Camera> from, std::span<const Camera> to) {
  glm::dmat3 sum(0);
  std::vector<std::array<double, 3>> places_from, places_to;
  for (std::size_t i = 0; i < from.size(); ++i) {
    sum += glm::transpose(RotationOf(to[i])) * RotationOf(from[i]);
    const glm::dvec3 a = CentreOf(from[i]);
    const glm::dvec3 b = CentreOf(to[i]);
    places_from.push_back({a[0], a[1], a[2]});
    places_to.push_back({b[0], b[1], b[2]});
  }
  std::array<double, 9> m;
  for (int i = 0; i < 9; ++i) m[static_cast<std::size_t>(i)] = sum[i % 3][i / 3];
  return FitSimilarity(NearestRotation(m), places_from, places_to);
}

Camera Moved(const Camera& camera, const Similarity& a) {
  // s (R p + t) = (R Q^T)(s Q p + b) + s t - R Q^T b
  const glm::dmat3 r = RotationOf(camera) * glm::transpose(MatrixOf(a));
  const glm::dvec3 t =
      a.scale * TranslationOf(camera) - r * glm::dvec3(a.offset[0], a.offset[1], a.offset[2]);
  Camera out = camera;
  for (int i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) out.rotation[3 * i + c] = static_cast<float>(r[c][i]);
    out.translation[i] = static_cast<float>(t[i]);
  }
  return out;
}

void Move(const Similarity& a, std::vector<float>* positions) {
  const glm::dmat3 q = MatrixOf(a);
  for (std::size_t i = 0; i < positions->size(); i += 3) {
    float* p = positions->data() + i;
    const glm::dvec3 moved = a.scale * (q * glm::dvec3(p[0], p[1], p[2])) +
                             glm::dvec3(a.offset[0], a.offset[1], a.offset[2]);
    for (int c = 0; c < 3; ++c) p[c] = static_cast<float>(moved[c]);
  }
}

double AngleBetween(const Camera& a, const Camera& b) {
  const glm::dmat3 turn = glm::transpose(RotationOf(a)) * RotationOf(b);
  const double cosine = 0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1);
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

double MeanPsnr(std::span<const ViewScore> scores) {
  double sum = 0;
  for (const ViewScore& s : scores) sum += s.psnr / static_cast<double>(scores.size());
  return sum;
}

double MeanIou(std::span<const ViewScore> scores) {
  double sum = 0;
  for (const ViewScore& s : scores) sum += s.iou / static_cast<double>(scores.size());
  return sum;
}

std::string DoubtOf(std::span<const ViewScore> scores, const FitInput& input) {
  if (scores.empty() || !input.masked) return "";
  const ViewScore& worst = *std::ranges::min_element(scores, {}, &ViewScore::iou);
  const double mean = MeanIou(scores);
  if (worst.iou < mean - kFarBelow) {
    return fmt::format(
        "{}: mesh and mask agree to {:.0f} %, those of all views to {:.0f} %; correct its mask or "
        "its camera, or leave the image out",
        input.names[static_cast<std::size_t>(worst.view)], 100 * worst.iou, 100 * mean);
  }
  if (mean >= kLowIou) return "";
  return fmt::format(
      "mesh and masks agree to {:.0f} % only: look for wrong masks and cameras, or give it more "
      "steps",
      100 * mean);
}

}  // namespace tilegrad::train
