// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "base/array_checks.h"
#include "base/error.h"
#include "base/scalar.h"
#include "raster/conventions.h"
#include "render/scene_fields.h"
#include "render/validate.h"

namespace tilegrad {
namespace {

Status CheckWanted(const char* kind, const char* array, std::size_t got, std::size_t expected) {
  if (got == 0 || got == expected) return {};
  return InvalidArgument("{}.{} has {} numbers, expected {}", kind, array, got, expected);
}

template <class T>
Status CheckGradients(const SceneT<T>& scene, const SceneGradientsT<T>& d) {
  Status status;
  const auto check = [&](const char* name, std::size_t got, std::size_t expected) {
    if (status.ok()) status = CheckWanted("d_scene", name, got, expected);
  };
  ForEachStream(scene, d, [&](const SceneStream<T>& stream) {
    check(stream.name, stream.gradient.size(), stream.values.size());
  });
  check("surfaces", d.surfaces.size(), scene.surfaces.empty() ? 1 : scene.surfaces.size());
  check("lights", d.lights.size(), scene.lights.size());
  check("sh", d.sh.size(), scene.sh.size());
  check("textures", d.textures.size(), scene.textures.size());
  for (std::size_t i = 0; i < d.textures.size() && status.ok(); ++i) {
    check("textures[i]", d.textures[i].size(), scene.textures[i].texels.size());
  }
  return status;
}

}  // namespace

template <class T>
Status ValidateBackward(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                        const FrameImagesT<T>& frame, const FrameGradientsT<T>& d_frame,
                        std::span<const SceneGradientsT<T>> d_scenes) {
  if (d_scenes.size() != scenes.size()) {
    return InvalidArgument("d_scenes has {} entries, expected {}: one per scene", d_scenes.size(),
                           scenes.size());
  }
  Status status;
  ForEachImage(
      scenes.empty() ? 0 : scenes[0].channels,
      [&](const char* name, int planes, std::span<const T> image) {
        if (!status.ok()) return;
        status = CheckWanted("d_frame", name, image.size(),
                             static_cast<std::size_t>(planes) * frame.face_ids.size());
      },
      d_frame);
  TILEGRAD_TRY(status);
  if (!d_frame.alpha.empty() && frame.alpha.empty()) {
    return InvalidArgument("d_frame.alpha is given, but alpha was not rendered");
  }
  if (!d_frame.depth.empty() && options.interpolation != Interpolation::kPerspective) {
    return InvalidArgument("d_frame.depth needs perspective interpolation");
  }
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    status = CheckGradients(scenes[n], d_scenes[n]);
    if (!status.ok()) return status.Within(SceneName(n));
  }
  return {};
}

template <class T>
Status ValidateCotangents(const FrameGradientsT<T>& d_frame,
                          std::span<const std::int32_t> face_ids) {
  TILEGRAD_TRY(CheckNumbers("d_frame.color", d_frame.color));
  TILEGRAD_TRY(CheckNumbers("d_frame.normals", d_frame.normals));
  TILEGRAD_TRY(CheckNumbers("d_frame.uv", d_frame.uv));
  for (std::size_t i = 0; i < d_frame.depth.size(); ++i) {
    const bool background = i < face_ids.size() && face_ids[i] < 0;
    const float d_depth = InFloat(d_frame.depth[i]);
    if (background || std::isfinite(d_depth)) continue;
    return InvalidArgument("d_frame.depth[{}] is {}", i, d_depth);
  }
  return CheckNumbers("d_frame.attributes", d_frame.attributes);
}

Status ValidateImages(const FrameImages& frame) {
  const std::pair<const char*, std::span<const float>> images[] = {
      {"color", frame.color}, {"attributes", frame.attributes}, {"uv", frame.uv}};
  for (const auto& [name, image] : images) {
    if (AllFinite(image)) continue;
    return CheckFinite(name, image)
        .Within(
            "the image overflows: a product of colours, textures, surfaces and lights, or a sum, "
            "is beyond float; scale them down");
  }
  return {};
}

TILEGRAD_INSTANTIATE(ValidateBackward);
TILEGRAD_INSTANTIATE(ValidateCotangents);

namespace {

template <class T>
Status FirstNotFinite(const char* array, std::span<const T> values) {
  if (AllFinite(values)) return {};
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) return InvalidArgument("{}[{}] is {}", array, i, values[i]);
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

}  // namespace tilegrad
