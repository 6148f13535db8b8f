// SPDX-License-Identifier: Apache-2.0
#include "rivals/image_state.h"

#include <algorithm>
#include <type_traits>

#include "rivals/projection.h"
#include "rivals/softras_color_ref.h"

namespace tilegrad::rivals {
namespace {

constexpr std::size_t kRowsAtOnce = 64, kFacesAtOnce = 256;

// Calls task(begin, end) for ranges of [0, n), shared with workers that have no image of their own.
template <class Task>
void ForRanges(const Workers::Part& part, std::size_t n, std::size_t grain, const Task& task) {
  part.For((n + grain - 1) / grain,
           [&](std::size_t i, std::size_t) { task(i * grain, std::min(n, (i + 1) * grain)); });
}

template <class Task>
void ForRows(const Workers::Part& part, int rows, const Task& task) {
  ForRanges(part, static_cast<std::size_t>(rows), kRowsAtOnce,
            [&](std::size_t begin, std::size_t end) {
              task(RowRange{static_cast<int>(begin), static_cast<int>(end)});
            });
}

}  // namespace

template <class T>
void ImageStateT<T>::Project(const BatchT<T>& batch, std::size_t n) {
  points_.resize(3 * batch.vertices());
  corners_.resize(3 * batch.faces.size());
  ProjectVertices<T>(batch.cameras[n], batch.size, batch.MeshOf(batch.positions, n), points_);
  for (std::size_t c = 0; c < batch.faces.size(); ++c) {
    std::copy_n(&points_[3 * static_cast<std::size_t>(batch.faces[c])], 3, &corners_[3 * c]);
  }
}

// From d_corners_ to d_positions_.
template <class T>
void ImageStateT<T>::ProjectAdjoint(const BatchT<T>& batch, std::size_t n) {
  d_points_.assign(3 * batch.vertices(), T(0));
  d_positions_.resize(d_points_.size());
  for (std::size_t c = 0; c < batch.faces.size(); ++c) {
    T* const to = &d_points_[3 * static_cast<std::size_t>(batch.faces[c])];
    for (std::size_t i = 0; i < 3; ++i) to[i] += d_corners_[3 * c + i];
  }
  ProjectVerticesAdjoint<T>(batch.cameras[n], batch.size, batch.MeshOf(batch.positions, n),
                            d_points_, d_positions_);
}

template <class T>
void ImageStateT<T>::SetTextures(const BatchT<T>& batch, const Options& options, std::size_t n) {
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
template <class T>
void ImageStateT<T>::SetColorGradients(const BatchT<T>& batch, const Options& options) {
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

template <class T>
void ImageStateT<T>::SoftRas(const Options& options, int size, const Workers::Part& part,
                             const ImagesT<T>& out) {
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

template <class T>
void ImageStateT<T>::SoftRasAdjoint(const Options& options, int size, const Workers::Part& part,
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

template <class T>
void ImageStateT<T>::N3mr(const Options& options, int size, const Workers::Part& part,
                          const ImagesT<T>& out) {
  SetUpN3mr<T>(corners_, size, options.n3mr, &n3mr_);
  const bool color = !out.color.empty();
  if (color) ReserveN3mrPlanes(n3mr_, &n3mr_planes_);
  const N3mrColorJob<T> job{options.n3mr, options.n3mr_colors, n3mr_, textures_};
  ForRows(part, n3mr_.inner, [&](RowRange rows) {
    DrawN3mr<T>(options.n3mr, rows, &n3mr_);
    if (color) N3mrShade(job, rows, &n3mr_planes_);
  });
  N3mrAlpha<T>(options.n3mr, &n3mr_, out.alpha);
  if (color) N3mrReducePlanes<T>(job, n3mr_planes_, {out.color, {}, {}});
}

template <class T>
void ImageStateT<T>::N3mrAdjoint(const Options& options, const Workers::Part& part,
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
  const N3mrImages<const T> pushes{d_images.color, d_images.alpha, {}};
  N3mrPrepareColorBackward(job, pushes, &n3mr_planes_);
  ForRanges(part, faces, kFacesAtOnce, [&](std::size_t begin, std::size_t end) {
    N3mrColorBackward<T>(job, pushes, n3mr_planes_, begin, end, {d_corners_, d_textures_});
  });
}

template <class T>
void ImageStateT<T>::Render(const BatchT<T>& batch, const Options& options, std::size_t n,
                            const Workers::Part& part, const ImagesT<T>& out) {
  Project(batch, n);
  if (batch.colored()) SetTextures(batch, options, n);
  options.rule == Rule::kSoftRas ? SoftRas(options, batch.size, part, out)
                                 : N3mr(options, batch.size, part, out);
}

template <class T>
void ImageStateT<T>::Backward(const BatchT<T>& batch, const Options& options, std::size_t n,
                              const Workers::Part& part, const ImagesT<const T>& d_images) {
  d_corners_.resize(corners_.size());
  if (batch.colored()) d_textures_.assign(textures_.size(), T(0));
  options.rule == Rule::kSoftRas ? SoftRasAdjoint(options, batch.size, part, d_images)
                                 : N3mrAdjoint(options, part, d_images);
  ProjectAdjoint(batch, n);
  if (!batch.colors.empty()) SetColorGradients(batch, options);
}

template class ImageStateT<float>;
template class ImageStateT<double>;

}  // namespace tilegrad::rivals
