// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/rasterize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "base/aligned.h"
#include "base/error.h"
#include "base/inline_vector.h"
#include "base/scalar.h"
#include "compat/nvdiffrast/barycentrics.h"
#include "compat/nvdiffrast/barycentrics_ref.h"
#include "compat/nvdiffrast/rasterize_input.h"
#include "raster/bin.h"
#include "raster/conventions.h"
#include "raster/drawn_faces.h"
#include "raster/screen_mesh.h"
#include "raster/visibility.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

// Converts faces in clip space to a screen mesh of the engine's rasterizer (raster/screen_mesh.h),
// which computes visibility.
//
// Clips faces to the planes -w <= z <= w, and to a guard band far outside of the image on each
// side, so that the rest has w > 0 and coordinates of at most raster::kGuardBand. The cut of an
// edge depends on its two ends only, so faces that share it stay together. Row 0 of the screen is
// row 0 of the image, the bottom. 1 - z/w replaces 1/depth: also linear on the screen, and larger
// where it is nearer.

// Faces [first, first + count).
struct FaceRange {
  std::size_t first, count;
};

// Reused from frame to frame.
struct ClipScreen {
  raster::ScreenMeshBuffers mesh;
  AlignedVector<std::uint8_t> outside;  // of each vertex: planes that it lies beyond
};

constexpr int kPlanes = 6;  // near, far, left, right, below, above
constexpr std::size_t kMostCorners = 3 + kPlanes;
// 1 - z/w on the far plane: visible, but behind everything else.
constexpr double kFarthest = 1e-30;

struct ClipPoint {
  double x, y, z, w;
};

// Signed distances to the planes, negative outside.
struct Frustum {
  double guard_x, guard_y;  // |x| <= guard_x * w

  Frustum(int width, int height)
      : guard_x(2.0 * raster::kGuardBand / width - 1.0),
        guard_y(2.0 * raster::kGuardBand / height - 1.0) {}

  double Distance(const ClipPoint& p, int plane) const {
    switch (plane) {
      case 0:
        return p.w + p.z;
      case 1:
        return p.w - p.z;
      case 2:
        return guard_x * p.w + p.x;
      case 3:
        return guard_x * p.w - p.x;
      case 4:
        return guard_y * p.w + p.y;
      default:
        return guard_y * p.w - p.y;
    }
  }
  std::uint8_t Outside(const ClipPoint& p) const {
    std::uint8_t bits = 0;
    for (int plane = 0; plane < kPlanes; ++plane) {
      bits = static_cast<std::uint8_t>(bits | (Distance(p, plane) < 0) << plane);
    }
    return bits;
  }
};

using Polygon = InlineVector<ClipPoint, kMostCorners>;

// The intersection of the edge from `a`, inside, to `b`, outside, with a plane: in this order
// whatever the face's winding, so that both faces of an edge get the same point.
ClipPoint Cut(const ClipPoint& a, const ClipPoint& b, double da, double db) {
  const double t = da / (da - db);
  return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z),
          a.w + t * (b.w - a.w)};
}

void CutPolygon(const Frustum& frustum, int plane, Polygon* polygon) {
  const Polygon from = *polygon;
  polygon->clear();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const ClipPoint& a = from[i];
    const ClipPoint& b = from[i + 1 < from.size() ? i + 1 : 0];
    const double da = frustum.Distance(a, plane), db = frustum.Distance(b, plane);
    if (da >= 0) polygon->push_back(a);
    if (da >= 0 && db < 0) polygon->push_back(Cut(a, b, da, db));
    if (da < 0 && db >= 0) polygon->push_back(Cut(b, a, db, da));
  }
}

// By x, then y, z and w.
std::size_t LeastCorner(const Polygon& polygon) {
  const auto key = [](const ClipPoint& p) { return std::tie(p.x, p.y, p.z, p.w); };
  std::size_t least = 0;
  for (std::size_t i = 1; i < polygon.size(); ++i) {
    if (key(polygon[i]) < key(polygon[least])) least = i;
  }
  return least;
}

// Fills the arrays of a screen mesh.
class ScreenWriter {
 public:
  ScreenWriter(const PixelGrid& grid, raster::ScreenMeshBuffers* out)
      : half_width_(0.5 * grid.width), half_height_(0.5 * grid.height), out_(*out) {}

  raster::PackedVertexT<float> Project(const ClipPoint& p) const {
    if (!(p.w > 0)) return {0, 0, 0, 0};
    const double near = std::max((p.w - p.z) / p.w, kFarthest);
    return {static_cast<float>((p.x / p.w + 1) * half_width_),
            static_cast<float>((p.y / p.w + 1) * half_height_), static_cast<float>(near), 0};
  }
  std::int32_t Append(const ClipPoint& p) {
    out_.packed.push_back(Project(p));
    return static_cast<std::int32_t>(out_.packed.size() - 1);
  }
  void AppendFace(std::int32_t a, std::int32_t b, std::int32_t c, std::size_t source) {
    out_.v0.push_back(a);
    out_.v1.push_back(b);
    out_.v2.push_back(c);
    out_.source_face.push_back(static_cast<std::int32_t>(source));
    out_.reject.push_back(raster::kFaceDrawn);
  }
  // Appends a clipped face as a fan from its least corner, so that coinciding faces get the same
  // pieces, whatever their first corner and winding. Appends nothing if it has no area in front of
  // the eye.
  void AppendPolygon(const Polygon& polygon, std::size_t source) {
    for (const ClipPoint& p : polygon) {
      if (!(p.w > 0)) return;
    }
    std::array<std::int32_t, kMostCorners> v;
    const std::size_t count = polygon.size(), first = LeastCorner(polygon);
    for (std::size_t i = 0; i < count; ++i) v[i] = Append(polygon[(first + i) % count]);
    for (std::size_t i = 2; i < count; ++i) AppendFace(v[0], v[i - 1], v[i], source);
  }
  // The other arrays, from `packed`.
  void Unpack() {
    const std::size_t n = out_.packed.size();
    for (auto* array : {&out_.x, &out_.y, &out_.depth, &out_.inverse_depth}) array->resize(n);
    for (std::size_t v = 0; v < n; ++v) {
      const auto& p = out_.packed[v];
      out_.x[v] = p.x;
      out_.y[v] = p.y;
      out_.inverse_depth[v] = p.inverse_depth;
      out_.depth[v] = 0;
    }
  }

 private:
  double half_width_, half_height_;
  raster::ScreenMeshBuffers& out_;
};

template <class T>
ClipPoint PointAt(const VertexRows<T>& positions, std::size_t image, std::int32_t vertex) {
  const T* p = positions.at(image, vertex);
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]),
          static_cast<double>(p[3])};
}

void Clear(const PixelGrid& grid, ClipScreen* out) {
  raster::ScreenMeshBuffers& mesh = out->mesh;
  mesh.packed.clear();
  out->outside.clear();
  mesh.v0.clear();
  mesh.v1.clear();
  mesh.v2.clear();
  mesh.source_face.clear();
  mesh.reject.clear();
  mesh.clipped.clear();
  mesh.width = grid.width;
  mesh.height = grid.height;
}

// The planes beyond which all corners, or any, lie.
struct Beyond {
  std::uint8_t all = 0xff, any = 0;
};
Beyond BeyondOf(const AlignedVector<std::uint8_t>& outside, const std::int32_t (&v)[3]) {
  Beyond out;
  for (const std::int32_t vertex : v) {
    const std::uint8_t code = outside[static_cast<std::size_t>(vertex)];
    out.all &= code;
    out.any |= code;
  }
  return out;
}

Polygon CutFace(const Frustum& frustum, const ClipPoint (&corners)[3], std::uint8_t planes) {
  Polygon polygon = {corners[0], corners[1], corners[2]};
  for (int plane = 0; plane < kPlanes; ++plane) {
    if ((planes >> plane & 1) != 0) CutPolygon(frustum, plane, &polygon);
  }
  return polygon;
}

// `source_face` of the mesh counts all of `faces`. Positions are finite and `faces` have been
// checked. Allocates only to grow `out`.
template <class T>
void MakeClipScreen(const VertexRows<T>& positions, FaceList faces, const FaceRange& range,
                    std::size_t image, const PixelGrid& grid, ClipScreen* out) {
  Clear(grid, out);
  const FaceList drawn = faces.subspan(3 * range.first, 3 * range.count);
  ScreenWriter writer(grid, &out->mesh);
  const Frustum frustum(grid.width, grid.height);
  // Of a batch that shares its vertices, an image has only some of them.
  const auto [low, high] = std::minmax_element(drawn.begin(), drawn.end());
  const std::int32_t first = drawn.empty() ? 0 : *low, end = drawn.empty() ? 0 : *high + 1;
  for (std::int32_t v = first; v < end; ++v) {
    const ClipPoint p = PointAt(positions, image, v);
    out->outside.push_back(frustum.Outside(p));
    writer.Append(p);
  }
  out->mesh.source_vertices = end - first;
  out->mesh.source_faces = static_cast<std::int32_t>(range.count);
  for (std::size_t f = 0; f < range.count; ++f) {
    const std::int32_t* ids = &drawn[3 * f];
    const std::int32_t v[3] = {ids[0] - first, ids[1] - first, ids[2] - first};
    const Beyond beyond = BeyondOf(out->outside, v);
    if (beyond.all != 0) continue;
    if (beyond.any == 0) {
      writer.AppendFace(v[0], v[1], v[2], range.first + f);
      continue;
    }
    const ClipPoint corners[3] = {PointAt(positions, image, ids[0]),
                                  PointAt(positions, image, ids[1]),
                                  PointAt(positions, image, ids[2])};
    writer.AppendPolygon(CutFace(frustum, corners, beyond.any), range.first + f);
  }
  writer.Unpack();
}

void WritePixel(const Barycentrics<double>& b, std::int32_t face, double* rast, double* rast_db) {
  rast[0] = std::clamp(b.u, 0.0, 1.0);
  rast[1] = std::clamp(b.v, 0.0, 1.0 - rast[0]);
  rast[2] = std::clamp(b.depth, -1.0, 1.0);
  rast[3] = face + 1;
  if (rast_db == nullptr) return;
  const double slopes[4] = {b.du_dx, b.du_dy, b.dv_dx, b.dv_dy};
  std::copy(slopes, slopes + 4, rast_db);
}

// An image prepared for its bins.
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

// A call of Rasterizer::Run.
template <class T>
struct Drawing {
  const RasterizeInput<T>& input;
  const RasterizeOutput<T>& out;
  PixelCentres centres;

  Drawing(const RasterizeInput<T>& in, const RasterizeOutput<T>& to)
      : input(in), out(to), centres(in.grid) {}
};

void WriteRow(const Drawing<float>& drawing, const BinRow& row) {
  WriteBarycentrics(drawing.input, drawing.centres, row, drawing.out);
}

void WriteRow(const Drawing<double>& drawing, const BinRow& row) {
  const RasterizeInput<double>& input = drawing.input;
  const RasterizeOutput<double>& out = drawing.out;
  const PixelSize size = SizeOf(input.grid);
  LastFace corners(input, row.image);
  std::size_t at = 4 * (input.grid.first(row.image, row.y) + static_cast<std::size_t>(row.x));
  for (std::size_t i = 0; i < row.count; ++i, at += 4) {
    double* rast = &out.rast[at];
    double* rast_db = out.rast_db.empty() ? nullptr : &out.rast_db[at];
    if (row.seen[i] == raster::kNoFace) {
      std::fill(rast, rast + 4, 0.0);
      if (rast_db != nullptr) std::fill(rast_db, rast_db + 4, 0.0);
      continue;
    }
    const std::int32_t face = row.source[static_cast<std::size_t>(row.seen[i])];
    const PixelCentre centre = CentreOf(input.grid, row.x + static_cast<int>(i), row.y);
    WritePixel(BarycentricsAt(corners(face), centre, size), face, rast, rast_db);
  }
}

// A bin of an image: its visible faces and position.
struct DrawnBin {
  std::size_t image;
  raster::PixelRect rect;
  const raster::ScreenMesh& mesh;
  const raster::VisibilityBin& seen;
};

template <class T>
void WriteBin(const Drawing<T>& drawing, const DrawnBin& bin) {
  const raster::PixelRect& rect = bin.rect;
  const auto count = static_cast<std::size_t>(rect.x1 - rect.x0);
  for (int y = rect.y0; y < rect.y1; ++y) {
    const int first = (y - rect.y0) * raster::kBinSize;
    WriteRow(drawing, {bin.image, rect.x0, y, count, bin.seen.face + first, bin.mesh.source_face});
    if (drawing.out.peeled.empty()) continue;
    const float* depth = bin.seen.inverse_depth + first;
    std::copy(
        depth, depth + count,
        &drawing.out
             .peeled[drawing.input.grid.first(bin.image, y) + static_cast<std::size_t>(rect.x0)]);
  }
}

// Scratch of a worker for drawing a bin.
struct BinScratch {
  raster::VisibilityBin seen;
  alignas(128) float behind[raster::kBinSize * raster::kBinSize];
};

// From the rows of an image to those of a bin; the rest of the bin is never read.
void LoadPeeled(const float* peeled, std::size_t row, const raster::PixelRect& rect,
                float* behind) {
  std::fill(behind, behind + raster::kBinSize * raster::kBinSize, 0.0f);
  for (int y = rect.y0; y < rect.y1; ++y, behind += raster::kBinSize) {
    const float* from = peeled + static_cast<std::size_t>(y) * row;
    std::copy(from + rect.x0, from + rect.x1, behind);
  }
}

template <class T>
void DrawBin(const Drawing<T>& drawing, const PreparedImage& image, std::size_t n, std::size_t bin,
             BinScratch* scratch) {
  const PixelGrid& grid = drawing.input.grid;
  const raster::PixelRect rect = raster::BinGrid(grid.width, grid.height).rect(bin);
  const raster::ScreenMesh mesh = image.screen.mesh.View();
  const raster::BinDrawList list{image.drawn.storage, image.lists.View()[bin]};
  if (drawing.out.peeled.empty()) {
    raster::ComputeVisibility(mesh, list, rect, &scratch->seen);
  } else {
    LoadPeeled(&drawing.out.peeled[grid.first(n, 0)], grid.row(), rect, scratch->behind);
    raster::PeelVisibility(mesh, list, rect, scratch->behind, &scratch->seen);
  }
  WriteBin(drawing, {n, rect, mesh, scratch->seen});
}

template <class T>
Status CheckFinite(const VertexRows<T>& positions) {
  for (std::size_t i = 0; i < positions.values.size(); ++i) {
    if (std::isfinite(positions.values[i])) continue;
    return InvalidArgument("position {} of vertex {} is {}", i % 4, i / 4, positions.values[i]);
  }
  return {};
}

Status CheckRanges(std::span<const std::int32_t> ranges, std::size_t faces) {
  for (std::size_t n = 0; n < ranges.size() / 2; ++n) {
    const std::int64_t first = ranges[2 * n], count = ranges[2 * n + 1];
    if (first >= 0 && count >= 0 && first + count <= static_cast<std::int64_t>(faces)) continue;
    return InvalidArgument("range {} is {} faces from {} on, but there are {} faces", n, count,
                           first, faces);
  }
  return {};
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
  while (bins.size() < workers.size()) {
    bins.push_back(std::make_unique<BinScratch>());
  }
  if (n == 1) {
    Prepare(input, 0, &workers, &images[0]);
  } else {
    workers.For(n, [&](std::size_t i) { Prepare(input, i, nullptr, &images[i]); });
  }
  const Drawing<T> drawing(input, out);
  const std::size_t count = raster::BinGrid(input.grid.width, input.grid.height).cells();
  workers.For(n * count, [&](std::size_t task, std::size_t worker) {
    const std::size_t image = task / count;
    DrawBin(drawing, images[image], image, task % count, bins[worker].get());
  });
  return {};
}

template Status Rasterizer::Run(const RasterizeInput<float>&, const Workers&,
                                const RasterizeOutput<float>&);
template Status Rasterizer::Run(const RasterizeInput<double>&, const Workers&,
                                const RasterizeOutput<double>&);

template <class T>
Status CheckInput(const RasterizeInput<T>& input) {
  const std::size_t faces = input.faces.size() / 3;
  if (faces > kMostFaces) {
    return InvalidArgument("{} faces; float holds the ids of at most {}", faces, kMostFaces);
  }
  const PixelGrid& grid = input.grid;
  if (grid.width < 1 || grid.height < 1 || grid.width > raster::kMaxImageSize ||
      grid.height > raster::kMaxImageSize) {
    return InvalidArgument("images are {} x {} pixels, but must be 1 to {} high and wide",
                           grid.height, grid.width, raster::kMaxImageSize);
  }
  TILEGRAD_TRY(CheckRanges(input.ranges, faces));
  TILEGRAD_TRY(CheckFaces(input.faces, input.positions.vertices));
  return CheckFinite(input.positions);
}

template Status CheckInput(const RasterizeInput<float>&);
template Status CheckInput(const RasterizeInput<double>&);

}  // namespace tilegrad::compat::nvdiffrast
