// SPDX-License-Identifier: Apache-2.0
#include "render/pipeline/validate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "raster/conventions.h"
#include "render/pipeline/quick_checks.h"

namespace tilegrad {
namespace {

template <class T>
Status FirstNotFinite(const char* array, std::span<const T> values) {
  if (AllFinite(values)) return {};
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) return InvalidArgument("{}[{}] is {}", array, i, values[i]);
  }
  return {};
}

Status CheckFaces(std::span<const std::int32_t> faces, std::size_t vertices) {
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] < 0 || static_cast<std::size_t>(faces[i]) >= vertices) {
      return InvalidArgument("faces[{}] is {}, outside of [0, {})", i, faces[i], vertices);
    }
  }
  return {};
}

Status CheckCameraGradient(const Camera& d_camera) {
  TILEGRAD_TRY(CheckFinite("d_scene.d_camera.rotation", d_camera.rotation));
  TILEGRAD_TRY(CheckFinite("d_scene.d_camera.translation", d_camera.translation));
  const float numbers[4] = {d_camera.fx, d_camera.fy, d_camera.cx, d_camera.cy};
  return CheckFinite("d_scene.d_camera.{fx, fy, cx, cy}", numbers);
}

template <class T>
Camera CameraInFloat(const CameraT<T>& c) {
  const auto cast = [](T x) { return InFloat(x); };
  Camera out;
  std::transform(std::begin(c.rotation), std::end(c.rotation), out.rotation, cast);
  std::transform(std::begin(c.translation), std::end(c.translation), out.translation, cast);
  out.fx = cast(c.fx);
  out.fy = cast(c.fy);
  out.cx = cast(c.cx);
  out.cy = cast(c.cy);
  out.near_plane = cast(c.near_plane);
  return out;
}

Status CheckCamera(const Camera& camera) {
  TILEGRAD_TRY(CheckFinite("camera.rotation", camera.rotation));
  TILEGRAD_TRY(CheckFinite("camera.translation", camera.translation));
  using Number = std::pair<const char*, float>;
  for (const auto& [name, value] : {Number("fx", camera.fx), Number("fy", camera.fy)}) {
    if (value != 0 && std::isfinite(value)) continue;
    return InvalidArgument("camera.{} is {}, must be finite and not 0", name, value);
  }
  if (!(camera.near_plane > 0) || !std::isfinite(camera.near_plane)) {
    return InvalidArgument("camera.near_plane is {}, must be finite and > 0", camera.near_plane);
  }
  for (const auto& [name, value] : {Number("cx", camera.cx), Number("cy", camera.cy)}) {
    if (std::isfinite(value)) continue;
    return InvalidArgument("camera.{} is {}, must be finite", name, value);
  }
  return {};
}

Status CheckGradients(const PipelineScene& scene, const PipelineGradients& d_scene) {
  if (!d_scene.positions.empty()) {
    TILEGRAD_TRY(CheckSize("d_scene.positions", d_scene.positions.size(), scene.positions.size()));
  }
  if (!d_scene.attributes.empty()) {
    TILEGRAD_TRY(
        CheckSize("d_scene.attributes", d_scene.attributes.size(), scene.attributes.size()));
  }
  return {};
}

Status CheckFrameSizes(std::size_t images, const RenderOptions& options, const PipelineFrame& frame,
                       const PipelineCotangents& d_frame) {
  const std::size_t pixels =
      images * static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  TILEGRAD_TRY(CheckSize("frame.face_ids", frame.face_ids.size(), pixels));
  if (!d_frame.alpha.empty()) {
    TILEGRAD_TRY(CheckSize("d_frame.alpha", d_frame.alpha.size(), pixels));
    TILEGRAD_TRY(CheckSize("frame.alpha", frame.alpha.size(), pixels));
    if (!frame.transmittance.empty()) {
      TILEGRAD_TRY(CheckSize("frame.transmittance", frame.transmittance.size(), pixels));
    }
  }
  return {};
}

Status CheckFaceIds(const PipelineScene& scene, std::span<const std::int32_t> ids) {
  const auto faces = static_cast<std::int32_t>(scene.faces.size() / 3);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] < -1 || ids[i] >= faces) {
      return InvalidArgument("frame.face_ids[{}] is {}, but the scene has {} faces", i, ids[i],
                             faces);
    }
  }
  return {};
}

}  // namespace

std::string SceneName(std::size_t n) { return fmt::format("scene {}", n); }

Status CheckShape(const char* array, std::size_t got, std::size_t rows, std::size_t width) {
  if (got == rows * width) return {};
  return InvalidArgument("{} must be [{},{}], got {} numbers", array, rows, width, got);
}

Status CheckSize(const char* array, std::size_t got, std::size_t expected) {
  if (got == expected) return {};
  return InvalidArgument("{} has {} numbers, expected {}", array, got, expected);
}

Status CheckNotNegative(const char* name, double value) {
  if (value >= 0 && std::isfinite(value)) return {};
  return InvalidArgument("{} is {}, must be finite and >= 0", name, value);
}

Status CheckImageSize(const char* axis, int pixels) {
  if (pixels >= 1 && pixels <= raster::kMaxImageSize) return {};
  return InvalidArgument("options.{} is {}, must be in 1..{} pixels", axis, pixels,
                         raster::kMaxImageSize);
}

Status CheckFinite(const char* array, std::span<const float> values) {
  return FirstNotFinite(array, values);
}
Status CheckFinite(const char* array, std::span<const double> values) {
  return FirstNotFinite(array, values);
}

float InFloat(double x) {
  if (std::abs(x) <= std::numeric_limits<float>::max()) return static_cast<float>(x);
  return std::isnan(x) ? NAN : x > 0 ? INFINITY : -INFINITY;
}

Status CheckNumbers(const char* array, std::span<const float> values) {
  return CheckFinite(array, values);
}
Status CheckNumbers(const char* array, std::span<const double> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float x = InFloat(values[i]);
    if (!std::isfinite(x)) return InvalidArgument("{}[{}] is {}", array, i, x);
  }
  return {};
}

Status ValidateOptions(const RenderOptions& options) {
  TILEGRAD_TRY(CheckImageSize("width", options.width));
  TILEGRAD_TRY(CheckImageSize("height", options.height));
  if (!(options.delta > 0) || !std::isfinite(options.delta)) {
    return InvalidArgument("options.delta is {}, must be finite and > 0", options.delta);
  }
  if (!(options.max_alpha_error >= 0 && options.max_alpha_error <= 1)) {
    return InvalidArgument("options.max_alpha_error is {}, must be in [0, 1]",
                           options.max_alpha_error);
  }
  TILEGRAD_TRY(CheckNotNegative("options.paper_box", options.paper_box));
  if (options.paper_faces >= 0) return {};
  return InvalidArgument("options.paper_faces is {}, must be >= 0", options.paper_faces);
}

template <class T>
Status ValidateSceneSizes(const PipelineSceneT<T>& scene) {
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max() / 8;
  if (scene.positions.size() % 3 != 0) {
    return InvalidArgument("positions must be [V,3], got {} numbers", scene.positions.size());
  }
  if (scene.faces.size() % 3 != 0) {
    return InvalidArgument("faces must be [F,3], got {} indices", scene.faces.size());
  }
  if (std::max({scene.positions.size(), scene.faces.size(), scene.attributes.size()}) > kMost) {
    return ResourceExhausted(
        "{} numbers of positions, {} of faces, {} of attributes: the limit is {} each",
        scene.positions.size(), scene.faces.size(), scene.attributes.size(), kMost);
  }
  const std::size_t vertices = scene.positions.size() / 3;
  if (scene.channels < 0) return InvalidArgument("channels is {}, must be >= 0", scene.channels);
  if (static_cast<std::size_t>(scene.channels) > kMost) {
    return ResourceExhausted("{} channels: the limit is {}", scene.channels, kMost);
  }
  const std::size_t rows = scene.rate == Rate::kVertex ? vertices : scene.faces.size();
  return CheckShape("attributes", scene.attributes.size(), rows,
                    static_cast<std::size_t>(scene.channels));
}

template <class T>
Status ValidateSceneNumbers(const PipelineSceneT<T>& scene) {
  TILEGRAD_TRY(CheckFaces(scene.faces, scene.positions.size() / 3));
  TILEGRAD_TRY(CheckNumbers("positions", scene.positions));
  TILEGRAD_TRY(CheckNumbers("attributes", scene.attributes));
  return CheckCamera(CameraInFloat(scene.camera));
}

template Status ValidateSceneSizes(const PipelineScene&);
template Status ValidateSceneSizes(const PipelineSceneT<double>&);
template Status ValidateSceneNumbers(const PipelineScene&);
template Status ValidateSceneNumbers(const PipelineSceneT<double>&);

Status ValidateSceneSizes(std::span<const PipelineScene> scenes) {
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (const Status status = ValidateSceneSizes(scenes[n]); !status.ok()) {
      return status.Within(SceneName(n));
    }
    if (scenes[n].channels != scenes[0].channels) {
      return InvalidArgument("scene {} has {} channels, scene 0 has {}: a batch must agree", n,
                             scenes[n].channels, scenes[0].channels);
    }
  }
  return {};
}

Status ValidateSceneNumbers(std::span<const PipelineScene> scenes) {
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (const Status status = ValidateSceneNumbers(scenes[n]); !status.ok()) {
      return status.Within(SceneName(n));
    }
  }
  return {};
}

Status ValidateBackwardSizes(std::span<const PipelineScene> scenes, const RenderOptions& options,
                             const PipelineFrame& frame, const PipelineCotangents& d_frame,
                             std::span<const PipelineGradients> d_scenes) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_TRY(ValidateSceneSizes(scenes));
  if (d_scenes.size() != scenes.size()) {
    return InvalidArgument("{} scenes, but {} d_scenes", scenes.size(), d_scenes.size());
  }
  TILEGRAD_TRY(CheckFrameSizes(scenes.size(), options, frame, d_frame));
  if (!scenes.empty() && !d_frame.attributes.empty()) {
    TILEGRAD_TRY(CheckSize("d_frame.attributes", d_frame.attributes.size(),
                           frame.face_ids.size() * static_cast<std::size_t>(scenes[0].channels)));
  }
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    if (const Status status = CheckGradients(scenes[n], d_scenes[n]); !status.ok()) {
      return status.Within(SceneName(n));
    }
  }
  return {};
}

Status ValidateBackwardNumbers(std::span<const PipelineScene> scenes, const PipelineFrame& frame,
                               const PipelineCotangents& d_frame) {
  TILEGRAD_TRY(CheckFinite("d_frame.alpha", d_frame.alpha));
  TILEGRAD_TRY(CheckFinite("d_frame.attributes", d_frame.attributes));
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    const std::size_t pixels = frame.face_ids.size() / scenes.size();
    const Status status =
        CheckFaceIds(scenes[n], std::span(frame.face_ids).subspan(n * pixels, pixels));
    if (!status.ok()) return status.Within(SceneName(n));
  }
  return {};
}

namespace {

Status CheckResult(const PipelineGradients& d_scene) {
  Status status = CheckFinite("d_scene.positions", d_scene.positions);
  if (status.ok()) status = CheckFinite("d_scene.attributes", d_scene.attributes);
  if (status.ok() && d_scene.camera) status = CheckCameraGradient(d_scene.d_camera);
  return status.ok() ? status : status.Within("the gradient overflows");  // no string if not needed
}

}  // namespace

Status ValidateResult(std::span<const PipelineGradients> d_scenes) {
  for (std::size_t n = 0; n < d_scenes.size(); ++n) {
    const Status status = CheckResult(d_scenes[n]);
    if (!status.ok()) return status.Within(SceneName(n));
  }
  return {};
}

}  // namespace tilegrad
