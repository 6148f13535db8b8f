// SPDX-License-Identifier: Apache-2.0
// First stage of a frame, per image: scene -> screen -> tiles; and the last of the way back.
#pragma once

#include "render/image_scratch.h"
#include "render/renderer.h"

namespace tilegrad {

struct PrepareRequest {
  bool drawn_bins = true;  // visibility will run
  bool soft_bins = true;   // alpha or its gradient will run
  bool reuse = false;      // what was prepared last, if it was for the same scene and options
};

void PrepareImage(const SceneView& scene, const RenderOptions& options,
                  const PrepareRequest& request, ImageScratch* image);

// Sizes and zeroes the gradients of a prepared image.
void ClearImageGradients(const SceneView& scene, const SceneGradients& wanted, ImageScratch* image);

// From the screen to the scene: overwrites what `d_scene` asks for.
void FinishImageGradients(const SceneView& scene, const RenderOptions& options, ImageScratch* image,
                          SceneGradients* d_scene);

}  // namespace tilegrad
