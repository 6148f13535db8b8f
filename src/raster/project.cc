// SPDX-License-Identifier: Apache-2.0
#include "raster/project.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/project.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/project-inl.h"

#if HWY_ONCE
#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "raster/project_ref.h"

namespace tilegrad::raster {
namespace {

HWY_EXPORT(ProjectVertices);
HWY_EXPORT(SplitSomeFaces);
HWY_EXPORT(ProjectVerticesBackward);

constexpr std::size_t kVertexChunk = 8192;

// Vertices of the source, all arrays. Returns whether all are visible and finite.
bool ProjectSource(const FaceSource<float>& source, ScreenMeshBuffers* out,
                   const Workers* workers) {
  std::atomic<bool> plain = true;
  ForChunks(workers, source.positions.size() / 3, kVertexChunk,
            [&](std::size_t begin, std::size_t end) {
              if (!HWY_DYNAMIC_DISPATCH(ProjectVertices)(source, begin, end, out)) plain = false;
            });
  return plain;
}

// AssembleFaces for meshes whose vertices are all visible and finite, without its tests. Leaves
// rejection by shape to the caller.
void AssembleWholeFaces(const FaceSource<float>& source, ScreenMeshBuffers* out,
                        const Workers* workers) {
  if (source.corners == nullptr) SplitFaces(source.faces, out, workers);
  out->whole = source.corners;
  out->reject.assign(source.faces.size() / 3, kFaceDrawn);
  out->clipped.clear();
}

bool AllVisible(const ScreenMesh& mesh) {
  if (mesh.was_clipped()) return false;
  return std::all_of(mesh.inverse_depth.begin(), mesh.inverse_depth.end(),
                     [](float inverse) { return inverse > 0; });
}

ScreenGradients Deinterleave(const VertexGradients& d_mesh, ProjectBackwardScratch* scratch) {
  const std::size_t n = d_mesh.quads.size() / 4;
  AlignedVector<float>* const arrays[3] = {&scratch->d_x, &scratch->d_y, &scratch->d_inverse_depth};
  for (std::size_t k = 0; k < 3; ++k) {
    arrays[k]->resize(n);
    for (std::size_t v = 0; v < n; ++v) (*arrays[k])[v] = d_mesh.quads[4 * v + k];
  }
  scratch->d_clip_t.assign(d_mesh.d_clip_t.begin(), d_mesh.d_clip_t.end());
  return {scratch->d_x, scratch->d_y, scratch->d_inverse_depth, scratch->d_clip_t};
}

}  // namespace

void SplitFaces(std::span<const std::int32_t> faces, FaceCorners* out, const Workers* workers) {
  const std::size_t n = faces.size() / 3;
  for (auto* array : {&out->v0, &out->v1, &out->v2, &out->source_face}) array->resize(n);
  ForChunks(workers, n, DrawnFaces::kChunk, [&](std::size_t begin, std::size_t end) {
    HWY_DYNAMIC_DISPATCH(SplitSomeFaces)(faces, begin, end, out);
  });
}

void Project(const FaceSource<float>& source, int width, int height, ScreenMeshBuffers* out,
             const FaceSetUp& faces, const Workers* workers) {
  const std::size_t n = source.positions.size() / 3;
  for (auto* array : {&out->x, &out->y, &out->depth, &out->inverse_depth}) array->resize(n);
  out->packed.resize(n);
  out->source_vertices = static_cast<std::int32_t>(n);
  out->source_faces = static_cast<std::int32_t>(source.faces.size() / 3);
  out->width = width;
  out->height = height;
  if (ProjectSource(source, out, workers)) {
    AssembleWholeFaces(source, out, workers);
  } else {
    AssembleFaces(source, out);
    out->packed.resize(out->x.size());
    out->Pack(n, out->x.size());
  }
  SetUpFaces(out->View(), source.cull_back, out->reject, faces, workers);
}

void ProjectBackward(const FaceSource<float>& source, const ScreenMesh& mesh,
                     const VertexGradients& d_mesh, ProjectBackwardScratch* scratch,
                     const ProjectGradients& out) {
  if (AllVisible(mesh)) {
    HWY_DYNAMIC_DISPATCH(ProjectVerticesBackward)(source, d_mesh.quads, out);
    return;
  }
  CameraT<float> d_camera = ZeroCamera<float>();
  scratch->points.assign(static_cast<std::size_t>(mesh.source_vertices), {0, 0, 0});
  std::fill(out.d_positions.begin(), out.d_positions.end(), 0.0f);
  ProjectRefBackward<float>(source, mesh, Deinterleave(d_mesh, scratch), scratch->points,
                            out.d_positions, &d_camera);
  if (out.d_camera != nullptr) *out.d_camera = d_camera;
}

}  // namespace tilegrad::raster
#endif
