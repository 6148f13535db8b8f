// SPDX-License-Identifier: Apache-2.0
#include "render/tile_forward.h"

#include <algorithm>
#include <cstddef>
#include <limits>

#include "raster/fragments.h"
#include "render/frame_layout.h"

namespace tilegrad {
namespace {

// Calls visit(index in the bin's arrays, index in an image) for each pixel of the bin.
template <class Visit>
void ForEachPixel(const raster::TileRect& rect, int width, const Visit& visit) {
  for (int i = rect.y0; i < rect.y1; ++i) {
    for (int j = rect.x0; j < rect.x1; ++j) {
      visit(static_cast<std::size_t>((i - rect.y0) * raster::kBinSize + j - rect.x0),
            static_cast<std::size_t>(i) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(j));
    }
  }
}

void WriteFaceIds(const raster::ScreenMesh& mesh, const raster::TileRect& rect,
                  const std::int32_t* faces, std::int32_t* ids) {
  if (!mesh.was_clipped()) {
    for (int i = rect.y0; i < rect.y1; ++i, faces += raster::kBinSize) {
      std::copy(faces, faces + rect.x1 - rect.x0,
                ids + static_cast<std::ptrdiff_t>(i) * mesh.width + rect.x0);
    }
    return;
  }
  ForEachPixel(rect, mesh.width, [&](std::size_t from, std::size_t to) {
    const std::int32_t face = faces[from];
    ids[to] = face >= 0 ? mesh.source_face[static_cast<std::size_t>(face)] : face;
  });
}

void WriteDepth(const raster::TileRect& rect, int width, const float* inverse, float* depth) {
  ForEachPixel(rect, width, [&](std::size_t from, std::size_t to) {
    depth[to] = inverse[from] > 0 ? 1.0f / inverse[from] : std::numeric_limits<float>::infinity();
  });
}

// Turns the weights of a cut piece's corners into those of its source face.
void MixCutWeights(const SceneView& scene, const raster::ScreenMesh& mesh,
                   const raster::TileRect& rect, const std::int32_t* faces, float* w1, float* w2) {
  ForEachPixel(rect, mesh.width, [&](std::size_t from, std::size_t to) {
    if (faces[from] == raster::kNoFace) return;
    const float piece[3] = {1 - w1[to] - w2[to], w1[to], w2[to]};
    float source[3];
    raster::SourceWeights<float>(mesh, scene.faces, static_cast<std::size_t>(faces[from]), piece,
                                 source);
    w1[to] = source[1], w2[to] = source[2];
  });
}

// The images of one scene within a batch.
struct ImageOfFrame {
  std::size_t pixels, channels, n;
  template <class T>
  T* plane(AlignedVector<T>& batch, std::size_t planes) const {
    return batch.empty() ? nullptr : batch.data() + n * planes * pixels;
  }
};

void InterpolateIntoFrame(const SceneView& scene, const RenderOptions& options,
                          const ImageScratch& image, const TileTask& task, const ImageOfFrame& part,
                          WorkerScratch* worker, Frame* frame) {
  const auto row = static_cast<std::ptrdiff_t>(options.width);
  const std::ptrdiff_t corner = task.rect.y0 * row + task.rect.x0;
  const auto plane = static_cast<std::ptrdiff_t>(part.pixels);
  float* attributes = part.plane(frame->attributes, part.channels);
  float* barycentrics = part.plane(frame->barycentrics, 2);
  raster::InterpolateInput input{&image.mesh, image.attributes, options.interpolation,
                                 barycentrics != nullptr};
  if (attributes == nullptr) input.attributes.channels = 0;
  ++worker->stats.interpolated;
  const raster::TileRect& rect = task.rect;
  raster::Interpolate(input, {worker->bin.face, raster::kBinSize, rect.x0, rect.y0, rect.y1},
                      {{attributes == nullptr ? nullptr : attributes + corner, plane, row},
                       {barycentrics == nullptr ? nullptr : barycentrics + corner, plane, row},
                       rect.x1 - rect.x0},
                      &worker->interpolate);
  if (barycentrics != nullptr && image.mesh.was_clipped()) {
    MixCutWeights(scene, image.mesh, rect, worker->bin.face, barycentrics,
                  barycentrics + part.pixels);
  }
}

// Alpha of the tiles of a bin. Returns the error spent.
double SoftAlpha(const RenderOptions& options, const ImageScratch& image, const TileTask& task,
                 const ImageOfFrame& part, WorkerScratch* worker, Frame* frame) {
  const std::span<const std::int32_t> ids(part.plane(frame->face_ids, 1), part.pixels);
  const std::span<float> alpha(part.plane(frame->alpha, 1), part.pixels);
  const raster::TileGrid tiles(options.width, options.height);
  double spent = 0;
  ++worker->stats.softened;
  for (int y = task.rect.y0; y < task.rect.y1; y += raster::kTileSize) {
    for (int x = task.rect.x0; x < task.rect.x1; x += raster::kTileSize) {
      const raster::SoftMaskTile tile{tiles.rect(tiles.tile(x, y)), ids};
      spent = std::max(
          spent, raster::SoftMaskForward(image.soft, image.soft_plan, tile, alpha, &worker->soft));
    }
  }
  return spent;
}

}  // namespace

double RenderBin(const SceneView& scene, const RenderOptions& options, const ImageScratch& image,
                 const TileTask& task, WorkerScratch* worker, Frame* frame) {
  ++worker->stats.drawn;
  raster::ComputeVisibility(image.mesh, {image.drawn_faces.storage, image.drawn[task.tile]},
                            task.rect, &worker->bin);
  const ImageOfFrame part{
      static_cast<std::size_t>(frame->width) * static_cast<std::size_t>(frame->height),
      static_cast<std::size_t>(frame->channels), task.image};
  WriteFaceIds(image.mesh, task.rect, worker->bin.face, part.plane(frame->face_ids, 1));
  if (float* depth = part.plane(frame->depth, 1)) {
    WriteDepth(task.rect, options.width, worker->bin.inverse_depth, depth);
  }
  if (!frame->attributes.empty() || !frame->barycentrics.empty()) {
    InterpolateIntoFrame(scene, options, image, task, part, worker, frame);
  }
  return frame->alpha.empty() ? 0 : SoftAlpha(options, image, task, part, worker, frame);
}

}  // namespace tilegrad
