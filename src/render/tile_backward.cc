// SPDX-License-Identifier: Apache-2.0
#include "render/tile_backward.h"

#include <algorithm>
#include <cstddef>

#include "raster/fragments.h"
#include "raster/visibility_ref.h"
#include "render/frame_layout.h"

namespace tilegrad {
namespace {

// Faces of the screen mesh, from the ids of the caller's faces.
bool LoadTileFaces(const raster::ScreenMesh& mesh, const raster::TileRect& rect,
                   const std::int32_t* ids, std::int32_t* faces) {
  std::fill(faces, faces + raster::kTilePixels, raster::kNoFace);
  bool any = false;
  for (int i = rect.y0; i < rect.y1; ++i) {
    std::int32_t* row = faces + (i - rect.y0) * raster::kTileSize;
    for (int j = rect.x0; j < rect.x1; ++j) {
      row[j - rect.x0] = raster::PieceAt(mesh, ids[i * mesh.width + j], j, i);
      any |= row[j - rect.x0] != raster::kNoFace;
    }
  }
  return any;
}

FaceGradientBlock AppendBlock(std::span<const std::int32_t> faces, std::size_t stride,
                              std::size_t arrays, WorkerScratch* worker) {
  auto& list = worker->gradient_faces;
  auto& values = worker->gradient_values;
  const FaceGradientBlock block{list.size(), values.size(), faces.size(), stride};
  list.insert(list.end(), faces.begin(), faces.end());
  values.resize(values.size() + arrays * stride);
  return block;
}

FaceGradientBlock InterpolatedBlock(const RenderOptions& options, const ImageScratch& image,
                                    const TileTask& task, std::span<const float> d_attributes,
                                    WorkerScratch* worker) {
  const raster::InterpolateInput input{&image.mesh, image.attributes, options.interpolation, false};
  const std::size_t row = static_cast<std::size_t>(options.width);
  const std::size_t plane = row * static_cast<std::size_t>(options.height);
  const auto channels = static_cast<std::size_t>(image.attributes.channels);
  const float* corner = d_attributes.data() + task.image * channels * plane +
                        static_cast<std::size_t>(task.rect.y0) * row +
                        static_cast<std::size_t>(task.rect.x0);
  raster::FindTileFaces(worker->visibility.face, task.rect, &worker->faces);
  raster::SetUpTilePlanes(input, worker->faces, &worker->planes);
  const auto count = static_cast<std::size_t>(worker->faces.count);
  constexpr std::size_t kStep = raster::kTileSize;
  const FaceGradientBlock block =
      AppendBlock({worker->faces.face, count}, (count + kStep - 1) / kStep * kStep,
                  raster::FaceGradientArrays(image.attributes.channels), worker);
  raster::InterpolateTileBackward(
      input, worker->faces, task.rect,
      {corner, static_cast<std::ptrdiff_t>(plane), static_cast<std::ptrdiff_t>(row)},
      &worker->planes, block.stride, worker->gradient_values.data() + block.value_begin);
  return block;
}

FaceGradientBlock SoftBlock(const ImageScratch& image, const TileTask& task, const Frame& frame,
                            std::span<const float> d_alpha, WorkerScratch* worker) {
  const std::size_t pixels =
      static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
  const auto part = [&](auto batch) { return batch.subspan(task.image * pixels, pixels); };
  const auto tile = SoftTileOf(image, task, part(std::span<const std::int32_t>(frame.face_ids)));
  const FaceGradientBlock block = AppendBlock(tile.faces, tile.faces.size(), 6, worker);
  raster::SoftMaskBackward(
      image.mesh, image.soft_plan, tile, part(d_alpha),
      std::span(worker->gradient_values).subspan(block.value_begin, 6 * block.stride),
      &worker->soft);
  return block;
}

// Adds three arrays, one per corner, to a per-vertex gradient.
void AddCorners(const raster::ScreenMesh& mesh, std::span<const std::int32_t> faces,
                const float* values, std::size_t stride, std::span<float> d_vertex) {
  for (std::size_t n = 0; n < faces.size(); ++n) {
    const auto f = static_cast<std::size_t>(faces[n]);
    for (int k = 0; k < 3; ++k) {
      d_vertex[static_cast<std::size_t>(mesh.vertex(f, k))] +=
          values[static_cast<std::size_t>(k) * stride + n];
    }
  }
}

void AddAttributes(const ImageScratch& image, std::span<const std::int32_t> faces,
                   const float* values, std::size_t stride, std::span<float> d_attributes) {
  const raster::AttributeViewT<float> to{d_attributes, image.attributes.channels,
                                         image.attributes.rate};
  const auto channels = static_cast<std::size_t>(to.channels);
  for (std::size_t n = 0; n < faces.size(); ++n) {
    for (int k = 0; k < 3; ++k) {
      float* corner = to.corner(image.mesh, static_cast<std::size_t>(faces[n]), k);
      const float* from = values + static_cast<std::size_t>(k) * channels * stride + n;
      for (std::size_t c = 0; c < channels; ++c) corner[c] += from[c * stride];
    }
  }
}

void MergeInterpolated(const ImageScratch& image, const FaceGradientBlock& block,
                       const WorkerScratch& worker, std::span<float> d_attributes,
                       const raster::ScreenGradients& d_mesh) {
  const auto faces = std::span(worker.gradient_faces).subspan(block.face_begin, block.count);
  const float* values = worker.gradient_values.data() + block.value_begin;
  AddCorners(image.mesh, faces, values, block.stride, d_mesh.d_x);
  AddCorners(image.mesh, faces, values + 3 * block.stride, block.stride, d_mesh.d_y);
  AddCorners(image.mesh, faces, values + 6 * block.stride, block.stride, d_mesh.d_inverse_depth);
  if (d_attributes.empty()) return;
  AddAttributes(image, faces, values + 9 * block.stride, block.stride, d_attributes);
}

void MergeSoft(const raster::ScreenMesh& mesh, const FaceGradientBlock& block,
               const WorkerScratch& worker, const raster::ScreenGradients& d_mesh) {
  const auto faces = std::span(worker.gradient_faces).subspan(block.face_begin, block.count);
  const float* values = worker.gradient_values.data() + block.value_begin;
  AddCorners(mesh, faces, values, block.stride, d_mesh.d_x);
  AddCorners(mesh, faces, values + 3 * block.stride, block.stride, d_mesh.d_y);
}

}  // namespace

TileGradients RenderTileBackward(const RenderOptions& options, const ImageScratch& image,
                                 const TileTask& task, const Frame& frame,
                                 const FrameGradients& d_frame, const BackwardRequest& request,
                                 std::size_t worker_index, WorkerScratch* worker) {
  TileGradients out;
  out.worker = worker_index;
  const std::size_t pixels =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  if (!d_frame.attributes.empty() && (request.geometry || request.attributes) &&
      LoadTileFaces(image.mesh, task.rect, frame.face_ids.data() + task.image * pixels,
                    worker->visibility.face)) {
    out.interpolated = InterpolatedBlock(options, image, task, d_frame.attributes, worker);
  }
  if (!d_frame.alpha.empty() && request.geometry && !image.soft[task.tile].empty()) {
    out.soft = SoftBlock(image, task, frame, d_frame.alpha, worker);
  }
  return out;
}

void MergeTileGradients(const ImageScratch& image, std::span<const TileGradients> tiles,
                        std::span<const WorkerScratch> workers, std::span<float> d_attributes,
                        const raster::ScreenGradients& d_mesh) {
  for (const TileGradients& tile : tiles) {
    const WorkerScratch& worker = workers[tile.worker];
    MergeInterpolated(image, tile.interpolated, worker, d_attributes, d_mesh);
    MergeSoft(image.mesh, tile.soft, worker, d_mesh);
  }
}

}  // namespace tilegrad
