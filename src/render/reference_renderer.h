// SPDX-License-Identifier: Apache-2.0
// The naive renderer in double (render/reference.h) behind the same calls as the Engine: batches,
// checked inputs, arrays that scenes share. Images are its units of work.
#pragma once

#include <span>

#include "base/parallel.h"
#include "render/frame_images.h"
#include "tilegrad/status.h"

namespace tilegrad {

class ReferenceRenderer {
 public:
  explicit ReferenceRenderer(const Workers& workers) : workers_(&workers) {}  // keeps a reference

  Status Render(std::span<const SceneT<double>> scenes, const RenderOptions& options,
                const Outputs& outputs, FrameImagesT<double>* frame);
  Status Backward(std::span<const SceneT<double>> scenes, const RenderOptions& options,
                  const FrameImagesT<double>& frame, const FrameGradientsT<double>& d_frame,
                  std::span<const SceneGradientsT<double>> d_scenes);

 private:
  const Workers* workers_;
};

}  // namespace tilegrad
