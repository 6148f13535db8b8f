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

FaceGradientBlock SoftBlock(const RenderOptions& options, const ImageScratch& image,
                            const TileTask& task, const Frame& frame,
                            std::span<const float> d_alpha, WorkerScratch* worker) {
  const auto near = image.soft[task.tile];
  const FaceGradientBlock block = AppendBlock(near, near.size(), 6, worker);
  float* d_faces = worker->gradient_values.data() + block.value_begin;
  std::fill(d_faces, d_faces + 6 * block.stride, 0.0f);
  const std::size_t plane =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  for (int i = task.rect.y0; i < task.rect.y1; ++i) {
    for (int j = task.rect.x0; j < task.rect.x1; ++j) {
      const std::size_t at = task.image * plane + static_cast<std::size_t>(i * options.width + j);
      if (frame.face_ids[at] != raster::kNoFace || frame.alpha[at] == 0) continue;
      raster::SoftAlphaRefBackward<float>(image.mesh, near, static_cast<float>(j) + 0.5f,
                                          static_cast<float>(i) + 0.5f, SoftSettings(options).scale,
                                          d_alpha[at],
                                          [&](std::size_t n, int corner, float d_x, float d_y) {
                                            const auto k = static_cast<std::size_t>(corner);
                                            d_faces[k * block.stride + n] += d_x;
                                            d_faces[(3 + k) * block.stride + n] += d_y;
                                          });
    }
  }
  return block;
}

// Adds the arrays [first, first + 3) of a block to a per-vertex gradient.
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
    out.soft = SoftBlock(options, image, task, frame, d_frame.alpha, worker);
  }
  return out;
}

void MergeTileGradients(const ImageScratch& image, std::span<const TileGradients> tiles,
                        std::span<const WorkerScratch> workers, std::span<float> d_attributes,
                        const raster::ScreenGradients& d_mesh) {
  for (const TileGradients& tile : tiles) {
    const WorkerScratch& worker = workers[tile.worker];
    for (const FaceGradientBlock* block : {&tile.interpolated, &tile.soft}) {
      if (block->count == 0) continue;
      const auto faces = std::span(worker.gradient_faces).subspan(block->face_begin, block->count);
      const float* values = worker.gradient_values.data() + block->value_begin;
      AddCorners(image.mesh, faces, values, block->stride, d_mesh.d_x);
      AddCorners(image.mesh, faces, values + 3 * block->stride, block->stride, d_mesh.d_y);
      if (block == &tile.soft) continue;
      AddCorners(image.mesh, faces, values + 6 * block->stride, block->stride,
                 d_mesh.d_inverse_depth);
      if (d_attributes.empty()) continue;
      AddAttributes(image, faces, values + 9 * block->stride, block->stride, d_attributes);
    }
  }
}

}  // namespace tilegrad
