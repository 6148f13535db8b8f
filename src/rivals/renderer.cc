// SPDX-License-Identifier: Apache-2.0
#include "rivals/renderer.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "base/aligned.h"
#include "base/error.h"
#include "rivals/face_corners.h"
#include "rivals/softras_color_ref.h"

namespace tilegrad::rivals {
namespace {

constexpr std::size_t kRowsAtOnce = 64, kFacesAtOnce = 256;

// Calls task(begin, end) for ranges of [0, n), shared with idle workers.
template <class Task>
void ForRanges(const Workers::Part& part, std::size_t n, std::size_t grain, const Task& task) {
  part.For((n + grain - 1) / grain,
           [&](std::size_t i) { task(i * grain, std::min(n, (i + 1) * grain)); });
}

template <class Task>
void ForRows(const Workers::Part& part, int rows, const Task& task) {
  ForRanges(part, static_cast<std::size_t>(rows), kRowsAtOnce,
            [&](std::size_t begin, std::size_t end) {
              task(RowRange{static_cast<int>(begin), static_cast<int>(end)});
            });
}

Status CheckSize(const char* name, std::size_t size, std::size_t expected) {
  if (size == expected) return {};
  return InvalidArgument("{} has {} numbers, expected {}", name, size, expected);
}

Status CheckFaces(std::span<const std::int32_t> faces, std::size_t vertices) {
  if (faces.size() % 3 != 0)
    return InvalidArgument("faces have {} indices, not three each", faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] >= 0 && static_cast<std::size_t>(faces[i]) < vertices) continue;
    return InvalidArgument("corner {} of face {} is vertex {}, but there are {}", i % 3, i / 3,
                           faces[i], vertices);
  }
  return {};
}

template <class T>
Status CheckBatch(const BatchT<T>& batch) {
  if (batch.size < 1 || batch.size > 16384)
    return InvalidArgument("images have {} pixels a side; must be 1 to 16384", batch.size);
  if (batch.meshes == 0 || batch.positions.size() % (3 * batch.meshes) != 0 ||
      batch.cameras.size() % batch.meshes != 0) {
    return InvalidArgument("{} numbers of positions and {} cameras do not make {} equal meshes",
                           batch.positions.size(), batch.cameras.size(), batch.meshes);
  }
  if (!batch.colors.empty())
    TILEGRAD_TRY(CheckSize("colors", batch.colors.size(), batch.positions.size()));
  return CheckFaces(batch.faces, batch.vertices());
}

Status Positive(const char* name, double value) {
  if (value > 0 && std::isfinite(value)) return {};
  return InvalidArgument("{} is {}, but must be positive and finite", name, value);
}

Status CheckPlanes(const char* rule, double near_plane, double far_plane) {
  if (near_plane > 0 && near_plane < far_plane && std::isfinite(far_plane)) return {};
  return InvalidArgument("{}: near {} and far {} must be 0 < near < far", rule, near_plane,
                         far_plane);
}

Status CheckResolution(const char* name, int value, int least, int most) {
  if (value >= least && value <= most) return {};
  return InvalidArgument("{} is {}; must be {} to {}", name, value, least, most);
}

// sum <- the sum of `part` over the images of mesh b, in order.
template <class T, class PartOf>
void SumViews(std::size_t views, std::size_t b, std::span<T> sum, const PartOf& part_of) {
  std::fill(sum.begin(), sum.end(), T(0));
  for (std::size_t v = 0; v < views; ++v) {
    const std::span<const T> part = part_of(b * views + v);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
  }
}

template <class T>
Status CheckTextures(const BatchT<T>& batch, const Options& options) {
  if (batch.textures.empty()) return {};
  if (options.rule != Rule::kN3mr) return InvalidArgument("only N3MR has face textures");
  if (!batch.colors.empty()) return InvalidArgument("a batch has colors or textures, not both");
  return CheckSize("textures", batch.textures.size(),
                   batch.meshes * batch.faces.size() * options.n3mr_colors.texels());
}

}  // namespace

// One image of a batch: state between its forward and its backward pass, and memory for both. T:
// float or double.
template <class T>
class ImageStateT {
 public:
  // `out`: for this image, number n of the batch. Options and batch must be valid.
  void Render(const BatchT<T>& batch, const Options& options, std::size_t n,
              const Workers::Part& part, const ImagesT<T>& out) {
    Project(batch, n);
    if (batch.colored()) SetTextures(batch, options, n);
    options.rule == Rule::kSoftRas ? SoftRas(options, batch.size, part, out)
                                   : N3mr(options, batch.size, part, out);
  }

  // Sets d_positions and, if the batch has colours, d_colors.
  void Backward(const BatchT<T>& batch, const Options& options, std::size_t n,
                const Workers::Part& part, const ImagesT<const T>& d_images) {
    d_corners_.resize(corners_.size());
    if (batch.colored()) d_textures_.assign(textures_.size(), T(0));
    options.rule == Rule::kSoftRas ? SoftRasAdjoint(options, batch.size, part, d_images)
                                   : N3mrAdjoint(options, part, d_images);
    ProjectAdjoint(batch, n);
    if (!batch.colors.empty()) SetColorGradients(batch, options);
  }

  std::span<const T> d_positions() const { return d_positions_; }  // [V,3]
  std::span<const T> d_colors() const { return d_colors_; }        // [V,3]
  std::span<const T> d_textures() const { return d_textures_; }    // [F,texels,3]

 private:
  void Project(const BatchT<T>& batch, std::size_t n) {
    points_.resize(3 * batch.vertices());
    corners_.resize(3 * batch.faces.size());
    ProjectVertices<T>(batch.cameras[n], batch.size, batch.MeshOf(batch.positions, n), points_);
    for (std::size_t c = 0; c < batch.faces.size(); ++c) {
      std::copy_n(&points_[3 * static_cast<std::size_t>(batch.faces[c])], 3, &corners_[3 * c]);
    }
  }

  // From d_corners_ to d_positions_.
  void ProjectAdjoint(const BatchT<T>& batch, std::size_t n) {
    d_points_.assign(3 * batch.vertices(), T(0));
    d_positions_.resize(d_points_.size());
    for (std::size_t c = 0; c < batch.faces.size(); ++c) {
      T* const to = &d_points_[3 * static_cast<std::size_t>(batch.faces[c])];
      for (std::size_t i = 0; i < 3; ++i) to[i] += d_corners_[3 * c + i];
    }
    ProjectVerticesAdjoint<T>(batch.cameras[n], batch.size, batch.MeshOf(batch.positions, n),
                              d_points_, d_positions_);
  }

  void SetTextures(const BatchT<T>& batch, const Options& options, std::size_t n) {
    if (!batch.textures.empty()) {
      const std::span<const T> own = batch.TexturesOf(batch.textures, n);
      return textures_.assign(own.begin(), own.end());
    }
    const std::span<const T> colors = batch.MeshOf(batch.colors, n);
    const std::size_t texels = options.texels(), faces = batch.faces.size() / 3;
    textures_.resize(3 * faces * texels);
    for (std::size_t f = 0; f < faces; ++f) {
      T* const to = &textures_[3 * f * texels];
      const T* corner[3];
      for (std::size_t k = 0; k < 3; ++k)
        corner[k] = &colors[3 * static_cast<std::size_t>(batch.faces[3 * f + k])];
      for (std::size_t i = 0; i < 3 * texels; ++i) {
        const std::size_t c = i % 3;
        to[i] = options.corner_colors() ? corner[i / 3][c]
                                        : (corner[0][c] + corner[1][c] + corner[2][c]) / T(3);
      }
    }
  }

  // From d_textures_ to d_colors_.
  void SetColorGradients(const BatchT<T>& batch, const Options& options) {
    const std::size_t texels = options.texels(), faces = batch.faces.size() / 3;
    d_colors_.assign(3 * batch.vertices(), T(0));
    for (std::size_t f = 0; f < faces; ++f) {
      const T* const from = &d_textures_[3 * f * texels];
      T mean[3] = {T(0), T(0), T(0)};
      for (std::size_t i = 0; i < 3 * texels; ++i) mean[i % 3] += from[i] / T(3);
      for (std::size_t k = 0; k < 3; ++k) {
        T* const to = &d_colors_[3 * static_cast<std::size_t>(batch.faces[3 * f + k])];
        for (std::size_t c = 0; c < 3; ++c)
          to[c] += options.corner_colors() ? from[3 * k + c] : mean[c];
      }
    }
  }

  void SoftRas(const Options& options, int size, const Workers::Part& part, const ImagesT<T>& out) {
    if constexpr (std::is_same_v<T, float>) {
      SetUpSoftRas(corners_, size, options.softras, &softras_);
      if (!out.color.empty()) ReserveSoftRasColors(softras_, &softras_color_);
      const SoftRasColorJob job{options.softras, options.softras_colors, softras_, textures_};
      ForRows(part, size, [&](RowRange rows) {
        SoftRasForward(options.softras, rows, &softras_, out.alpha);
        if (!out.color.empty()) SoftRasColorForward(job, rows, &softras_color_, out.color);
      });
    } else {
      SoftRasForwardRef<T>(corners_, size, options.softras, out.alpha);
      if (!out.color.empty()) {
        SoftRasColorRef<T>({corners_, textures_, size, options.softras, options.softras_colors},
                           out.color);
      }
    }
  }

  void SoftRasAdjoint(const Options& options, int size, const Workers::Part& part,
                      const ImagesT<const T>& d_images) {
    std::fill(d_corners_.begin(), d_corners_.end(), T(0));
    const bool alpha = !d_images.alpha.empty(), color = !d_images.color.empty();
    if constexpr (std::is_same_v<T, float>) {
      if (alpha) SoftRasPrepareBackward(options.softras, d_images.alpha, &softras_);
      if (color) SoftRasColorPrepareBackward(softras_, d_images.color, &softras_color_);
      const SoftRasColorJob job{options.softras, options.softras_colors, softras_, textures_};
      ForRanges(part, softras_.faces.size(), kFacesAtOnce, [&](std::size_t begin, std::size_t end) {
        if (alpha) SoftRasBackward(options.softras, softras_, begin, end, d_corners_);
        if (color) SoftRasColorBackward(job, softras_color_, begin, end, {d_corners_, d_textures_});
      });
    } else {
      if (alpha) SoftRasBackwardRef<T>(corners_, size, options.softras, d_images.alpha, d_corners_);
      if (color) {
        SoftRasColorBackwardRef<T>(
            {corners_, textures_, size, options.softras, options.softras_colors}, d_images.color,
            {d_corners_, d_textures_});
      }
    }
  }

  void N3mr(const Options& options, int size, const Workers::Part& part, const ImagesT<T>& out) {
    SetUpN3mr<T>(corners_, size, options.n3mr, &n3mr_);
    const bool color = !out.color.empty();
    if (color) ReserveN3mrPlanes(n3mr_, &n3mr_planes_);
    const N3mrColorJob<T> job{options.n3mr, options.n3mr_colors, n3mr_, textures_};
    ForRows(part, n3mr_.inner, [&](RowRange rows) {
      DrawN3mr<T>(options.n3mr, rows, &n3mr_);
      if (color) N3mrShade(job, rows, &n3mr_planes_);
    });
    N3mrAlpha<T>(options.n3mr, &n3mr_, out.alpha);
    if (color) N3mrReducePlanes<T>(job, n3mr_planes_, {out.color, {}});
  }

  void N3mrAdjoint(const Options& options, const Workers::Part& part,
                   const ImagesT<const T>& d_images) {
    const std::size_t faces = n3mr_.drawn_of.size();
    if (d_images.color.empty()) {
      if (d_images.alpha.empty()) return std::fill(d_corners_.begin(), d_corners_.end(), T(0));
      N3mrPrepareBackward<T>(options.n3mr, d_images.alpha, &n3mr_);
      return ForRanges(part, faces, kFacesAtOnce, [&](std::size_t begin, std::size_t end) {
        N3mrBackward<T>(options.n3mr, n3mr_, begin, end, d_corners_);
      });
    }
    const N3mrColorJob<T> job{options.n3mr, options.n3mr_colors, n3mr_, textures_};
    const N3mrImages<const T> pushes{d_images.color, d_images.alpha};
    N3mrPrepareColorBackward(job, pushes, &n3mr_planes_);
    ForRanges(part, faces, kFacesAtOnce, [&](std::size_t begin, std::size_t end) {
      N3mrColorBackward<T>(job, pushes, n3mr_planes_, begin, end, {d_corners_, d_textures_});
    });
  }

  AlignedVector<T> points_, d_points_, d_positions_, d_colors_;  // [V,3]
  AlignedVector<T> corners_, d_corners_;                         // [F,3,3]
  AlignedVector<T> textures_, d_textures_;                       // [F,texels,3]
  SoftRasImage softras_;                                         // float
  SoftRasColorImage softras_color_;                              // float
  N3mrImageT<T> n3mr_;
  N3mrPlanesT<T> n3mr_planes_;
};

Status Validate(const Options& options) {
  const SoftRasOptions& soft = options.softras;
  TILEGRAD_TRY(Positive("SoftRas: sigma", soft.sigma));
  if (!(soft.dist_eps > 0 && soft.dist_eps < 0.5))
    return InvalidArgument("SoftRas: dist_eps is {}, but must lie in (0, 0.5)", soft.dist_eps);
  TILEGRAD_TRY(CheckPlanes("SoftRas", soft.near_plane, soft.far_plane));
  TILEGRAD_TRY(Positive("SoftRas: gamma", options.softras_colors.gamma));
  TILEGRAD_TRY(Positive("N3MR: eps", options.n3mr.eps));
  TILEGRAD_TRY(CheckResolution("N3MR: resolution", options.n3mr_colors.resolution, 2, 32));
  return CheckPlanes("N3MR", options.n3mr.near_plane, options.n3mr.far_plane);
}

template <class T>
RendererT<T>::RendererT(const Workers& workers) : workers_(workers) {}
template <class T>
RendererT<T>::~RendererT() = default;

template <class T>
Status RendererT<T>::Render(const BatchT<T>& batch, const Options& options, const ImagesT<T>& out) {
  TILEGRAD_TRY(Validate(options));
  TILEGRAD_TRY(CheckBatch(batch));
  TILEGRAD_TRY(CheckTextures(batch, options));
  const std::size_t pixels = batch.cameras.size() * batch.pixels();
  TILEGRAD_TRY(CheckSize("alpha", out.alpha.size(), pixels));
  TILEGRAD_TRY(CheckSize("color", out.color.size(), batch.colored() ? 3 * pixels : 0));
  if (options.rule == Rule::kN3mr && options.n3mr.reduction == N3mrReduction::kBilinear &&
      batch.size < 2)
    return InvalidArgument("N3MR: the bilinear reduction needs images of two pixels a side");
  if (images_.size() < batch.cameras.size()) images_.resize(batch.cameras.size());
  workers_.ForParts(batch.cameras.size(), [&](std::size_t n, const Workers::Part& part) {
    images_[n].Render(batch, options, n, part, out.Image(n, batch.pixels()));
  });
  return {};
}

template <class T>
Status RendererT<T>::Backward(const BatchT<T>& batch, const Options& options,
                              const ImagesT<const T>& d_images, const GradientsT<T>& out) {
  TILEGRAD_TRY(CheckBatch(batch));
  const std::size_t pixels = batch.cameras.size() * batch.pixels();
  if (!d_images.alpha.empty())
    TILEGRAD_TRY(CheckSize("the adjoint of alpha", d_images.alpha.size(), pixels));
  if (!d_images.color.empty()) {
    TILEGRAD_TRY(
        CheckSize("the adjoint of color", d_images.color.size(), batch.colored() ? 3 * pixels : 0));
  }
  TILEGRAD_TRY(
      CheckSize("the gradient of positions", out.positions.size(), batch.positions.size()));
  if (!out.colors.empty())
    TILEGRAD_TRY(CheckSize("the gradient of colors", out.colors.size(), batch.colors.size()));
  if (!out.textures.empty())
    TILEGRAD_TRY(CheckSize("the gradient of textures", out.textures.size(), batch.textures.size()));
  if (images_.size() < batch.cameras.size())
    return InvalidArgument("{} images were rendered, but there are {} cameras", images_.size(),
                           batch.cameras.size());
  workers_.ForParts(batch.cameras.size(), [&](std::size_t n, const Workers::Part& part) {
    images_[n].Backward(batch, options, n, part, d_images.Image(n, batch.pixels()));
  });
  workers_.For(batch.meshes, [&](std::size_t b) {
    const std::size_t views = batch.views(), first = b * views;
    SumViews(views, b, batch.MeshOf(out.positions, first),
             [&](std::size_t n) { return images_[n].d_positions(); });
    if (!out.colors.empty()) {
      SumViews(views, b, batch.MeshOf(out.colors, first),
               [&](std::size_t n) { return images_[n].d_colors(); });
    }
    if (!out.textures.empty()) {
      SumViews(views, b, batch.TexturesOf(out.textures, first),
               [&](std::size_t n) { return images_[n].d_textures(); });
    }
  });
  return {};
}

template class RendererT<float>;
template class RendererT<double>;

}  // namespace tilegrad::rivals
