// SPDX-License-Identifier: Apache-2.0
// Last stage of the way back, per image: from gradients of faces to those of the scene. Sums are
// made in the order of bands, bins and their faces, whoever computed them.
#pragma once

#include <span>

#include "render/pipeline/image_scratch.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// The gradients of an image, one span per kind of part; empty where that part of the image has no
// gradient.
struct ImageGradients {
  std::span<const BandGradients> bands;
  std::span<const BinGradients> bins;
  raster::BackwardRequest request;  // what the bands were asked for
};

// Overwrites d_vertices [V][4], d_x, d_y, d_inverse_depth, 0 of the vertices of the screen mesh,
// with what the bands and bins that are given add up to. Nothing but the image is shared with
// others.
void SumGeometry(const ImageScratch& image, const ImageGradients& gradients,
                 AlignedVector<float>* d_vertices);

// From such sums of all bands and bins: overwrites d_scene's positions and d_camera, where they are
// wanted. Returns whether all that it has written is finite.
bool MergeGeometry(const PipelineScene& scene, const RenderOptions& options,
                   const ImageScratch& image, const ImageGradients& gradients,
                   std::span<const float> d_vertices, WorkerScratch* worker,
                   PipelineGradients* d_scene);

// Whether what was written of positions and the camera is finite.
bool IsFiniteGeometry(const PipelineGradients& d_scene);

// Overwrites d_scene's attributes, if they are wanted. Of a mesh that was cut, that is done by
// MergeGeometry, since attributes at the cut depend on geometry.
bool MergeAttributes(const ImageScratch& image, const ImageGradients& gradients,
                     WorkerScratch* worker, PipelineGradients* d_scene);

}  // namespace tilegrad
