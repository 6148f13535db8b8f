// SPDX-License-Identifier: Apache-2.0
// The whole differentiable renderer: geometry, colours, textures, light and cameras in, images out;
// gradients of images in, gradients of all of them out. What the scene does not have and the caller
// does not ask for is not computed (shade_plan.h).
//
//   ShadedScene scene;                                    // views over your arrays
//   scene.positions = positions, scene.faces = faces, scene.camera = OrbitCamera(...);
//   scene.model.lighting = Lighting::kLambert;
//   scene.lights = lights, scene.textures = textures, scene.uvs = {uvs, AttributeRate::kCorner};
//   renderer.Render({&scene, 1}, options, {}, &frame);    // frame.color, frame.alpha
//   renderer.Backward({&scene, 1}, options, frame, d_frame, {&d_scene, 1});
#pragma once

#include <memory>
#include <span>

#include "base/parallel.h"
#include "render/scene.h"
#include "render/shading/plan.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Owns scratch memory, which is reused: rendering the same sizes again allocates nothing. One call
// at a time per ShadedRenderer. Same bits for any worker count and any run. All scenes of a batch
// have the same model and the same parts (what is empty in one is empty in all), of the same rates.
class ShadedRenderer {
 public:
  explicit ShadedRenderer(const Workers& workers);  // keeps a reference
  ~ShadedRenderer();
  ShadedRenderer(ShadedRenderer&&) noexcept;
  ShadedRenderer& operator=(ShadedRenderer&&) noexcept;

  // Errors: those of Renderer::Render, and the same for what shading adds. Then `frame` is left
  // unspecified.
  Status Render(std::span<const ShadedScene> scenes, const RenderOptions& options,
                const ShadedRequest& request, ShadedFrame* frame);

  // `scenes`, `options` and `frame` as they were given to and filled by Render; of the frame, face
  // ids are read, and alpha where d_frame has it. A gradient that overflows float is an error too;
  // after an error d_scenes may be written in part.
  Status Backward(std::span<const ShadedScene> scenes, const RenderOptions& options,
                  const ShadedFrame& frame, const ShadedFrameGradients& d_frame,
                  std::span<ShadedGradients> d_scenes);

  PlanReport Explain() const;  // the last call

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad
