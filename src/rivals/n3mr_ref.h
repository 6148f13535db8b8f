// SPDX-License-Identifier: Apache-2.0
// Scalar reference of n3mr.h: every face at every pixel, every pixel of every line. The drawing: T
// float, double, std::complex<double>; the sweep, which is no derivative: float or double.
#pragma once

#include <array>
#include <vector>

#include "rivals/n3mr.h"
#include "rivals/n3mr_sweep.h"

namespace tilegrad::rivals {

// A drawing: an ordinary z-buffer.
template <class T>
struct N3mrDrawingRef {
  int inner;
  std::vector<N3mrFaceT<T>> faces;
  std::vector<std::int32_t> owner;        // [inner,inner] index into faces, -1: none
  std::vector<T> depth;                   // far_plane if there is no face
  std::vector<std::array<T, 3>> weights;  // of the owner's corners, clipped

  N3mrDrawingRef(std::span<const T> corners, int size, const N3mrOptions& options)
      : inner(options.Inner(size)) {
    const auto pixels = static_cast<std::size_t>(inner) * static_cast<std::size_t>(inner);
    owner.assign(pixels, -1);
    depth.assign(pixels, T(options.far_plane));
    weights.resize(pixels);
    ForN3mrFaces(corners, options, options.Scale(size),
                 [&](const N3mrFaceT<T>& face) { Draw(face, options); });
  }

 private:
  void Draw(const N3mrFaceT<T>& face, const N3mrOptions& options) {
    faces.push_back(face);
    for (std::size_t p = 0; p < owner.size(); ++p) {
      const T px = CentreX<T>(static_cast<int>(p) % inner, inner);
      const T py = -CentreY<T>(static_cast<int>(p) / inner, inner);  // row 0 at the bottom
      T b[3], w[3];
      BarycentricWeights(face.at, face.area2, px, py, b);
      if (!(RealPart(b[0]) >= 0 && RealPart(b[1]) >= 0 && RealPart(b[2]) >= 0)) continue;
      ClippedWeights(b, w);
      const T z = DepthAt(face.at, w);
      if (!(RealPart(z) > options.near_plane && RealPart(z) < RealPart(depth[p]))) continue;
      owner[p] = static_cast<std::int32_t>(faces.size()) - 1;
      depth[p] = z;
      weights[p] = {w[0], w[1], w[2]};
    }
  }
};

// Adds the gradient of faces[f] to d_corners [3,3] of its source.
template <class T>
void SweepFaceRef(const N3mrFaceT<T>& face, std::int32_t f, const SweepImages<T>& images,
                  const N3mrOptions& options, double scale, T* d_corners) {
  const T per_pixel = T(2) / T(images.inner), eps = static_cast<T>(options.eps);
  for (int edge = 0; edge < 3; ++edge) {
    for (const SweepAxis axis : {SweepAxis::kY, SweepAxis::kX}) {
      const SweepEdge<T> e = SweepEdgeOf(face.at, edge, axis, images.inner);
      SweepEnds<T> ends;
      ForSweepLines(e, images.inner, options.floor_lines, [&](const SweepLine<T>& line) {
        const std::size_t in = images.Pixel(axis, line.line, line.in);
        const std::size_t out = images.Pixel(axis, line.line, line.out);
        const auto add = [&](int at, std::size_t from) {
          const T gain = images.Gain(images.Pixel(axis, line.line, at), from);
          if (gain > 0) AddSweep(line, at, gain, per_pixel, eps, &ends);
        };
        if (images.owner[in] == f) {
          for (int d = line.out; d >= 0 && d < images.inner; d += e.outward) add(d, in);
        }
        const InnerPixels inside = InnerPixelsOf(e, line, images.inner);
        for (int d = inside.first; d <= inside.last; ++d) {
          if (images.owner[images.Pixel(axis, line.line, d)] == f) add(d, out);
        }
      });
      AddSweepEnds(face, edge, axis, scale, ends, d_corners);
    }
  }
}

// Coverage, 0 or 1, of a drawing.
template <class T>
std::vector<T> CoverageOf(const N3mrDrawingRef<T>& drawing) {
  std::vector<T> out(drawing.owner.size());
  for (std::size_t p = 0; p < out.size(); ++p) out[p] = drawing.owner[p] < 0 ? T(0) : T(1);
  return out;
}

// alpha: [size,size].
template <class T>
void N3mrForwardRef(std::span<const T> corners, int size, const N3mrOptions& options,
                    std::span<T> alpha) {
  const N3mrDrawingRef<T> drawing(corners, size, options);
  ReduceN3mr<T>(options, size, CoverageOf(drawing), alpha);
}

// The sweep's gradient through alpha: adds to d_corners [F,3,3]; that of z is 0.
template <class T>
void N3mrBackwardRef(std::span<const T> corners, int size, const N3mrOptions& options,
                     std::span<const T> d_alpha, std::span<T> d_corners) {
  const N3mrDrawingRef<T> drawing(corners, size, options);
  const std::vector<T> coverage = CoverageOf(drawing);
  std::vector<T> d_coverage(coverage.size());
  ReduceN3mrAdjoint<T>(options, size, d_alpha, d_coverage);
  const SweepImages<T> images{drawing.inner, 1, coverage, d_coverage, drawing.owner};
  for (std::size_t f = 0; f < drawing.faces.size(); ++f) {
    const N3mrFaceT<T>& face = drawing.faces[f];
    SweepFaceRef(face, static_cast<std::int32_t>(f), images, options, options.Scale(size),
                 &d_corners[kCornerNumbers * static_cast<std::size_t>(face.source)]);
  }
}

}  // namespace tilegrad::rivals
