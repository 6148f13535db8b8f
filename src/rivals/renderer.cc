// SPDX-License-Identifier: Apache-2.0
#include "rivals/renderer.h"

#include <algorithm>
#include <type_traits>

#include "base/error.h"
#include "rivals/n3mr.h"
#include "rivals/projection.h"
#include "rivals/softras_ref.h"

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

template <class T>
Status CheckBatch(const BatchT<T>& batch, std::size_t alpha) {
  if (batch.size < 1 || batch.size > 16384)
    return InvalidArgument("images have {} pixels a side; 1 to 16384 are possible", batch.size);
  if (batch.meshes == 0 || batch.positions.size() % (3 * batch.meshes) != 0 ||
      batch.cameras.size() % batch.meshes != 0) {
    return InvalidArgument("{} numbers of positions and {} cameras do not make {} equal meshes",
                           batch.positions.size(), batch.cameras.size(), batch.meshes);
  }
  if (batch.faces.size() % 3 != 0)
    return InvalidArgument("faces have {} indices, not three each", batch.faces.size());
  const auto vertices = static_cast<std::int64_t>(batch.vertices());
  for (std::size_t i = 0; i < batch.faces.size(); ++i) {
    if (batch.faces[i] >= 0 && batch.faces[i] < vertices) continue;
    return InvalidArgument("corner {} of face {} is vertex {}, but there are {}", i % 3, i / 3,
                           batch.faces[i], vertices);
  }
  const std::size_t expected = batch.cameras.size() * batch.pixels();
  if (alpha == expected) return {};
  return InvalidArgument("alpha has {} numbers, expected {}", alpha, expected);
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

}  // namespace

Status Validate(const Options& options) {
  const SoftRasOptions& soft = options.softras;
  TILEGRAD_TRY(Positive("SoftRas: sigma", soft.sigma));
  if (!(soft.dist_eps > 0 && soft.dist_eps < 0.5))
    return InvalidArgument("SoftRas: dist_eps is {}, but must lie in (0, 0.5)", soft.dist_eps);
  TILEGRAD_TRY(CheckPlanes("SoftRas", soft.near_plane, soft.far_plane));
  TILEGRAD_TRY(Positive("N3MR: eps", options.n3mr.eps));
  return CheckPlanes("N3MR", options.n3mr.near_plane, options.n3mr.far_plane);
}

// What an image keeps from its forward to its backward pass, and memory for both.
template <class T>
struct RendererT<T>::Image {
  AlignedVector<T> points, corners;      // [V,3], [F,3,3]
  AlignedVector<T> d_points, d_corners;  // the same
  AlignedVector<T> d_positions;          // [V,3]
  SoftRasImage softras;                  // float
  N3mrImageT<T> n3mr;

  void Project(const BatchT<T>& batch, std::size_t n) {
    const std::size_t numbers = 3 * batch.vertices();
    points.resize(numbers), corners.resize(3 * batch.faces.size());
    ProjectVertices<T>(batch.cameras[n], batch.size,
                       batch.positions.subspan(n / batch.views() * numbers, numbers), points);
    for (std::size_t c = 0; c < batch.faces.size(); ++c) {
      std::copy_n(&points[3 * static_cast<std::size_t>(batch.faces[c])], 3, &corners[3 * c]);
    }
  }

  // From d_corners to d_positions.
  void ProjectAdjoint(const BatchT<T>& batch, std::size_t n) {
    const std::size_t numbers = 3 * batch.vertices();
    d_points.assign(numbers, T(0)), d_positions.resize(numbers);
    for (std::size_t c = 0; c < batch.faces.size(); ++c) {
      T* const to = &d_points[3 * static_cast<std::size_t>(batch.faces[c])];
      for (std::size_t i = 0; i < 3; ++i) to[i] += d_corners[3 * c + i];
    }
    ProjectVerticesAdjoint<T>(batch.cameras[n], batch.size,
                              batch.positions.subspan(n / batch.views() * numbers, numbers),
                              d_points, d_positions);
  }

  void SoftRas(const Workers::Part& part, const SoftRasOptions& options, int size,
               std::span<T> alpha) {
    if constexpr (std::is_same_v<T, float>) {
      SetUpSoftRas(corners, size, options, &softras);
      ForRows(part, size, [&](RowRange rows) { SoftRasForward(options, rows, &softras, alpha); });
    } else {
      SoftRasForwardRef<T>(corners, size, options, alpha);
    }
  }

  void SoftRasAdjoint(const Workers::Part& part, const SoftRasOptions& options, int size,
                      std::span<const T> d_alpha) {
    if constexpr (std::is_same_v<T, float>) {
      SoftRasPrepareBackward(options, d_alpha, &softras);
      ForRanges(part, softras.faces.size(), kFacesAtOnce, [&](std::size_t begin, std::size_t end) {
        SoftRasBackward(options, softras, begin, end, d_corners);
      });
    } else {
      std::fill(d_corners.begin(), d_corners.end(), T(0));
      SoftRasBackwardRef<T>(corners, size, options, d_alpha, d_corners);
    }
  }

  void N3mr(const Workers::Part& part, const N3mrOptions& options, int size, std::span<T> alpha) {
    SetUpN3mr<T>(corners, size, options, &n3mr);
    ForRows(part, n3mr.inner, [&](RowRange rows) { DrawN3mr<T>(options, rows, &n3mr); });
    N3mrAlpha<T>(options, &n3mr, alpha);
  }

  void N3mrAdjoint(const Workers::Part& part, const N3mrOptions& options,
                   std::span<const T> d_alpha) {
    N3mrPrepareBackward<T>(options, d_alpha, &n3mr);
    ForRanges(part, n3mr.drawn_of.size(), kFacesAtOnce, [&](std::size_t begin, std::size_t end) {
      N3mrBackward<T>(options, n3mr, begin, end, d_corners);
    });
  }
};

template <class T>
RendererT<T>::RendererT(const Workers& workers) : workers_(workers) {}
template <class T>
RendererT<T>::~RendererT() = default;

template <class T>
Status RendererT<T>::Render(const BatchT<T>& batch, const Options& options, std::span<T> alpha) {
  TILEGRAD_TRY(Validate(options));
  TILEGRAD_TRY(CheckBatch(batch, alpha.size()));
  if (options.rule == Rule::kN3mr && options.n3mr.reduction == N3mrReduction::kBilinear &&
      batch.size < 2)
    return InvalidArgument("N3MR: the bilinear reduction needs images of two pixels a side");
  if (images_.size() < batch.cameras.size()) images_.resize(batch.cameras.size());
  workers_.ForParts(batch.cameras.size(), [&](std::size_t n, const Workers::Part& part) {
    Image& image = images_[n];
    image.Project(batch, n);
    const std::span<T> out = alpha.subspan(n * batch.pixels(), batch.pixels());
    if (options.rule == Rule::kSoftRas) {
      image.SoftRas(part, options.softras, batch.size, out);
    } else {
      image.N3mr(part, options.n3mr, batch.size, out);
    }
  });
  return {};
}

template <class T>
Status RendererT<T>::Backward(const BatchT<T>& batch, const Options& options,
                              std::span<const T> d_alpha, std::span<T> d_positions) {
  TILEGRAD_TRY(CheckBatch(batch, d_alpha.size()));
  if (d_positions.size() != batch.positions.size()) {
    return InvalidArgument("the gradient of positions has {} numbers, expected {}",
                           d_positions.size(), batch.positions.size());
  }
  if (images_.size() < batch.cameras.size())
    return InvalidArgument("{} images were rendered, but there are {} cameras", images_.size(),
                           batch.cameras.size());
  workers_.ForParts(batch.cameras.size(), [&](std::size_t n, const Workers::Part& part) {
    Image& image = images_[n];
    image.d_corners.resize(image.corners.size());
    const std::span<const T> pushes = d_alpha.subspan(n * batch.pixels(), batch.pixels());
    if (options.rule == Rule::kSoftRas) {
      image.SoftRasAdjoint(part, options.softras, batch.size, pushes);
    } else {
      image.N3mrAdjoint(part, options.n3mr, pushes);
    }
    image.ProjectAdjoint(batch, n);
  });
  const std::size_t numbers = 3 * batch.vertices();
  workers_.For(batch.meshes, [&](std::size_t b, std::size_t) {
    const std::span<T> sum = d_positions.subspan(b * numbers, numbers);
    std::fill(sum.begin(), sum.end(), T(0));
    for (std::size_t v = 0; v < batch.views(); ++v) {
      const auto& part = images_[b * batch.views() + v].d_positions;
      for (std::size_t i = 0; i < numbers; ++i) sum[i] += part[i];
    }
  });
  return {};
}

template class RendererT<float>;
template class RendererT<double>;

}  // namespace tilegrad::rivals
