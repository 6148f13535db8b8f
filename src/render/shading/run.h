// SPDX-License-Identifier: Apache-2.0
// A run of pixels of one surface, from what was interpolated to colour, and back: the kernels of
// src/shade, one after the other, as the plan says.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/shading/plan.h"
#include "shade/combine.h"
#include "shade/lambert.h"
#include "shade/pixel_run.h"
#include "shade/spherical_harmonics.h"
#include "shade/texture.h"
#include "shade/texture_levels.h"
#include "shade/vec3_ref.h"

namespace tilegrad {

// What the pixels of a surface in an image have in common.
struct RunScene {
  const ShadingModel* shading;
  const Surface* surface;
  std::span<const Light> lights;  // unit directions; empty: one for each pixel
  const shade::ShPolynomial* sh;
  const shade::TexturePyramid* texture;  // null: none
  shade::Vec3<float> eye;                // the camera's position

  shade::ColorFactors factors() const;
};

// Planes of a run. Interpolated: vertex_color, uv, normal, position, light (raw). Computed: the
// others.
struct RunValues {
  shade::RunPlane vertex_color[3], uv[2], normal[3], position[3], light_direction[3];
  shade::RunPlane side;   // 1 or -1: normals are turned by it; with ShadeSteps::turn
  shade::RunPlane level;  // of the texture
  shade::RunPlane texture[3], unit[3], inverse_length, eye[3], inverse_eye, unit_light[3],
      inverse_light, light, highlight, color[3];
};

// Cotangents. `color` and, where normals are an image, `unit` are given; the others are computed.
struct RunCotangents {
  shade::RunPlane color[3], unit[3];
  shade::RunPlane vertex_color[3], uv[2], normal[3], position[3], light_direction[3];
  shade::RunPlane texture[3], light, highlight, eye[3];
};

// The list of what is interpolated: calls visit(varying, planes of it), of RunValues or
// RunCotangents.
template <class Run, class Visit>
void ForEachVarying(Run& run, const Visit& visit) {
  visit(Varying::kColor, std::span(run.vertex_color));
  visit(Varying::kUv, std::span(run.uv));
  visit(Varying::kNormal, std::span(run.normal));
  visit(Varying::kPosition, std::span(run.position));
  visit(Varying::kLightDirection, std::span(run.light_direction));
}

// Sums of cotangents over pixels, for what the pixels share.
struct SurfaceSums {
  shade::ColorFactorsT<double> factors = {};
  double shininess = 0;
};
struct SceneSums {
  std::vector<SurfaceSums> surfaces;
  std::vector<LightT<double>> lights;  // on unit directions
  shade::ShPolynomialT<double> sh = {};
  shade::Vec3<double> eye = {};
  // Of depth = -(z . p + t_z), z the third row of the rotation.
  shade::Vec3<double> depth_axis = {};
  double depth_shift = 0;

  void Clear(std::size_t surface_count, std::size_t light_count);
};

// What was done to pixels in a call, and the milliseconds it took.
struct ShadeWork {
  std::int64_t pixels = 0, lookups = 0, normals = 0, lit = 0, highlights = 0;
  double gather = 0, normal = 0, texture = 0, light = 0, color = 0, adjoint = 0, scatter = 0;

  void Add(const ShadeWork& other);
};

// Fills what `steps` ask for, but colour.
void ShadeRun(std::size_t count, const ShadeSteps& steps, const RunScene& scene, RunValues* v,
              ShadeWork* work);
// Colour, after ShadeRun.
void ColorRun(std::size_t count, const ForwardPlan& plan, const RunScene& scene, RunValues* v);

// Where the adjoint of a run goes. `shares` null: not wanted.
struct RunTargets {
  RunCotangents* d;
  SurfaceSums* surface;
  SceneSums* scene;
  shade::TexelShare* shares;
};

// Given ShadeRun's values and d->color (if the plan's wishes have it) and d->unit (likewise
// d_normals, else anything): the cotangents of the varyings that are pulled.
void ShadeRunAdjoint(std::size_t count, const BackwardPlan& plan, const RunScene& scene,
                     const RunValues& v, const RunTargets& out);

}  // namespace tilegrad
