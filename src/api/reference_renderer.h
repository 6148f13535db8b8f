// SPDX-License-Identifier: Apache-2.0
// The naive renderer in double (render/renderer_ref.h) behind the same calls as the
// ShadedRenderer: batches, checked inputs, arrays that scenes share. Images are its units of work.
#pragma once

#include <span>

#include "base/parallel.h"
#include "render/scene.h"
#include "tilegrad/status.h"

namespace tilegrad {

class ReferenceRenderer {
 public:
  explicit ReferenceRenderer(const Workers& workers) : workers_(&workers) {}  // keeps a reference

  Status Render(std::span<const ShadedSceneT<double>> scenes, const RenderOptions& options,
                const ShadedRequest& request, ShadedFrameT<double>* frame);
  Status Backward(std::span<const ShadedSceneT<double>> scenes, const RenderOptions& options,
                  const ShadedFrameT<double>& frame, const ShadedFrameGradientsT<double>& d_frame,
                  std::span<ShadedGradientsT<double>> d_scenes);

 private:
  const Workers* workers_;
};

}  // namespace tilegrad
