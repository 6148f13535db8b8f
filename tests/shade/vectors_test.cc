// SPDX-License-Identifier: Apache-2.0
// Shading against results of other programs (independent test data; skipped where absent): texture
// lookups, spherical harmonics, Phong and Lambert.
#include <gtest/gtest.h>

#include <numbers>

#include "shade/combine_ref.h"
#include "shade/lambert_ref.h"
#include "shade/phong_ref.h"
#include "shade/spherical_harmonics_ref.h"
#include "shade/texture_ref.h"
#include "support/shared_data.h"

namespace tilegrad::shade::vectors_test {

using Vector = std::vector<double>;

// Both sides are in double; the data has 17 digits.
constexpr double kTolerance = 1e-12;

// [channel][row][column] to ours.
Vector Interleave(const Json& planes) {
  Vector out;
  for (std::size_t y = 0; y < planes[0].size(); ++y) {
    for (std::size_t x = 0; x < planes[0][0].size(); ++x) {
      for (const Json& plane : planes) out.push_back(plane[y][x]);
    }
  }
  return out;
}

struct OwnedTexture {
  Vector texels;
  TextureViewT<double> view;

  OwnedTexture(const Json& planes, Wrap wrap, Filter filter) : texels(Interleave(planes)) {
    view = {texels,
            static_cast<int>(planes[0][0].size()),
            static_cast<int>(planes[0].size()),
            static_cast<int>(planes.size()),
            wrap,
            filter};
  }
};

Vector Sample(const OwnedTexture& texture, const Json& uv) {
  Vector out(static_cast<std::size_t>(texture.view.channels));
  SampleLevelRef<double>(texture.view, uv[0], uv[1], out);
  return out;
}

void ExpectNear(const Vector& got, const Json& expected, const std::string& what,
                double tolerance = kTolerance) {
  ASSERT_EQ(got.size(), expected.size()) << what;
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_NEAR(got[i], expected[i].get<double>(), tolerance) << what << " " << i;
  }
}

TEST(VectorsTexture, ClampedWithCentresInside) {
  TILEGRAD_VECTORS_OR_SKIP(json, "05_texture_mapping.json");
  const Json &expected = json.at("clamp_align_false_border"), &uvs = json.at("random_uv");
  const OwnedTexture nearest(json.at("random_texture"), Wrap::kClamp, Filter::kNearest);
  const OwnedTexture bilinear(json.at("random_texture"), Wrap::kClamp, Filter::kBilinear);
  Vector d_texels(bilinear.texels.size());
  for (std::size_t i = 0; i < uvs.size(); ++i) {
    ExpectNear(Sample(nearest, uvs[i]), expected.at("nearest")[i], "nearest");
    ExpectNear(Sample(bilinear, uvs[i]), expected.at("bilinear")[i], "bilinear");
    Vector d_uv(2);
    const Vector d_color = json.at("random_grad_out")[i];
    SampleLevelAdjointRef<double>(bilinear.view, uvs[i][0], uvs[i][1], d_color, d_uv, d_texels);
    ExpectNear(d_uv, expected.at("bilinear_grad_uv")[i], "d_uv");
  }
  ExpectNear(d_texels, Interleave(expected.at("bilinear_grad_texture")), "d_texels");
}

Vec3<double> Vec(const Json& v) { return {v[0], v[1], v[2]}; }

// Values of the nine functions at n.
Vector BasisAt(const Vec3<double>& n) {
  Vector out;
  for (std::size_t i = 0; i < 9; ++i) {
    Vector one(9);
    one[i] = 1;
    out.push_back(ShLightRef(ShPolynomialOf<double>(one), n));
  }
  return out;
}

// Coefficients of radiance times pi, 2 pi / 3, pi / 4 by degree give irradiance.
double IrradianceFactor(std::size_t i) {
  constexpr double kPi = std::numbers::pi;
  return i == 0 ? kPi : i < 4 ? 2 * kPi / 3 : kPi / 4;
}

Vector Irradiance(Vector w) {
  for (std::size_t i = 0; i < 9; ++i) w[i] *= IrradianceFactor(i);
  return w;
}

double IrradianceAt(const Vector& w, const Vec3<double>& n) {
  return ShLightRef(ShPolynomialOf<double>(Irradiance(w)), n);
}

// Its constants have eleven digits.
constexpr double kPrinted = 1e-9;

TEST(VectorsHarmonics, BasisAndIrradiance) {
  TILEGRAD_VECTORS_OR_SKIP(json, "06_spherical_harmonics.json");
  const Json &normals = json.at("normals"), &w = json.at("lights9");
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Vec3<double> n = Vec(normals[i]);
    ExpectNear(BasisAt(n), json.at("kaolin_sh9_basis")[i], "basis", kPrinted);
    EXPECT_NEAR(IrradianceAt(w, n), json.at("kaolin_sh9_irradiance")[i].get<double>(), kPrinted);
  }
}

TEST(VectorsHarmonics, GradientsOfIrradiance) {
  TILEGRAD_VECTORS_OR_SKIP(json, "06_spherical_harmonics.json");
  const Json& normals = json.at("normals");
  const auto p = ShPolynomialOf<double>(Irradiance(json.at("lights9")));
  ShPolynomialT<double> d_p = {};
  for (std::size_t i = 0; i < normals.size(); ++i) {
    Vec3<double> d_n = {};
    ShLightAdjointRef(p, Vec(normals[i]), json.at("grad_weight")[i].get<double>(), d_p, d_n);
    ExpectNear({d_n.begin(), d_n.end()},
               json.at("kaolin_sh9_irradiance_grad_normals_of_sum_w_irr")[i], "d_normal", kPrinted);
  }
  Vector d_w(9);
  ShPolynomialAdjoint<double>(d_p, d_w);
  ExpectNear(Irradiance(d_w), json.at("kaolin_sh9_irradiance_grad_lights_of_sum_w_irr"), "d_w",
             kPrinted);
}

// The pixels of 07, under one light.
struct PhongVectorsFile {
  ColorFactorsT<double> factors;
  Vec3<double> light, texture;
  double shininess;

  explicit PhongVectorsFile(const Json& json)
      : factors{{1, 1, 1},
                Vec(json.at("material_rows_ambient_diffuse_specular")[0]),
                Vec(json.at("material_rows_ambient_diffuse_specular")[1]),
                Vec(json.at("material_rows_ambient_diffuse_specular")[2])},
        light(Vec(json.at("light"))),
        texture(Vec(json.at("texture_colour"))),
        shininess(json.at("shininess")) {}

  ColorParts<double> Parts(const PhongVectors<double>& v) const {
    const LightT<double> one{v.light, 1};
    return {
        texture, {1, 1, 1}, LambertRef<double>({0, {&one, 1}}, v.normal), PhongRef(v, shininess)};
  }
};

TEST(VectorsPhong, ColoursAndGradients) {
  TILEGRAD_VECTORS_OR_SKIP(json, "07_phong_lambert.json");
  const PhongVectorsFile file(json);
  ColorFactorsT<double> d_factors = {};
  Vec3<double> d_light = {}, d_texture = {};
  double d_shininess = 0;
  for (std::size_t i = 0; i < json.at("normal").size(); ++i) {
    const PhongVectors<double> v{Vec(json.at("normal")[i]), file.light, Vec(json.at("eye")[i])};
    const auto parts = file.Parts(v);
    const Vec3<double> color = CombineRef(file.factors, parts, true, true);
    ExpectNear({color.begin(), color.end()}, json.at("colour")[i], "colour");
    ColorParts<double> d_parts{{}, {}, 0, 0};
    CombineAdjointRef(file.factors, parts, true, true, Vec(json.at("grad_out")[i]), d_factors,
                      d_parts);
    PhongVectors<double> d_v{};
    PhongAdjointRef(v, file.shininess, d_parts.highlight, d_v, &d_shininess);
    const LightT<double> one{v.light, 1};
    LightT<double> d_one = kNoLight<double>;
    LambertAdjointRef<double>({0, {&one, 1}}, v.normal, d_parts.light, d_v.normal, {&d_one, 1});
    ExpectNear({d_v.normal.begin(), d_v.normal.end()}, json.at("grad_normal")[i], "d_normal");
    ExpectNear({d_v.eye.begin(), d_v.eye.end()}, json.at("grad_eye")[i], "d_eye");
    AddScaled(1.0, d_v.light, d_light);
    AddScaled(1.0, d_one.direction, d_light);
    AddScaled(1.0, d_parts.texture, d_texture);
  }
  ExpectNear({d_light.begin(), d_light.end()}, json.at("grad_light"), "d_light");
  ExpectNear({d_texture.begin(), d_texture.end()}, json.at("grad_texture_colour"), "d_texture");
  const Json& d_material = json.at("grad_material");
  ExpectNear({d_factors.ambient.begin(), d_factors.ambient.end()}, d_material[0], "d_ambient");
  ExpectNear({d_factors.diffuse.begin(), d_factors.diffuse.end()}, d_material[1], "d_diffuse");
  ExpectNear({d_factors.specular.begin(), d_factors.specular.end()}, d_material[2], "d_specular");
  EXPECT_NEAR(d_shininess, json.at("grad_shininess").get<double>(), kTolerance);
}

}  // namespace tilegrad::shade::vectors_test
