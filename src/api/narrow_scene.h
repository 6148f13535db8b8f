// SPDX-License-Identifier: Apache-2.0
// A scene in double as one in float, so that the engine's checks hold for both.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render/scene.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Copies of what the checks look at. A number beyond float's range becomes infinite, which is an
// error then.
class NarrowBatch {
 public:
  explicit NarrowBatch(std::span<const ShadedSceneT<double>> scenes);

  Status Validate(const RenderOptions& options) const;
  // Sizes of cotangents and of gradients, and the numbers of the former.
  Status ValidateBackward(const RenderOptions& options, const ShadedFrameT<double>& frame,
                          const ShadedFrameGradientsT<double>& d_frame,
                          std::span<const ShadedGradientsT<double>> d_scenes);

 private:
  std::span<float> Copy(std::span<const double> values);
  ShadedScene Copy(const ShadedSceneT<double>& scene);
  ShadedGradients Copy(const ShadedGradientsT<double>& d_scene);

  // Arrays stay where they are when the lists grow.
  std::vector<std::unique_ptr<std::vector<float>>> arrays_;
  std::vector<std::unique_ptr<std::vector<shade::TextureView>>> textures_;
  std::vector<std::unique_ptr<std::vector<Surface>>> surfaces_;
  std::vector<std::unique_ptr<std::vector<shade::DirectionalLight>>> lights_;
  std::vector<std::unique_ptr<std::vector<std::span<float>>>> spans_;
  std::vector<ShadedScene> scenes_;
};

}  // namespace tilegrad
