// SPDX-License-Identifier: Apache-2.0
#include "render/tile_backward.h"

#include <algorithm>
#include <cstddef>

#include "raster/visibility_ref.h"
#include "render/frame_layout.h"

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

}  // namespace

void RenderBandBackward(const BackwardInput& input, const ImageScratch& image, std::size_t n,
                        std::size_t band, const raster::BackwardRequest& request,
                        raster::BandSums* sums, BandGradients* out) {
  const BandGrid bands(input.options.width, input.options.height);
  const auto row = static_cast<std::size_t>(bands.width);
  const std::size_t plane = row * static_cast<std::size_t>(bands.height);
  const auto channels = static_cast<std::size_t>(image.attributes.channels);
  const int row_begin = static_cast<int>(band) * bands.rows;
  const int row_end = std::min(row_begin + bands.rows, bands.height);
  const std::size_t first = static_cast<std::size_t>(row_begin) * row;
  auto ids = std::span(input.frame.face_ids)
                 .subspan(n * plane + first, static_cast<std::size_t>(row_end - row_begin) * row);
  if (image.mesh.was_clipped()) {
    FindPieces(image.mesh, row_begin, ids, &out->pieces);
    ids = out->pieces;
  }
  const raster::InterpolateInput interpolate{&image.mesh, image.attributes,
                                             input.options.interpolation, false};
  raster::SumBand(interpolate,
                  {bands.width,
                   row_begin,
                   row_end,
                   ids.data(),
                   {input.d_frame.attributes.data() + n * channels * plane + first,
                    static_cast<std::ptrdiff_t>(plane), static_cast<std::ptrdiff_t>(row)}},
                  sums);
  out->stride = sums->stride();
  out->faces.assign(sums->face.data() + 1, sums->face.data() + sums->count);
  if (out->faces.empty()) return;
  const std::size_t arrays = raster::FaceGradientArrays(image.attributes.channels, request);
  const std::size_t numbers = 4 * arrays * out->stride;
  if (out->values.size() < numbers) out->values.resize(numbers);
  raster::FinishBand(interpolate, *sums, request, out->values);
}

void RenderBinBackward(const BackwardInput& input, const ImageScratch& image, const TileTask& bin,
                       raster::SoftMaskScratch* scratch, BinGradients* out) {
  const raster::TileGrid tiles(input.options.width, input.options.height);
  const std::size_t pixels =
      static_cast<std::size_t>(tiles.width) * static_cast<std::size_t>(tiles.height);
  const auto part = [&](auto batch) { return batch.subspan(bin.image * pixels, pixels); };
  out->tiles.clear();
  std::size_t end = 0;
  for (int y = bin.rect.y0; y < bin.rect.y1; y += raster::kTileSize) {
    for (int x = bin.rect.x0; x < bin.rect.x1; x += raster::kTileSize) {
      const std::size_t t = tiles.tile(x, y);
      if (image.soft[t].empty()) continue;
      const auto tile = SoftTileOf(image, {bin.image, t, tiles.rect(t)},
                                   part(std::span<const std::int32_t>(input.frame.face_ids)));
      const std::size_t begin = end;
      end += 6 * tile.faces.size();
      if (out->values.size() < end) out->values.resize(end);
      raster::SoftMaskBackward(image.mesh, image.soft_plan, tile, part(input.d_frame.alpha),
                               std::span(out->values).subspan(begin, end - begin), scratch);
      out->tiles.push_back({tile.faces, begin});
    }
  }
}

}  // namespace tilegrad
