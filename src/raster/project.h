// SPDX-License-Identifier: Apache-2.0
// World to screen (scene/camera.h), with near clipping, and its adjoint.
#pragma once

#include <span>

#include "base/aligned.h"
#include "raster/drawn_faces.h"
#include "raster/near_clip.h"
#include "raster/screen_mesh.h"

namespace tilegrad::raster {

// Splits `faces` [F,3] into one array per corner, and the faces' numbers: FaceSource::corners.
// Allocates only to grow `out`. `workers` null: the calling thread.
void SplitFaces(std::span<const std::int32_t> faces, FaceCorners* out,
                const Workers* workers = nullptr);

// Fills `out` with the screen mesh of a validated, finite source, and sets up its `faces`. `out`
// then views source.corners, if given. Deterministic; allocates only to grow them. Not thread-safe
// for one `out`. `workers` null: the calling thread.
void Project(const FaceSource<float>& source, int width, int height, ScreenMeshBuffers* out,
             const FaceSetUp& faces = {}, const Workers* workers = nullptr);

// The requested gradients of the adjoint of Project.
struct ProjectGradients {
  std::span<float> d_positions;        // [V,3] overwritten; empty: not requested
  CameraT<float>* d_camera = nullptr;  // overwritten; null: not requested
};

// dL/d(ScreenMesh), vertex by vertex.
struct VertexGradients {
  std::span<const float> quads;     // [V][4] d_x, d_y, d_inverse_depth, unused
  std::span<const float> d_clip_t;  // as in ScreenGradients
};

// Scratch for meshes with clipped faces.
struct ProjectBackwardScratch {
  AlignedVector<CameraPoint<float>> points;
  AlignedVector<float> d_x, d_y, d_inverse_depth, d_clip_t;
};

// Adjoint of Project: from d_mesh to the source. Allocates only to grow `scratch`.
void ProjectBackward(const FaceSource<float>& source, const ScreenMesh& mesh,
                     const VertexGradients& d_mesh, ProjectBackwardScratch* scratch,
                     const ProjectGradients& out);

}  // namespace tilegrad::raster
