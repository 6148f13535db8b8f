// SPDX-License-Identifier: Apache-2.0
#include "cli/predict_light.h"

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "io/webp_animation.h"
#include "scene/camera_conventions.h"
#include "scene/light_frame.h"
#include "train/tasks/textured_image/object_pictures.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::cli {
namespace {

constexpr int kLightFrames = 36, kLightFrameMilliseconds = 100, kLightQuality = 85, kLightZoom = 4,
              kLightSamples = 2;
constexpr double kLeastTilt = 20 * std::numbers::pi / 180;  // less would not be seen to move

// The light turned about the camera's axis.
std::array<float, 3> Turned(const std::array<float, 3>& d, double angle) {
  const double start = std::atan2(d[1], d[0]);
  const double tilt = std::max(kLeastTilt, std::acos(std::clamp(double{d[2]}, -1.0, 1.0)));
  return {static_cast<float>(std::sin(tilt) * std::cos(start + angle)),
          static_cast<float>(std::sin(tilt) * std::sin(start + angle)),
          static_cast<float>(std::cos(tilt))};
}

}  // namespace

bool PredictsLight(const train::Predictor& predictor) {
  const auto* const model = predictor.model().textured();
  return model != nullptr && train::LightingOf(model->config().light) != Lighting::kNone;
}

Result<std::optional<train::PredictedObject>> PredictLit(const train::Predictor& predictor,
                                                         std::span<const std::uint8_t> picture) {
  if (!PredictsLight(predictor)) return std::optional<train::PredictedObject>();
  TILEGRAD_ASSIGN(auto objects, predictor.model().textured()->PredictObjects(picture));
  if (!objects[0].camera) return std::optional<train::PredictedObject>();
  return std::optional(std::move(objects[0]));
}

glm::dvec3 SunOf(const train::PredictedObject& object, const train::LightConfig& light) {
  const auto d =
      DirectionToWorld(train::DirectionOf(object.light, train::LightingOf(light)), *object.camera);
  return {d[0], d[1], d[2]};
}

Status AnimateRelighting(const Mesh& mesh, const Relighting& job, const Path& file) {
  // Harmonics are shown as a direction: turning nine coefficients would turn the sky, too.
  train::LightConfig light = job.light;
  if (train::LightingOf(light) == Lighting::kSphericalHarmonics) light.model = "lambert";
  const int size = kLightZoom * job.size;
  train::ObjectPictures pictures(light, size, kLightSamples);
  train::TexturedView view{ScaledCamera(*job.object.camera, kLightZoom), job.object.light};
  const auto predicted = train::DirectionOf(job.object.light, train::LightingOf(job.light));
  std::vector<ImageU8> frames;
  for (int k = 0; k < kLightFrames; ++k) {
    TILEGRAD_TRY(
        job.watch.At({"moving the light", static_cast<std::uint64_t>(k), kLightFrames, ""}));
    view.light.direction = Turned(predicted, 2 * std::numbers::pi * k / kLightFrames);
    TILEGRAD_ASSIGN(const auto rgba, pictures.Draw(mesh, view, train::Appearance::kLit));
    frames.push_back(train::OnPaper(rgba, size));
  }
  return io::SaveWebpAnimation(
      file, frames,
      {.frame_ms = kLightFrameMilliseconds, .quality = kLightQuality, .watch = job.watch});
}

}  // namespace tilegrad::cli
