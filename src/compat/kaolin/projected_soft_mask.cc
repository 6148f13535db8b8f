// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "base/scalar.h"
#include "compat/kaolin/projected_raster.h"
#include "raster/soft_mask/soft_mask.h"
#include "render/pipeline/paper_bin.h"
#include "render/validate.h"

namespace tilegrad::compat::kaolin {
namespace {

// A task is a bin of an image; the tiles of the bins have their scalar or vector code.
struct Bins {
  const ImageSize& size;
  std::size_t images;
  raster::SquareGrid grid = raster::BinGrid(size.width, size.height);

  std::size_t tasks() const { return images * grid.cells(); }
  std::size_t image(std::size_t task) const { return task / grid.cells(); }
  raster::PixelRect rect(std::size_t task) const { return grid.rect(task % grid.cells()); }
  std::size_t first(std::size_t task) const { return image(task) * PixelCount(size); }  // pixel
  PaperRegion region(std::size_t task, std::span<const std::int32_t> face_ids) const {
    return {rect(task), size.width, size.height, face_ids.data() + first(task)};
  }
};

// ---- Vector code: float, all faces.

// One image's faces as a mesh without shared vertices, and its tree.
struct SoftImage {
  raster::ScreenMeshBuffers buffers;
  raster::SoftTree tree;
  raster::SoftMaskPlan plan;

  void Build(const ProjectedFacesT<float>& faces, const ProjectedMaskOptions& options) {
    Place(faces, options.size);
    raster::SetUpFaces(buffers.View(), /*cull_back=*/false, buffers.reject,
                       {.corners = &tree.corners});
    raster::BuildSoftTree(&tree);
    plan = raster::PlanSoftMask({options.size.width, options.size.height, options.delta,
                                 options.max_alpha_error, tree.faces});
  }

 private:
  void Place(const ProjectedFacesT<float>& faces, const ImageSize& size) {
    const std::size_t count = faces.count();
    buffers.width = size.width;
    buffers.height = size.height;
    buffers.packed.resize(3 * count);
    buffers.reject.assign(count, raster::kFaceDrawn);
    for (auto* array : {&buffers.x, &buffers.y}) array->resize(3 * count);
    for (auto* corner : {&buffers.v0, &buffers.v1, &buffers.v2}) corner->resize(count);
    for (std::size_t i = 0; i < 3 * count; ++i) {
      const float x = (faces.xy[2 * i] + 1) * 0.5f * static_cast<float>(size.width);
      const float y = (1 - faces.xy[2 * i + 1]) * 0.5f * static_cast<float>(size.height);
      buffers.x[i] = x;
      buffers.y[i] = y;
      buffers.packed[i] = {x, y, 1, 1};
      if (!std::isfinite(x) || !std::isfinite(y)) buffers.reject[i / 3] = raster::kFaceOverflow;
    }
    for (std::size_t f = 0; f < count; ++f) {
      const auto first = static_cast<std::int32_t>(3 * f);
      buffers.v0[f] = first;
      buffers.v1[f] = first + 1;
      buffers.v2[f] = first + 2;
    }
  }
};

std::vector<SoftImage> BuildSoftImages(const ProjectedBatchT<float>& batch,
                                       const ProjectedMaskOptions& options,
                                       const Workers& workers) {
  std::vector<SoftImage> images(batch.images);
  workers.For(batch.images, [&](std::size_t n) { images[n].Build(batch.image(n), options); });
  return images;
}

double VectorMask(const ProjectedBatchT<float>& batch, const ProjectedMaskOptions& options,
                  std::span<const std::int32_t> face_ids, const Workers& workers,
                  std::span<float> alpha) {
  const std::vector<SoftImage> images = BuildSoftImages(batch, options, workers);
  const Bins bins{options.size, batch.images};
  const std::size_t pixels = PixelCount(options.size);
  std::vector<raster::SoftMaskScratch> scratch(workers.size());
  std::vector<double> spent(bins.tasks());
  workers.For(bins.tasks(), [&](std::size_t task, std::size_t worker) {
    const std::size_t n = bins.image(task);
    spent[task] = raster::SoftMaskForward(images[n].tree, images[n].plan,
                                          {bins.rect(task), face_ids.subspan(n * pixels, pixels)},
                                          {alpha.subspan(n * pixels, pixels)}, &scratch[worker]);
  });
  return spent.empty() ? 0 : *std::max_element(spent.begin(), spent.end());
}

// Adds gradients in pixels to d_xy [F,3,2] in NDC.
void AddFaceGradients(std::span<const raster::SoftFaceGradient> gradients, const ImageSize& size,
                      float* d_xy) {
  const float x = 0.5f * static_cast<float>(size.width);
  const float y = -0.5f * static_cast<float>(size.height);
  for (const raster::SoftFaceGradient& d : gradients) {
    float* to = d_xy + 6 * static_cast<std::size_t>(d.face);
    for (int k = 0; k < 3; ++k) {
      to[2 * k] += d.d_corner[k][0] * x;
      to[2 * k + 1] += d.d_corner[k][1] * y;
    }
  }
}

void VectorMaskBackward(const ProjectedBatchT<float>& batch, const ProjectedMaskOptions& options,
                        const Workers& workers, const ProjectedMaskAdjoint<float>& adjoint) {
  const std::vector<SoftImage> images = BuildSoftImages(batch, options, workers);
  const Bins bins{options.size, batch.images};
  const std::size_t pixels = PixelCount(options.size);
  std::vector<raster::SoftMaskScratch> scratch(workers.size());
  std::vector<AlignedVector<raster::SoftFaceGradient>> gradients(bins.tasks());
  workers.For(bins.tasks(), [&](std::size_t task, std::size_t worker) {
    const std::size_t first = bins.image(task) * pixels;
    const SoftImage& image = images[bins.image(task)];
    raster::SoftMaskBackward(
        image.tree, image.plan, {bins.rect(task), adjoint.face_ids.subspan(first, pixels)},
        {adjoint.alpha.subspan(first, pixels), {}, adjoint.d_alpha.subspan(first, pixels)},
        &gradients[task], &scratch[worker]);
  });
  workers.For(batch.images, [&](std::size_t n) {
    for (std::size_t bin = 0; bin < bins.grid.cells(); ++bin) {
      AddFaceGradients(gradients[n * bins.grid.cells() + bin], options.size,
                       adjoint.d_xy.data() + 6 * n * batch.faces);
    }
  });
}

// ---- Scalar code: the paper's rule, and double. All faces in double use the paper's rule with
// boxes grown so far that all faces outside sum to at most max_alpha_error, and without its eps.

raster::PaperSoftMask ScalarRule(const ProjectedMaskOptions& options, std::size_t faces) {
  if (options.rule == AlphaRule::kPaper) {
    return {1 / options.delta, options.paper_box, options.paper_faces, options.paper_eps};
  }
  constexpr double kUnderflow = 746;  // exp(-746) is 0
  const double dropped =
      options.max_alpha_error > 0
          ? std::log(static_cast<double>(std::max<std::size_t>(faces, 1)) / options.max_alpha_error)
          : kUnderflow;
  return {1 / options.delta, std::sqrt(std::clamp(dropped, 0.0, kUnderflow) * options.delta),
          std::numeric_limits<int>::max(), 0, std::numeric_limits<double>::infinity()};
}

template <class T>
std::vector<raster::NdcFace<T>> NdcFacesOf(const ProjectedFacesT<T>& faces) {
  std::vector<raster::NdcFace<T>> out(faces.count());
  for (std::size_t f = 0; f < out.size(); ++f) {
    const T* v = faces.corners(f);
    for (int k = 0; k < 3; ++k) {
      out[f].x[k] = v[2 * k];
      out[f].y[k] = v[2 * k + 1];
    }
  }
  return out;
}

template <class T>
using FacesOfImages = std::vector<std::vector<raster::NdcFace<T>>>;

template <class T>
FacesOfImages<T> NdcFacesOf(const ProjectedBatchT<T>& batch, const Workers& workers) {
  FacesOfImages<T> out(batch.images);
  workers.For(batch.images, [&](std::size_t n) { out[n] = NdcFacesOf(batch.image(n)); });
  return out;
}

template <class T>
double ScalarMask(const ProjectedBatchT<T>& batch, const ProjectedMaskOptions& options,
                  std::span<const std::int32_t> face_ids, const Workers& workers,
                  std::span<T> alpha) {
  const raster::PaperSoftMask rule = ScalarRule(options, batch.faces);
  const Bins bins{options.size, batch.images};
  const FacesOfImages<T> faces = NdcFacesOf(batch, workers);
  workers.For(bins.tasks(), [&](std::size_t task) {
    PaperForward<T>(faces[bins.image(task)], rule, bins.region(task, face_ids),
                    alpha.data() + bins.first(task));
  });
  if (options.rule == AlphaRule::kPaper) return std::numeric_limits<double>::infinity();
  return options.max_alpha_error;
}

// Adds dL/d(corners) of the faces near a tile to d_xy [F,3,2].
template <class T>
void AddTile(const NearFacesT<T>& tile, T* d_xy) {
  for (std::size_t i = 0; i < tile.faces.size(); ++i) {
    T* to = d_xy + 6 * tile.source[i];
    for (int k = 0; k < 3; ++k) {
      to[2 * k] += tile.faces[i].x[k];
      to[2 * k + 1] += tile.faces[i].y[k];
    }
  }
}

template <class T>
void ScalarMaskBackward(const ProjectedBatchT<T>& batch, const ProjectedMaskOptions& options,
                        const Workers& workers, const ProjectedMaskAdjoint<T>& adjoint) {
  const raster::PaperSoftMask rule = ScalarRule(options, batch.faces);
  const Bins bins{options.size, batch.images};
  const FacesOfImages<T> faces = NdcFacesOf(batch, workers);
  std::vector<std::vector<NearFacesT<T>>> gradients(bins.tasks());  // of tiles
  workers.For(bins.tasks(), [&](std::size_t task) {
    gradients[task] =
        PaperBackward<T>(faces[bins.image(task)], rule, bins.region(task, adjoint.face_ids),
                         adjoint.d_alpha.data() + bins.first(task));
  });
  workers.For(batch.images, [&](std::size_t n) {
    for (std::size_t bin = 0; bin < bins.grid.cells(); ++bin) {
      for (const NearFacesT<T>& tile : gradients[n * bins.grid.cells() + bin]) {
        AddTile(tile, adjoint.d_xy.data() + 6 * n * batch.faces);
      }
    }
  });
}

Status ValidateMaskOptions(const ProjectedMaskOptions& options) {
  if (!(options.delta > 0) || !std::isfinite(options.delta)) {
    return InvalidArgument("delta is {}, must be finite and > 0", options.delta);
  }
  if (!(options.max_alpha_error >= 0 && options.max_alpha_error <= 1)) {
    return InvalidArgument("max_alpha_error is {}, must be in [0, 1]", options.max_alpha_error);
  }
  TILEGRAD_TRY(CheckNotNegative("boxlen", options.paper_box));
  if (options.paper_faces < 0) {
    return InvalidArgument("knum is {}, must be >= 0", options.paper_faces);
  }
  return CheckNotNegative("paper_eps", options.paper_eps);
}

}  // namespace

template <class T>
Result<double> ProjectedSoftMask(const ProjectedBatchT<T>& batch,
                                 const ProjectedMaskOptions& options,
                                 std::span<const std::int32_t> face_ids, const Workers& workers,
                                 std::span<T> alpha) {
  TILEGRAD_TRY(ValidateMaskOptions(options));
  TILEGRAD_TRY(ValidateProjected(batch, options.size, face_ids));
  TILEGRAD_TRY(CheckSize("face_idx", face_ids.size(), batch.images * PixelCount(options.size)));
  TILEGRAD_TRY(CheckSize("the mask", alpha.size(), face_ids.size()));
  if constexpr (std::is_same_v<T, float>) {
    if (options.rule == AlphaRule::kAllFaces) {
      return VectorMask(batch, options, face_ids, workers, alpha);
    }
  }
  return ScalarMask(batch, options, face_ids, workers, alpha);
}

template <class T>
Status ProjectedSoftMaskBackward(const ProjectedBatchT<T>& batch,
                                 const ProjectedMaskOptions& options, const Workers& workers,
                                 const ProjectedMaskAdjoint<T>& adjoint) {
  TILEGRAD_TRY(ValidateMaskOptions(options));
  TILEGRAD_TRY(ValidateProjected(batch, options.size, adjoint.face_ids));
  const std::size_t pixels = batch.images * PixelCount(options.size);
  TILEGRAD_TRY(CheckSize("face_idx", adjoint.face_ids.size(), pixels));
  TILEGRAD_TRY(CheckSize("the mask", adjoint.alpha.size(), pixels));
  TILEGRAD_TRY(CheckSize("the gradient of the mask", adjoint.d_alpha.size(), pixels));
  TILEGRAD_TRY(CheckFinite("the gradient of the mask", adjoint.d_alpha));
  TILEGRAD_TRY(CheckSize("d_face_vertices_image", adjoint.d_xy.size(), batch.xy.size()));
  std::fill(adjoint.d_xy.begin(), adjoint.d_xy.end(), T(0));
  bool done = false;
  if constexpr (std::is_same_v<T, float>) {
    if (options.rule == AlphaRule::kAllFaces) {
      VectorMaskBackward(batch, options, workers, adjoint);
      done = true;
    }
  }
  if (!done) ScalarMaskBackward(batch, options, workers, adjoint);
  return CheckFinite("d_face_vertices_image", std::span<const T>(adjoint.d_xy));
}

TILEGRAD_INSTANTIATE(ProjectedSoftMask);
TILEGRAD_INSTANTIATE(ProjectedSoftMaskBackward);

}  // namespace tilegrad::compat::kaolin
