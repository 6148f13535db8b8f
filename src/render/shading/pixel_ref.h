// SPDX-License-Identifier: Apache-2.0
// Reference of run.h: one pixel, from interpolated values to colour, and its adjoint. T: float,
// double, std::complex<double>.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "render/scene_fields.h"
#include "shade/combine_ref.h"
#include "shade/lambert_ref.h"
#include "shade/normalize_ref.h"
#include "shade/phong_ref.h"
#include "shade/spherical_harmonics_ref.h"
#include "shade/texture_levels_ref.h"

namespace tilegrad {

// The interpolated values, and properties of the pixel's face. Also their gradient.
template <class T>
struct ShadePixel {
  shade::Vec3<T> color = {T(1), T(1), T(1)};
  std::array<T, 2> uv = {T(0), T(0)};
  shade::Vec3<T> normal = {}, position = {}, light_direction = {};
  float side = 1;
  decltype(RealPart(T())) level = 0;
  std::size_t surface = 0;
};

// The list of interpolated values: calls visit(varying, its numbers).
template <class T, class Visit>
void ForEachPixelPart(ShadePixel<T>& p, const Visit& visit) {
  visit(Varying::kColor, std::span<T>(p.color));
  visit(Varying::kUv, std::span<T>(p.uv));
  visit(Varying::kNormal, std::span<T>(p.normal));
  visit(Varying::kPosition, std::span<T>(p.position));
  visit(Varying::kLightDirection, std::span<T>(p.light_direction));
}

// What pixels of a scene share. Also its gradient.
template <class T>
struct ShadeUniforms {
  std::vector<SurfaceT<T>> surfaces;
  std::vector<LightT<T>> lights;  // unit; empty: ShadePixel::light_direction
  shade::ShPolynomialT<T> sh = {};
  shade::Vec3<T> eye = {};
  std::vector<std::vector<T>> texels;  // gradients only: of all levels of each texture
};

template <class T>
shade::ColorFactorsT<T> FactorsOf(const ShadingModel& shading, const SurfaceT<T>& s) {
  if (shading.lighting != Lighting::kSphericalHarmonics) {
    return {s.base_color, s.ambient, s.diffuse, s.specular};
  }
  return {s.base_color, {T(0), T(0), T(0)}, {T(1), T(1), T(1)}, {T(0), T(0), T(0)}};
}

// Intermediate values in the colour of a pixel.
template <class T>
struct PixelValues {
  shade::UnitVector<T> normal, eye, light;
  std::vector<LightT<T>> lights;
  shade::ColorParts<T> parts;
  shade::Vec3<T> color;
};

template <class T>
class PixelShaderRef {
 public:
  PixelShaderRef(const ShadingModel& shading, const ShadeUniforms<T>& uniforms,
                 std::span<const shade::PyramidRef<T>> pyramids)
      : shading_(shading), uniforms_(uniforms), pyramids_(pyramids) {}

  PixelValues<T> Forward(const ShadePixel<T>& p) const {
    PixelValues<T> v;
    v.normal = shade::NormalizeRef(Turned(p.normal, p.side), shade::kLeastUnitSquare);
    v.parts.vertex_color = p.color;
    if (const auto* texture = TextureOf(p)) {
      v.parts.texture = shade::SampleRef(*texture, p.uv[0], p.uv[1], p.level);
    }
    if (Lit()) Light(p, &v);
    const auto factors = FactorsOf(shading_, uniforms_.surfaces[p.surface]);
    v.color = shade::CombineRef(factors, v.parts, Lit(), shading_.clamp);
    return v;
  }

  // Adds to *d and *d_uniforms. d_normal: by the unit normal.
  void Backward(const ShadePixel<T>& p, const shade::Vec3<T>& d_color,
                const shade::Vec3<T>& d_normal, ShadePixel<T>* d,
                ShadeUniforms<T>* d_uniforms) const {
    const PixelValues<T> v = Forward(p);
    const SurfaceT<T>& surface = uniforms_.surfaces[p.surface];
    shade::ColorFactorsT<T> d_factors = {};
    shade::ColorParts<T> d_parts = Zero();
    shade::CombineAdjointRef(FactorsOf(shading_, surface), v.parts, Lit(), shading_.clamp, d_color,
                             d_factors, d_parts);
    AddFactors(d_factors, &d_uniforms->surfaces[p.surface]);
    shade::AddScaled(T(1), d_parts.vertex_color, d->color);
    if (const auto* texture = TextureOf(p)) {
      const auto t = static_cast<std::size_t>(surface.texture);
      shade::SampleAdjointRef<T>(*texture, p.uv[0], p.uv[1], p.level, d_parts.texture, d->uv,
                                 d_uniforms->texels[t]);
    }
    shade::Vec3<T> d_unit = d_normal;
    if (Lit()) LightBackward(p, v, d_parts, &d_unit, d, d_uniforms);
    shade::Vec3<T> d_turned = {};
    shade::NormalizeAdjointRef(v.normal, d_unit, d_turned);
    shade::AddScaled(T(p.side), d_turned, d->normal);
  }

 private:
  bool Lit() const { return shading_.lighting != Lighting::kNone; }
  bool Phong() const { return shading_.lighting == Lighting::kPhong; }
  bool Sh() const { return shading_.lighting == Lighting::kSphericalHarmonics; }
  bool PerPixel() const { return uniforms_.lights.empty(); }

  static shade::Vec3<T> Turned(const shade::Vec3<T>& n, float side) {
    return {n[0] * T(side), n[1] * T(side), n[2] * T(side)};
  }
  static shade::ColorParts<T> Zero() {
    return {{T(0), T(0), T(0)}, {T(0), T(0), T(0)}, T(0), T(0)};
  }

  const shade::PyramidRef<T>* TextureOf(const ShadePixel<T>& p) const {
    const int texture = uniforms_.surfaces[p.surface].texture;
    return texture < 0 ? nullptr : &pyramids_[static_cast<std::size_t>(texture)];
  }

  void AddFactors(const shade::ColorFactorsT<T>& from, SurfaceT<T>* to) const {
    shade::AddScaled(T(1), from.base, to->base_color);
    if (!Lit() || Sh()) return;
    shade::AddScaled(T(1), from.ambient, to->ambient);
    shade::AddScaled(T(1), from.diffuse, to->diffuse);
    if (Phong()) shade::AddScaled(T(1), from.specular, to->specular);
  }

  shade::PhongVectors<T> VectorsOf(const PixelValues<T>& v, std::size_t k) const {
    return {v.normal.unit, v.lights[k].direction, v.eye.unit};
  }

  void Light(const ShadePixel<T>& p, PixelValues<T>* v) const {
    if (Sh()) {
      v->parts.light = shade::ShLightRef(uniforms_.sh, v->normal.unit);
      return;
    }
    v->lights = uniforms_.lights;
    if (PerPixel()) {
      v->light = shade::NormalizeRef(p.light_direction, shade::kLeastUnitSquare);
      v->lights = {{v->light.unit, T(1)}};
    }
    v->parts.light = shade::LambertRef<T>({T(0), v->lights}, v->normal.unit);
    if (!Phong()) return;
    v->eye = shade::NormalizeRef(shade::Minus(uniforms_.eye, p.position), shade::kLeastWorldSquare);
    const T& shininess = uniforms_.surfaces[p.surface].shininess;
    for (std::size_t k = 0; k < v->lights.size(); ++k) {
      v->parts.highlight += v->lights[k].intensity * shade::PhongRef(VectorsOf(*v, k), shininess);
    }
  }

  void LightBackward(const ShadePixel<T>& p, const PixelValues<T>& v,
                     const shade::ColorParts<T>& d_parts, shade::Vec3<T>* d_unit, ShadePixel<T>* d,
                     ShadeUniforms<T>* d_uniforms) const {
    if (Sh()) {
      shade::ShLightAdjointRef(uniforms_.sh, v.normal.unit, d_parts.light, d_uniforms->sh, *d_unit);
      return;
    }
    std::vector<LightT<T>> d_lights(v.lights.size(), shade::kNoLight<T>);
    shade::LambertAdjointRef<T>({T(0), v.lights}, v.normal.unit, d_parts.light, *d_unit, d_lights);
    if (Phong()) HighlightBackward(p, v, d_parts.highlight, d_unit, d, d_uniforms, &d_lights);
    if (PerPixel()) {
      shade::NormalizeAdjointRef(v.light, d_lights[0].direction, d->light_direction);
      return;
    }
    for (std::size_t k = 0; k < d_lights.size(); ++k) {
      shade::AddScaled(T(1), d_lights[k].direction, d_uniforms->lights[k].direction);
      d_uniforms->lights[k].intensity += d_lights[k].intensity;
    }
  }

  void HighlightBackward(const ShadePixel<T>& p, const PixelValues<T>& v, const T& d_highlight,
                         shade::Vec3<T>* d_unit, ShadePixel<T>* d, ShadeUniforms<T>* d_uniforms,
                         std::vector<LightT<T>>* d_lights) const {
    const T& shininess = uniforms_.surfaces[p.surface].shininess;
    shade::Vec3<T> d_eye = {};
    for (std::size_t k = 0; k < v.lights.size(); ++k) {
      const auto vectors = VectorsOf(v, k);
      shade::PhongVectors<T> d_vectors = {};
      (*d_lights)[k].intensity += d_highlight * shade::PhongRef(vectors, shininess);
      shade::PhongAdjointRef(vectors, shininess, d_highlight * v.lights[k].intensity, d_vectors,
                             &d_uniforms->surfaces[p.surface].shininess);
      shade::AddScaled(T(1), d_vectors.normal, *d_unit);
      shade::AddScaled(T(1), d_vectors.light, (*d_lights)[k].direction);
      shade::AddScaled(T(1), d_vectors.eye, d_eye);
    }
    shade::Vec3<T> d_toward = {};
    shade::NormalizeAdjointRef(v.eye, d_eye, d_toward);
    shade::AddScaled(T(-1), d_toward, d->position);
    shade::AddScaled(T(1), d_toward, d_uniforms->eye);
  }

  const ShadingModel& shading_;
  const ShadeUniforms<T>& uniforms_;
  std::span<const shade::PyramidRef<T>> pyramids_;
};

}  // namespace tilegrad
