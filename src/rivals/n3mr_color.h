// SPDX-License-Identifier: Apache-2.0
// Colours of N3MR. Each face owns a cube of texels [s][s][s], axis k belonging to corner k; a pixel
// samples it at u_k = w_k z / z_k (s - 1), with perspective-correct weights, and mixes the eight
// surrounding texels. A uniform cube gives a face colour.
#pragma once

#include <cstddef>
#include <span>

#include "rivals/n3mr.h"

namespace tilegrad::rivals {

struct N3mrColors {
  int resolution = 2;  // s, 2..32
  double background[3] = {0, 0, 0};

  std::size_t texels() const {  // per face
    const auto s = static_cast<std::size_t>(resolution);
    return s * s * s;
  }
};

// The texels of a face that a pixel mixes, and their weights.
template <class T>
struct N3mrTexels {
  std::size_t index[8];
  T weight[8];
};

// w, z: clipped weights of the drawn face's corners, and depth. `eps` keeps u below s - 1, as
// published: even at a corner the neighbour has weight eps. A face from behind has the same texels.
template <class T>
N3mrTexels<T> N3mrTexelsAt(const N3mrFaceT<T>& face, const T w[3], const T& z, int resolution,
                           double eps) {
  std::size_t first[3];
  T share[3];
  for (int k = 0; k < 3; ++k) {
    const double most = resolution - 1 - eps;
    T u = w[k] * z / face.at.z[k] * T(resolution - 1);
    if (!(RealPart(u) > 0)) u = T(0);
    if (RealPart(u) > most) u = T(most);
    const int corner = face.SourceCorner(k);
    const int cell = static_cast<int>(RealPart(u));
    first[corner] = static_cast<std::size_t>(cell);
    share[corner] = u - T(cell);
  }
  N3mrTexels<T> out;
  const auto s = static_cast<std::size_t>(resolution);
  for (std::size_t n = 0; n < 8; ++n) {
    out.index[n] = 0;
    out.weight[n] = T(1);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t up = n >> k & 1;
      out.index[n] = out.index[n] * s + first[k] + up;
      out.weight[n] *= up == 1 ? share[k] : T(1) - share[k];
    }
  }
  return out;
}

// cube: [s][s][s][3].
template <class T>
void MixTexels(const N3mrTexels<T>& at, const T* cube, T color[3]) {
  for (std::size_t c = 0; c < 3; ++c) {
    color[c] = T(0);
    for (std::size_t n = 0; n < 8; ++n) color[c] += at.weight[n] * cube[3 * at.index[n] + c];
  }
}

template <class T>
void MixTexelsAdjoint(const N3mrTexels<T>& at, const T g[3], T* d_cube) {
  for (std::size_t n = 0; n < 8; ++n) {
    for (std::size_t c = 0; c < 3; ++c) d_cube[3 * at.index[n] + c] += at.weight[n] * g[c];
  }
}

// The drawn images, or, as an adjoint, the cotangents of the requested ones: empty spans are
// absent. The sweep sums over all present images at once, so the gradient of colour and alpha
// together is not the sum of their separate gradients.
template <class T>
struct N3mrImages {
  std::span<T> color;  // [3,size,size]
  std::span<T> alpha;  // [size,size]
};

// Planes of a drawing, [inner,inner] each, and their adjoints: r, g, b, coverage.
template <class T>
struct N3mrPlanesT {
  AlignedVector<T> values, d_values;  // [4]
  // Sums for the sweep: of values times adjoints by row; the same by column, and the adjoints by
  // column.
  AlignedVector<T> row_sums, column_sums, d_columns;  // d_columns: [4]
};

// Inputs for colouring an image; after SetUpN3mr and DrawN3mr of all rows. T: float or double.
template <class T>
struct N3mrColorJob {
  const N3mrOptions& options;
  const N3mrColors& colors;
  const N3mrImageT<T>& image;
  std::span<const T> textures;  // [F,s,s,s,3]
};

// Allocates the planes; call from one thread.
template <class T>
void ReserveN3mrPlanes(const N3mrImageT<T>& image, N3mrPlanesT<T>* planes);
// Fills the planes in rows of the drawing.
template <class T>
void N3mrShade(const N3mrColorJob<T>& job, RowRange rows, N3mrPlanesT<T>* planes);
// Call after all rows: writes the requested images.
template <class T>
void N3mrReducePlanes(const N3mrColorJob<T>& job, const N3mrPlanesT<T>& planes,
                      const N3mrImages<T>& out);

template <class T>
void N3mrPrepareColorBackward(const N3mrColorJob<T>& job, const N3mrImages<const T>& d_images,
                              N3mrPlanesT<T>* planes);
template <class T>
struct N3mrColorAdjoints {
  std::span<T> d_corners;   // [F,3,3]
  std::span<T> d_textures;  // [F,s,s,s,3]
};
// Then overwrites `out` for faces [begin, end) as given.
template <class T>
void N3mrColorBackward(const N3mrColorJob<T>& job, const N3mrImages<const T>& d_images,
                       const N3mrPlanesT<T>& planes, std::size_t begin, std::size_t end,
                       const N3mrColorAdjoints<T>& out);

}  // namespace tilegrad::rivals
