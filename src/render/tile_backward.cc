// SPDX-License-Identifier: Apache-2.0
#include "render/tile_backward.h"

#include <algorithm>
#include <cstddef>

#include "raster/fragments.h"
#include "raster/visibility_ref.h"
#include "render/frame_layout.h"
#include "render/quick_checks.h"

namespace tilegrad {
namespace {

// Faces of the screen mesh, from the ids of the caller's faces, in rows of a mesh that was cut.
void FindPieces(const raster::ScreenMesh& mesh, int row_begin, std::span<const std::int32_t> ids,
                AlignedVector<std::int32_t>* faces) {
  faces->resize(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto width = static_cast<std::size_t>(mesh.width);
    (*faces)[i] = raster::PieceAt(mesh, ids[i], static_cast<int>(i % width),
                                  row_begin + static_cast<int>(i / width));
  }
}

// Where a band lies in the batch.
struct BandPlace {
  int row_begin, row_end;
  std::size_t plane;         // pixels of an image
  std::size_t first, count;  // its pixels in an image
  std::size_t image;

  BandPlace(const BandGrid& bands, const BandTask& task)
      : row_begin(static_cast<int>(task.band) * bands.rows),
        row_end(std::min(row_begin + bands.rows, bands.height)),
        plane(static_cast<std::size_t>(bands.width) * static_cast<std::size_t>(bands.height)),
        first(static_cast<std::size_t>(row_begin) * static_cast<std::size_t>(bands.width)),
        count(static_cast<std::size_t>(row_end - row_begin) *
              static_cast<std::size_t>(bands.width)),
        image(task.image) {}

  // The band's pixels of plane c of an image of `planes` planes.
  template <class T>
  std::span<const T> Of(std::span<const T> batch, std::size_t planes, std::size_t c) const {
    return batch.subspan((image * planes + c) * plane + first, count);
  }
};

bool IsSoundBand(const BackwardInput& input, const raster::ScreenMesh& mesh, std::size_t channels,
                 const BandPlace& place) {
  const std::span<const std::int32_t> ids(input.frame.face_ids);
  if (!AllWithin(place.Of(ids, 1, 0), raster::kNoFace, mesh.source_faces)) return false;
  const FrameGradients& d_frame = input.d_frame;
  if (!d_frame.alpha.empty() && !AllFinite(place.Of(d_frame.alpha, 1, 0))) return false;
  for (std::size_t c = 0; c < channels && !d_frame.attributes.empty(); ++c) {
    if (!AllFinite(place.Of(d_frame.attributes, channels, c))) return false;
  }
  return true;
}

}  // namespace

bool RenderBandBackward(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                        const raster::BackwardRequest& request, WorkerScratch* worker,
                        BandGradients* out) {
  const BandGrid bands(input.options.width, input.options.height);
  const BandPlace place(bands, task);
  const auto channels = static_cast<std::size_t>(image.attributes.channels);
  out->faces.clear();
  if (!IsSoundBand(input, image.mesh, channels, place)) return false;
  if (input.d_frame.attributes.empty() || !(request.geometry || request.attributes)) return true;
  ++worker->stats.interpolated;
  raster::BandSums* const sums = &worker->band;
  auto ids = place.Of(std::span<const std::int32_t>(input.frame.face_ids), 1, 0);
  if (image.mesh.was_clipped()) {
    FindPieces(image.mesh, place.row_begin, ids, &out->pieces);
    ids = out->pieces;
  }
  const raster::InterpolateInput interpolate{&image.mesh, image.attributes,
                                             input.options.interpolation, false};
  raster::SumBand(interpolate,
                  {{ids.data(), bands.width, 0, place.row_begin, place.row_end},
                   {place.Of(input.d_frame.attributes, channels, 0).data(),
                    static_cast<std::ptrdiff_t>(place.plane), bands.width}},
                  sums);
  if (sums->faces() == 0) return true;
  out->stride = sums->stride();
  out->faces.assign(sums->face.data() + 1, sums->face.data() + sums->count);
  const std::size_t arrays = raster::FaceGradientArrays(image.attributes.channels, request);
  const std::size_t numbers = 4 * arrays * out->stride;
  if (out->values.size() < numbers) out->values.resize(numbers);
  raster::FinishBand(interpolate, *sums, request, out->values);
  return true;
}

void RenderBinBackward(const BackwardInput& input, const ImageScratch& image, const TileTask& bin,
                       WorkerScratch* worker, BinGradients* out) {
  const raster::TileGrid tiles(input.options.width, input.options.height);
  const std::size_t pixels =
      static_cast<std::size_t>(tiles.width) * static_cast<std::size_t>(tiles.height);
  const auto part = [&](auto batch) { return batch.subspan(bin.image * pixels, pixels); };
  const raster::SoftMaskAdjoint adjoint{part(std::span<const float>(input.frame.alpha)),
                                        part(input.d_frame.alpha)};
  out->clear();
  ++worker->stats.softened;
  for (int y = bin.rect.y0; y < bin.rect.y1; y += raster::kTileSize) {
    for (int x = bin.rect.x0; x < bin.rect.x1; x += raster::kTileSize) {
      const raster::SoftMaskTile tile{tiles.rect(tiles.tile(x, y)),
                                      part(std::span<const std::int32_t>(input.frame.face_ids))};
      raster::SoftMaskBackward(image.soft, image.soft_plan, tile, adjoint, out, &worker->soft);
    }
  }
}

}  // namespace tilegrad
