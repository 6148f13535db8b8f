// SPDX-License-Identifier: Apache-2.0
#include "compat/pytorch3d_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/error.h"
#include "base/scalar.h"
#include "compat/projected_batch.h"
#include "render/validate.h"

namespace tilegrad::compat::pytorch3d {
namespace {

constexpr std::size_t kBandRows = 16;
constexpr std::size_t kFacesPerTask = 64;
constexpr int kMostLayers = 1024;

// Centres of pixels: the shorter side spans [-1, 1], x to the left, y up.
template <class T>
struct Centres {
  std::size_t width, height;
  std::vector<T> x, y;

  explicit Centres(const ImageSize& size)
      : width(static_cast<std::size_t>(size.width)), height(static_cast<std::size_t>(size.height)) {
    const T shorter = T(std::min(size.width, size.height));
    for (int j = 0; j < size.width; ++j) x.push_back(T(size.width - 2 * j - 1) / shorter);
    for (int i = 0; i < size.height; ++i) y.push_back(T(size.height - 2 * i - 1) / shorter);
  }
};

// Indices of `falling` whose values are in [low, high].
struct IndexRange {
  std::size_t begin, end;
};
template <class T>
IndexRange Within(const std::vector<T>& falling, T low, T high) {
  const auto begin =
      std::partition_point(falling.begin(), falling.end(), [&](const T& v) { return v > high; });
  const auto end = std::partition_point(begin, falling.end(), [&](const T& v) { return v >= low; });
  return {static_cast<std::size_t>(begin - falling.begin()),
          static_cast<std::size_t>(end - falling.begin())};
}

// A pixel's lists of some rows, each by depth.
template <class T>
struct Lists {
  std::size_t layers;
  std::vector<T> z;
  std::vector<std::int64_t> face;
  std::vector<std::int32_t> count;

  void Reset(std::size_t pixels, std::size_t k) {
    layers = k;
    z.resize(pixels * k);
    face.resize(pixels * k);
    count.assign(pixels, 0);
  }
  // Faces come in index order, so a later one goes after its equals.
  void Insert(std::size_t pixel, std::int64_t id, const T& depth) {
    T* const begin = z.data() + pixel * layers;
    auto at = static_cast<std::size_t>(count[pixel]);
    if (at == layers) {
      if (!(depth < begin[layers - 1])) return;
      --at;
    } else {
      ++count[pixel];
    }
    std::int64_t* const ids = face.data() + pixel * layers;
    for (; at > 0 && depth < begin[at - 1]; --at) {
      begin[at] = begin[at - 1];
      ids[at] = ids[at - 1];
    }
    begin[at] = depth;
    ids[at] = id;
  }
};

// Rows [row, row_end) of an image.
struct Band {
  std::size_t row, row_end;
};

template <class T>
bool IsListed(const T* v, bool cull_backfaces) {
  if (std::min({v[2], v[5], v[8]}) < T(kFragmentEps)) return false;
  const T area = (v[6] - v[0]) * (v[4] - v[1]) - (v[7] - v[1]) * (v[3] - v[0]);
  if (cull_backfaces && area < 0) return false;
  return std::isfinite(area) && std::abs(area) > T(kFragmentEps);
}

template <class T>
void DrawFace(const T* v, std::int64_t id, const Centres<T>& centres, const LayeredOptions& options,
              const Band& band, Lists<T>* lists) {
  if (!IsListed(v, options.cull_backfaces)) return;
  const T radius = static_cast<T>(std::sqrt(options.blur_radius));
  const auto [left, right] = std::minmax({v[0], v[3], v[6]});
  const auto [bottom, top] = std::minmax({v[1], v[4], v[7]});
  const IndexRange rows = Within(centres.y, bottom - radius, top + radius);
  const std::size_t begin = std::max(rows.begin, band.row), end = std::min(rows.end, band.row_end);
  if (begin >= end) return;
  const IndexRange columns = Within(centres.x, left - radius, right + radius);
  for (std::size_t i = begin; i < end; ++i) {
    for (std::size_t j = columns.begin; j < columns.end; ++j) {
      const auto at = FragmentOf(v, centres.x[j], centres.y[i], options.rule);
      // Weights of a pixel outside of its face may overflow where the perspective divide flips
      // signs.
      if (!(at.z >= 0 && std::isfinite(at.z))) continue;
      if (!at.inside && !(at.dist < T(options.blur_radius))) continue;
      lists->Insert((i - band.row) * centres.width + j, id, at.z);
    }
  }
}

template <class T>
void WriteBand(std::span<const T> face_vertices, const Centres<T>& centres,
               const LayeredOptions& options, const Band& band, const Lists<T>& lists,
               std::size_t first_pixel, const LayeredImages<T>& out) {
  const std::size_t pixels = (band.row_end - band.row) * centres.width;
  for (std::size_t p = 0; p < pixels; ++p) {
    const T px = centres.x[p % centres.width], py = centres.y[band.row + p / centres.width];
    for (std::size_t k = 0; k < lists.layers; ++k) {
      const std::size_t to = (first_pixel + p) * lists.layers + k;
      const bool empty = k >= static_cast<std::size_t>(lists.count[p]);
      const std::int64_t id = empty ? -1 : lists.face[p * lists.layers + k];
      LayeredFragment<T> at{{T(-1), T(-1), T(-1)}, T(-1), T(-1), false};
      if (!empty) {
        at = FragmentOf(face_vertices.data() + 9 * id, px, py, options.rule);
      }
      out.pix_to_face[to] = id;
      out.zbuf[to] = at.z;
      out.dists[to] = at.dist;
      std::copy(at.bary.begin(), at.bary.end(), out.barycentrics.data() + 3 * to);
    }
  }
}

Status ValidateLayeredOptions(const LayeredOptions& options) {
  TILEGRAD_TRY(CheckImageSize("width", options.size.width));
  TILEGRAD_TRY(CheckImageSize("height", options.size.height));
  if (options.faces_per_pixel < 1 || options.faces_per_pixel > kMostLayers) {
    return InvalidArgument("faces_per_pixel is {}, must be in 1..{}", options.faces_per_pixel,
                           kMostLayers);
  }
  return CheckNotNegative("blur_radius", options.blur_radius);
}

template <class T>
Status ValidateFaces(std::span<const T> face_vertices) {
  if (face_vertices.size() % 9 != 0) {
    return InvalidArgument("face_vertices must be [F,3,3], got {} numbers", face_vertices.size());
  }
  return CheckFinite("face_vertices", face_vertices);
}

Status ValidateRanges(std::span<const FaceRange> images, std::size_t faces) {
  const auto end = static_cast<std::int64_t>(faces);
  for (std::size_t n = 0; n < images.size(); ++n) {
    const FaceRange& r = images[n];
    if (r.first < 0 || r.count < 0 || r.first > end || r.count > end - r.first) {
      return InvalidArgument("image {} has faces [{}, {} + {}), there are {}", n, r.first, r.first,
                             r.count, faces);
    }
  }
  return {};
}

template <class T>
Status ValidateLayeredAdjoint(std::span<const T> face_vertices, const LayeredOptions& options,
                              const LayeredAdjoint<T>& adjoint) {
  const std::size_t n = adjoint.pix_to_face.size();
  const std::size_t image =
      PixelCount(options.size) * static_cast<std::size_t>(options.faces_per_pixel);
  if (n % image != 0) {
    return InvalidArgument("pix_to_face has {} numbers, not a multiple of {}", n, image);
  }
  const auto faces = static_cast<std::int64_t>(face_vertices.size() / 9);
  for (std::size_t i = 0; i < n; ++i) {
    if (adjoint.pix_to_face[i] < -1 || adjoint.pix_to_face[i] >= faces) {
      return InvalidArgument("pix_to_face[{}] is {}, outside of [-1, {})", i,
                             adjoint.pix_to_face[i], faces);
    }
  }
  const auto check = [&](const char* name, std::span<const T> d, std::size_t size) {
    if (d.empty()) return Status();
    TILEGRAD_TRY(CheckSize(name, d.size(), size));
    return CheckFinite(name, d);
  };
  TILEGRAD_TRY(check("the gradient of zbuf", adjoint.d_zbuf, n));
  TILEGRAD_TRY(check("the gradient of bary_coords", adjoint.d_barycentrics, 3 * n));
  TILEGRAD_TRY(check("the gradient of dists", adjoint.d_dists, n));
  return CheckSize("d_face_vertices", adjoint.d_face_vertices.size(), face_vertices.size());
}

template <class T>
void AddFragment(const T* v, const Centres<T>& centres, const LayeredOptions& options,
                 std::size_t fragment, const LayeredAdjoint<T>& adjoint, T* d_v) {
  const auto at = [&](std::span<const T> d, std::size_t i) { return d.empty() ? T(0) : d[i]; };
  const std::size_t pixel = fragment / static_cast<std::size_t>(options.faces_per_pixel) %
                            (centres.width * centres.height);
  std::array<T, 3> d_bary;
  for (std::size_t k = 0; k < 3; ++k) d_bary[k] = at(adjoint.d_barycentrics, 3 * fragment + k);
  FragmentBackward(v, centres.x[pixel % centres.width], centres.y[pixel / centres.width],
                   options.rule, d_bary, at(adjoint.d_zbuf, fragment),
                   at(adjoint.d_dists, fragment), d_v);
}

}  // namespace

template <class T>
Status RasterizeLayers(std::span<const T> face_vertices, std::span<const FaceRange> images,
                       const LayeredOptions& options, const Workers& workers,
                       const LayeredImages<T>& out) {
  TILEGRAD_TRY(ValidateLayeredOptions(options));
  TILEGRAD_TRY(ValidateFaces(face_vertices));
  TILEGRAD_TRY(ValidateRanges(images, face_vertices.size() / 9));
  const Centres<T> centres(options.size);
  const auto layers = static_cast<std::size_t>(options.faces_per_pixel);
  const std::size_t fragments = images.size() * centres.width * centres.height * layers;
  TILEGRAD_TRY(CheckSize("pix_to_face", out.pix_to_face.size(), fragments));
  TILEGRAD_TRY(CheckSize("zbuf", out.zbuf.size(), fragments));
  TILEGRAD_TRY(CheckSize("dists", out.dists.size(), fragments));
  TILEGRAD_TRY(CheckSize("bary_coords", out.barycentrics.size(), 3 * fragments));
  const std::size_t bands = (centres.height + kBandRows - 1) / kBandRows;
  std::vector<Lists<T>> scratch(workers.size());
  workers.For(images.size() * bands, [&](std::size_t task, std::size_t worker) {
    const std::size_t n = task / bands, row = task % bands * kBandRows;
    const Band band{row, std::min(row + kBandRows, centres.height)};
    Lists<T>& lists = scratch[worker];
    lists.Reset((band.row_end - band.row) * centres.width, layers);
    for (std::int64_t f = images[n].first; f < images[n].first + images[n].count; ++f) {
      DrawFace(face_vertices.data() + 9 * f, f, centres, options, band, &lists);
    }
    WriteBand(face_vertices, centres, options, band, lists,
              (n * centres.height + band.row) * centres.width, out);
  });
  return {};
}

template <class T>
Status RasterizeLayersBackward(std::span<const T> face_vertices, const LayeredOptions& options,
                               const Workers& workers, const LayeredAdjoint<T>& adjoint) {
  TILEGRAD_TRY(ValidateLayeredOptions(options));
  TILEGRAD_TRY(ValidateFaces(face_vertices));
  TILEGRAD_TRY(ValidateLayeredAdjoint(face_vertices, options, adjoint));
  const Centres<T> centres(options.size);
  const std::size_t faces = face_vertices.size() / 9;
  const EntriesOfFaces<std::size_t> lists(adjoint.pix_to_face, faces);
  std::fill(adjoint.d_face_vertices.begin(), adjoint.d_face_vertices.end(), T(0));
  workers.ForEach(faces, kFacesPerTask, [&](std::size_t f) {
    for (const std::size_t fragment : lists.of(f)) {
      AddFragment(face_vertices.data() + 9 * f, centres, options, fragment, adjoint,
                  adjoint.d_face_vertices.data() + 9 * f);
    }
  });
  return CheckFinite("d_face_vertices", std::span<const T>(adjoint.d_face_vertices));
}

TILEGRAD_INSTANTIATE(RasterizeLayers);
TILEGRAD_INSTANTIATE(RasterizeLayersBackward);

}  // namespace tilegrad::compat::pytorch3d
