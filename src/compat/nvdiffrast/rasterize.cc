// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/rasterize.h"

#include <algorithm>
#include <vector>

#include "compat/nvdiffrast/barycentrics_ref.h"
#include "compat/nvdiffrast/clip_screen.h"
#include "compat/nvdiffrast/rasterize_input.h"
#include "raster/bin.h"
#include "raster/drawn_faces.h"
#include "raster/fragments.h"
#include "raster/visibility.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

template <class T>
void WritePixel(const Barycentrics<double>& b, std::int32_t face, T* rast, T* rast_db) {
  const double u = std::clamp(b.u, 0.0, 1.0);
  rast[0] = static_cast<T>(u);
  rast[1] = static_cast<T>(std::clamp(b.v, 0.0, 1.0 - u));
  rast[2] = static_cast<T>(std::clamp(b.depth, -1.0, 1.0));
  rast[3] = static_cast<T>(face + 1);
  if (rast_db == nullptr) return;
  const double slopes[4] = {b.du_dx, b.du_dy, b.dv_dx, b.dv_dy};
  for (int i = 0; i < 4; ++i) rast_db[i] = static_cast<T>(slopes[i]);
}

// An image made ready for its bins.
struct PreparedImage {
  ClipScreen screen;
  raster::DrawnFaces drawn;
  raster::BinListBuffers lists;
};

template <class T>
void Prepare(const RasterizeInput<T>& input, std::size_t image, const Workers* workers,
             PreparedImage* out) {
  FaceRange range{0, input.faces.size() / 3};
  if (!input.ranges.empty()) {
    range = {static_cast<std::size_t>(input.ranges[2 * image]),
             static_cast<std::size_t>(input.ranges[2 * image + 1])};
  }
  MakeClipScreen(input.positions, input.faces, range, image, input.grid, &out->screen);
  raster::ScreenMeshBuffers& mesh = out->screen.mesh;
  raster::SetUpFaces(mesh.View(), /*cull_back=*/false, mesh.reject, {.drawn = &out->drawn},
                     workers);
  raster::BinDrawnFaces(out->drawn, raster::BinGrid(input.grid.width, input.grid.height),
                        &out->lists, workers);
}

// A bin of an image: what is seen in it, and where it stands.
struct DrawnBin {
  std::size_t image;
  raster::PixelRect rect;
  const raster::ScreenMesh& mesh;
  const raster::VisibilityBin& seen;
};

template <class T>
void WriteBin(const RasterizeInput<T>& input, const DrawnBin& bin, const RasterizeOutput<T>& out) {
  const PixelSize size = SizeOf(input.grid);
  LastFace<T> corners(input, bin.image);
  for (int y = bin.rect.y0; y < bin.rect.y1; ++y) {
    const std::size_t row = input.grid.first(bin.image, y);
    for (int x = bin.rect.x0; x < bin.rect.x1; ++x) {
      const std::size_t pixel = row + static_cast<std::size_t>(x);
      const int at = (y - bin.rect.y0) * raster::kBinSize + x - bin.rect.x0;
      T* rast = &out.rast[4 * pixel];
      T* rast_db = out.rast_db.empty() ? nullptr : &out.rast_db[4 * pixel];
      if (!out.peeled.empty()) out.peeled[pixel] = bin.seen.inverse_depth[at];
      if (bin.seen.face[at] == raster::kNoFace) {
        std::fill(rast, rast + 4, T(0));
        if (rast_db != nullptr) std::fill(rast_db, rast_db + 4, T(0));
        continue;
      }
      const std::int32_t face = bin.mesh.source_face[static_cast<std::size_t>(bin.seen.face[at])];
      WritePixel(BarycentricsAt(corners(face), CentreOf(input.grid, x, y), size), face, rast,
                 rast_db);
    }
  }
}

// What a worker needs to draw a bin.
struct BinScratch {
  raster::VisibilityBin seen;
  alignas(128) float behind[raster::kBinSize * raster::kBinSize];
};

// From the rows of an image to those of a bin; the rest of the bin is never looked at.
void LoadPeeled(const float* peeled, std::size_t row, const raster::PixelRect& rect,
                float* behind) {
  std::fill(behind, behind + raster::kBinSize * raster::kBinSize, 0.0f);
  for (int y = rect.y0; y < rect.y1; ++y, behind += raster::kBinSize) {
    const float* from = peeled + static_cast<std::size_t>(y) * row;
    std::copy(from + rect.x0, from + rect.x1, behind);
  }
}

template <class T>
void DrawBin(const RasterizeInput<T>& input, const PreparedImage& image, std::size_t n,
             std::size_t bin, BinScratch* scratch, const RasterizeOutput<T>& out) {
  const raster::PixelRect rect = raster::BinGrid(input.grid.width, input.grid.height).rect(bin);
  const raster::ScreenMesh mesh = image.screen.mesh.View();
  const raster::BinDrawList list{image.drawn.storage, image.lists.View()[bin]};
  if (out.peeled.empty()) {
    raster::ComputeVisibility(mesh, list, rect, &scratch->seen);
  } else {
    LoadPeeled(&out.peeled[input.grid.first(n, 0)], input.grid.row(), rect, scratch->behind);
    raster::PeelVisibility(mesh, list, rect, scratch->behind, &scratch->seen);
  }
  WriteBin(input, {n, rect, mesh, scratch->seen}, out);
}

}  // namespace

struct Rasterizer::Scratch {
  std::vector<PreparedImage> images;
  std::vector<std::unique_ptr<BinScratch>> bins;  // of workers
};

Rasterizer::Rasterizer() : scratch_(std::make_unique<Scratch>()) {}
Rasterizer::~Rasterizer() = default;

template <class T>
Status Rasterizer::Run(const RasterizeInput<T>& input, const Workers& workers,
                       const RasterizeOutput<T>& out) {
  TILEGRAD_TRY(CheckInput(input));
  const std::size_t n = input.grid.images;
  auto& images = scratch_->images;
  auto& bins = scratch_->bins;
  if (images.size() < n) images.resize(n);
  while (bins.size() < static_cast<std::size_t>(workers.count())) {
    bins.push_back(std::make_unique<BinScratch>());
  }
  if (n == 1) {
    Prepare(input, 0, &workers, &images[0]);
  } else {
    workers.For(n, [&](std::size_t i, std::size_t) { Prepare(input, i, nullptr, &images[i]); });
  }
  const std::size_t count = raster::BinGrid(input.grid.width, input.grid.height).cells();
  workers.For(n * count, [&](std::size_t task, std::size_t worker) {
    const std::size_t image = task / count;
    DrawBin(input, images[image], image, task % count, bins[worker].get(), out);
  });
  return {};
}

template Status Rasterizer::Run(const RasterizeInput<float>&, const Workers&,
                                const RasterizeOutput<float>&);
template Status Rasterizer::Run(const RasterizeInput<double>&, const Workers&,
                                const RasterizeOutput<double>&);

}  // namespace tilegrad::compat::nvdiffrast
