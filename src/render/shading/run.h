// SPDX-License-Identifier: Apache-2.0
// A run of pixels of one surface, from interpolated values to colour, and its adjoint: runs the
// kernels of src/shade in sequence, according to the plan.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/scalar.h"
#include "raster/attributes.h"
#include "raster/face_plane.h"
#include "raster/screen_mesh.h"
#include "render/scene_fields.h"
#include "render/shading/plan.h"
#include "shade/combine.h"
#include "shade/lambert.h"
#include "shade/pixel_run.h"
#include "shade/spherical_harmonics.h"
#include "shade/texture.h"
#include "shade/texture_levels.h"
#include "shade/vec3_ref.h"

namespace tilegrad {

// What the pixels of a surface in an image share.
struct RunScene {
  const ShadingModel* shading;
  const Surface* surface;
  std::span<const Light> lights;  // unit directions; empty: one direction per pixel
  const shade::ShPolynomial* sh;
  const shade::TexturePyramid* texture;  // null: none
  shade::Vec3<float> eye;                // the camera's position

  shade::ColorFactors factors() const;
};

// Planes of a run. Interpolated: vertex_color, uv, normal, position, light (raw). Computed: the
// others.
struct RunValues {
  shade::RunPlane vertex_color[3], uv[2], normal[3], position[3], light_direction[3];
  shade::RunPlane side;   // 1 or -1: factor of normals; with ShadeSteps::turn
  shade::RunPlane level;  // mip level
  shade::RunPlane texture[3], unit[3], inverse_length, eye[3], inverse_eye, unit_light[3],
      inverse_light, light, highlight, color[3];
};

// Cotangents. `color` is given and, if normals are an image, `unit`; the others are computed.
struct RunCotangents {
  shade::RunPlane color[3], unit[3];
  shade::RunPlane vertex_color[3], uv[2], normal[3], position[3], light_direction[3];
  shade::RunPlane texture[3], light, highlight, eye[3];
};

// The list of interpolated values: calls visit(varying, its planes), of RunValues or RunCotangents.
template <class Run, class Visit>
void ForEachVarying(Run& run, const Visit& visit) {
  visit(Varying::kColor, std::span(run.vertex_color));
  visit(Varying::kUv, std::span(run.uv));
  visit(Varying::kNormal, std::span(run.normal));
  visit(Varying::kPosition, std::span(run.position));
  visit(Varying::kLightDirection, std::span(run.light_direction));
}

// Sums of cotangents over pixels, for what pixels share.
struct SurfaceSums {
  shade::ColorFactorsT<double> factors = {};
  double shininess = 0;
};
struct SceneSums {
  std::vector<SurfaceSums> surfaces;
  std::vector<LightT<double>> lights;  // by unit directions
  shade::ShPolynomialT<double> sh = {};
  shade::Vec3<double> eye = {};
  // For depth = -(z . p + t_z), z the third row of the rotation.
  shade::Vec3<double> depth_axis = {};
  double depth_shift = 0;

  void Clear(std::size_t surface_count, std::size_t light_count);
};

// Counts and milliseconds of the shading kernels in a call.
struct ShadeWork {
  std::int64_t pixels = 0, lookups = 0, normals = 0, lit = 0, highlights = 0;
  double gather = 0, normal = 0, texture = 0, light = 0, color = 0, adjoint = 0, scatter = 0;

  void Add(const ShadeWork& other);
};

// Fills everything that `steps` request except colour.
void ShadeRun(std::size_t count, const ShadeSteps& steps, const RunScene& scene, RunValues* v,
              ShadeWork* work);
// Computes colour, after ShadeRun.
void ColorRun(std::size_t count, const ForwardPlan& plan, const RunScene& scene, RunValues* v);

// The destinations of a run's adjoint. `shares` null: not requested.
struct RunTargets {
  RunCotangents* d;
  SurfaceSums* surface;
  SceneSums* scene;
  shade::TexelShare* shares;
};

// From ShadeRun's values, d->color (if wishes.d_color) and d->unit (if wishes.d_normals, else
// anything), computes the cotangents of the pulled varyings.
void ShadeRunAdjoint(std::size_t count, const BackwardPlan& plan, const RunScene& scene,
                     const RunValues& v, const RunTargets& out);

// The mip level for a pixel: log2 of the texels crossed by one pixel step on the screen, the longer
// of the steps right and down (L. Williams, Pyramidal parametrics, 1983).
//
// With u = N / Q over a face (raster/interpolate.h), du/dx = (dN/dx - u dQ/dx) / Q. Planes are in
// double for any T: a face clipped at the near plane may show only its far end, where that
// difference is tiny compared with N and Q elsewhere.

// Derivatives of (u, v) over a face, as planes: N of each, and Q.
struct UvPlanes {
  double n_x[2] = {}, n_y[2] = {};
  double q_x = 0, q_y = 0, q = 0;  // q: at (x0, y0)
  double x0 = 0, y0 = 0, least_q = 0;
};

// Screen-space gradient of a quantity that is v0, v1, v2 at the corners of a face.
inline void SetSlopes(const raster::FacePlane<double>& face, double v0, double v1, double v2,
                      double* x, double* y) {
  *x = face.gx[1] * (v1 - v0) + face.gx[2] * (v2 - v0);
  *y = face.gy[1] * (v1 - v0) + face.gy[2] * (v2 - v0);
}

// Channels [first, first + 2) of the attributes are u, v.
template <class T>
UvPlanes UvPlanesOf(const raster::ScreenMeshT<T>& mesh,
                    const raster::AttributeViewT<const T>& attributes, int first, std::size_t face,
                    Interpolation mode) {
  const raster::ScreenCorners<double> corners = raster::Wide(raster::CornersOf(mesh, face));
  const raster::FacePlane<double> plane = raster::MakeFacePlane(corners);
  const bool perspective = mode == Interpolation::kPerspective;
  double m[3], n[2][3];
  for (int k = 0; k < 3; ++k) {
    m[k] = perspective ? corners.z[k] : 1.0;
    const T* const uv = attributes.corner(mesh, face, k) + first;
    for (int i = 0; i < 2; ++i) n[i][k] = m[k] * RealPart(uv[i]);
  }
  UvPlanes out;
  for (int i = 0; i < 2; ++i) {
    SetSlopes(plane, n[i][0], n[i][1], n[i][2], &out.n_x[i], &out.n_y[i]);
  }
  SetSlopes(plane, m[0], m[1], m[2], &out.q_x, &out.q_y);
  out.x0 = plane.x0;
  out.y0 = plane.y0;
  out.q = plane.base[0] * m[0] + plane.base[1] * m[1] + plane.base[2] * m[2];
  out.least_q = raster::LeastQ(plane, m);
  return out;
}

// The level at pixel centre (px, py), with coordinates (u, v), for a texture of this size. Real:
// float, whose logarithm is faster, or double.
template <class Real>
Real UvLevel(const UvPlanes& p, double px, double py, const double (&uv)[2], const int (&size)[2]) {
  const double q = std::max(p.q + p.q_x * (px - p.x0) + p.q_y * (py - p.y0), p.least_q);
  double across = 0, down = 0;
  for (int i = 0; i < 2; ++i) {
    const double texels = size[i] / q;
    const double x = (p.n_x[i] - uv[i] * p.q_x) * texels;
    const double y = (p.n_y[i] - uv[i] * p.q_y) * texels;
    across += x * x;
    down += y * y;
  }
  const double most = std::clamp(std::max(across, down), 1e-30, 1e30);
  return Real(0.5) * std::log2(static_cast<Real>(most));
}

// Given normals and light directions may have any length. Interpolated ones below a threshold count
// as having no direction (shade/normalize.h), so the threshold must be relative to the others.

// The power of two that scales the largest component of `directions` to about 1; 1 if it is so
// already. It changes neither normalised directions nor, as a constant, their derivative.
template <class T>
auto DirectionScale(std::span<const T> directions) {
  using Real = decltype(RealPart(T()));
  Real most = 0;
  for (const T& x : directions) most = std::max(most, std::abs(RealPart(x)));
  if (most == 0 || (most >= Real(0.0625) && most <= Real(16))) return Real(1);
  return std::ldexp(Real(1), std::clamp(-std::ilogb(most), -126, 126));  // representable in float
}

// The factor on a scene's stream before interpolation, and on its gradient after.
template <class T>
auto StreamScale(const SceneT<T>& scene, Varying what) {
  const bool directions = what == Varying::kLightDirection ||
                          (what == Varying::kNormal && scene.shading.normals == Normals::kGiven);
  return DirectionScale(directions ? StreamOf(scene, what).values : std::span<const T>());
}

}  // namespace tilegrad
