// SPDX-License-Identifier: Apache-2.0
#include "fit/doctor.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "base/error.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
namespace {

constexpr double kFaint = 1e-6;     // a share of alpha that moves nothing
constexpr double kMostlyFar = 0.5;  // of the silhouette's loss: worth a warning

// What the rendered views show, summed over them.
struct Sight {
  std::size_t views = 0, behind = 0, outside = 0;  // views in which no vertex is in front, in image
  std::size_t drawn = 0;                           // pixels
  std::size_t drawn_on_object = 0;                 // where the target's alpha is not 0
  double lost = 0, lost_far = 0;  // |alpha - target| over pixels of the target that are not drawn
  double nearest = HUGE_VAL;      // of the far ones, pixels to a drawn pixel
};

enum class PointPlace { kInImage, kOutside, kBehind };

PointPlace PlaceOf(const float* p, const Camera& camera, ImageSize size) {
  const float *r = camera.rotation, *t = camera.translation;
  const auto row = [&](int i) {
    return r[3 * i] * p[0] + r[3 * i + 1] * p[1] + r[3 * i + 2] * p[2] + t[i];
  };
  const float depth = -row(2);
  if (!(depth > camera.near_plane)) return PointPlace::kBehind;
  const float x = camera.cx + camera.fx * row(0) / depth,
              y = camera.cy - camera.fy * row(1) / depth;
  const bool inside = x >= 0 && y >= 0 && x <= static_cast<float>(size.width) &&
                      y <= static_cast<float>(size.height);
  return inside ? PointPlace::kInImage : PointPlace::kOutside;
}

void LookAtVertices(const FitScene& scene, const Camera& camera, ImageSize size, Sight* sight) {
  PointPlace best = PointPlace::kBehind;
  for (std::size_t v = 0; v < scene.vertices() && best != PointPlace::kInImage; ++v) {
    best = std::min(best, PlaceOf(&scene.positions[3 * v], camera, size));
  }
  ++sight->views;
  sight->behind += best == PointPlace::kBehind;
  sight->outside += best == PointPlace::kOutside;
}

// Steps (also diagonal) from each pixel to the nearest drawn one, -1 where there is none.
std::vector<int> StepsToDrawn(std::span<const std::int32_t> faces, int width, int height) {
  std::vector<int> steps(faces.size(), -1);
  std::deque<int> queue;
  for (std::size_t p = 0; p < faces.size(); ++p) {
    if (faces[p] >= 0) {
      steps[p] = 0;
      queue.push_back(static_cast<int>(p));
    }
  }
  while (!queue.empty()) {
    const int p = queue.front(), x = p % width, y = p / width;
    queue.pop_front();
    for (int k = 0; k < 9; ++k) {
      const int nx = x + k % 3 - 1, ny = y + k / 3 - 1;
      if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
      int& there = steps[static_cast<std::size_t>(ny * width + nx)];
      if (there < 0) {
        there = steps[static_cast<std::size_t>(p)] + 1;
        queue.push_back(ny * width + nx);
      }
    }
  }
  return steps;
}

void LookAtPixels(const Images& frame, std::size_t n, std::span<const float> truth, Sight* sight) {
  const std::size_t plane = truth.size();
  const auto faces = std::span<const std::int32_t>(frame.face_ids).subspan(n * plane, plane);
  const std::vector<int> steps = StepsToDrawn(faces, frame.width, frame.height);
  for (std::size_t p = 0; p < plane; ++p) {
    if (faces[p] >= 0) {
      ++sight->drawn;
      sight->drawn_on_object += truth[p] > 0;
    } else if (truth[p] > 0 && !frame.alpha.empty()) {
      const float alpha = frame.alpha[n * plane + p];
      const double gap = std::abs(static_cast<double>(truth[p]) - static_cast<double>(alpha));
      sight->lost += gap;
      if (static_cast<double>(alpha) >= kFaint) continue;
      sight->lost_far += gap;
      if (steps[p] > 0) sight->nearest = std::min(sight->nearest, static_cast<double>(steps[p]));
    }
  }
}

Sight Look(const Fitter& fitter, const FitStep& step) {
  Sight sight;
  const TargetImages& targets = *step.targets;
  for (std::size_t n = 0; n < step.views.size(); ++n) {
    const auto view = static_cast<std::size_t>(step.views[n]);
    LookAtVertices(fitter.scene(), ScaledCamera(fitter.scene().cameras[view], step.job.scale),
                   {targets.width, targets.height}, &sight);
    LookAtPixels(
        fitter.images(), n,
        std::span<const float>(targets.alpha).subspan(view * targets.pixels(), targets.pixels()),
        &sight);
  }
  return sight;
}

// Why nothing is seen; "" if something is.
std::string WhyUnseen(const Sight& s) {
  if (s.behind == s.views) {
    return "the mesh is behind the camera in every view: check the cameras' convention (they look "
           "along their -z axis)";
  }
  if (s.behind + s.outside == s.views) {
    return "the mesh is outside of the image in every view: move it, or check the cameras";
  }
  if (s.drawn == 0) return "the mesh covers no pixel: it is smaller than a pixel, or faces away";
  return "";
}

std::string FarSentence(const Sight& s, const FitStep& step) {
  const int side = std::max(step.targets->width, step.targets->height);
  const double delta = step.job.options.delta, reach = ReachInPixels(delta, side);
  const double needed = s.nearest < HUGE_VAL ? s.nearest : side;
  return fmt::format(
      "{:.0f} % of the masks beyond the mesh is out of reach of delta {:.1e} ({:.1f} pixels): "
      "start with a delta of {:.1e} or more",
      100 * s.lost_far / s.lost, delta, reach,
      std::max(2 * delta, delta * (needed / reach) * (needed / reach) * 2));
}

bool OnlyColor(Parameter p) {
  return p != Parameter::kPositions && p != Parameter::kCamera && p != Parameter::kFocal;
}

std::string WhyNoColor(const FitterOptions& options, const Sight& s, Parameter p) {
  if (options.loss.color_weight == 0) {
    return "only the silhouette counts (the colour weight is 0), and it does not depend on this";
  }
  if (s.drawn_on_object == 0) {
    return "the mesh covers only pixels outside the masks";
  }
  if (p == Parameter::kLight || p == Parameter::kMaterial) {
    return "every visible surface faces away from the light";
  }
  return "the visible colours do not depend on it, or already match the images";
}

std::string WhyBlocked(const FitterOptions& options, const FitStep& step, const Sight& s,
                       const FitValues& values, Parameter p) {
  if (values.image_loss == 0) return "the renders already match the images: the loss is 0";
  std::string unseen = WhyUnseen(s);
  if (!unseen.empty()) return unseen;
  if (OnlyColor(p)) return WhyNoColor(options, s, p);
  if (options.loss.silhouette_weight > 0 && s.lost_far > 0) return FarSentence(s, step);
  const bool agree = s.lost == 0 && s.drawn == s.drawn_on_object;
  if (options.loss.silhouette_weight > 0 && !agree) {
    return "the silhouettes differ, but no image shows an outline of the mesh: the cameras may be "
           "inside it";
  }
  return "the loss does not depend on it: the silhouettes agree and colours are constant";
}

const char* UnitOf(Parameter p) {
  switch (p) {
    case Parameter::kTexture:
      return "texels' numbers";
    case Parameter::kPositions:
    case Parameter::kColors:
      return "vertices' numbers";
    default:
      return "numbers";
  }
}

Finding Examine(const Fitter& fitter, Parameter p) {
  std::size_t all = 0, moved = 0;
  for (const FittedBlock& block : fitter.blocks()) {
    if (block.what != p) continue;
    const auto gradient = block.gradient.value().span<float>();
    all += gradient.size();
    moved +=
        static_cast<std::size_t>(std::ranges::count_if(gradient, [](float d) { return d != 0; }));
  }
  Finding finding;
  finding.parameter = p;
  finding.share = all > 0 ? static_cast<double>(moved) / static_cast<double>(all) : 0;
  finding.blocked = moved == 0;
  return finding;
}

std::string ShareSentence(const Finding& finding) {
  return fmt::format("{:.0f} % of its {} get a gradient{}", 100 * finding.share,
                     UnitOf(finding.parameter),
                     finding.share < 0.999 && finding.parameter != Parameter::kCamera
                         ? "; the others are hidden in these views, or no pixel depends on them"
                         : "");
}

}  // namespace

double ReachInPixels(double delta, int side) {
  return std::sqrt(-delta * std::log(kFaint)) * side / 2;
}

Result<std::vector<Finding>> Diagnose(const FitScene& scene, const FitterOptions& options,
                                      const FitStep& step, const Workers& workers) {
  std::vector<Finding> findings;
  FitterOptions possible = options;
  // Regularisers pull whatever the images show.
  possible.regularizers = {};
  for (const Parameter p : kParameters) {
    if (!options.parameters[p]) continue;
    const std::string why = WhyExcluded(scene, p);
    if (why.empty()) continue;
    findings.push_back({p, 0, true, why});
    possible.parameters[p] = false;
  }
  TILEGRAD_ASSIGN(const auto fitter, Fitter::Make(scene, possible, workers));
  TILEGRAD_ASSIGN(const FitValues values, fitter->Evaluate(step));
  const Sight sight = Look(*fitter, step);
  for (const Parameter p : kParameters) {
    if (!possible.parameters[p]) continue;
    Finding finding = Examine(*fitter, p);
    if (finding.blocked) {
      finding.sentence = WhyBlocked(possible, step, sight, values, p);
    } else {
      finding.sentence = ShareSentence(finding);
      const bool far = !OnlyColor(p) && possible.loss.silhouette_weight > 0 &&
                       sight.lost_far > kMostlyFar * sight.lost;
      if (far) finding.sentence += "; " + FarSentence(sight, step);
    }
    findings.push_back(std::move(finding));
  }
  return findings;
}

}  // namespace tilegrad::train
