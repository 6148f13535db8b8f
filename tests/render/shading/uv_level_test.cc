// SPDX-License-Identifier: Apache-2.0
// Mip levels, and sides, of faces that float has trouble with: those that reach past the camera.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/rng.h"
#include "raster/interpolate_ref.h"
#include "raster/mesh_cast.h"
#include "render/reference.h"
#include "render/shading/run.h"
#include "tilegrad/renderer.h"

namespace tilegrad::uv_level_test {

constexpr int kWidth = 48, kHeight = 40;

RenderOptions Options() {
  RenderOptions options;
  options.width = kWidth;
  options.height = kHeight;
  return options;
}

// A triangle of random corners, most of them on both sides of the near plane.
template <class T>
struct Wall {
  std::vector<T> positions, uvs;
  std::vector<std::int32_t> faces = {0, 1, 2};
  CameraT<T> camera;

  Wall(double reach, double near_plane, Rng* rng) {
    for (int i = 0; i < 9; ++i) positions.push_back(Number(rng->Uniform(-reach, reach)));
    for (int i = 0; i < 6; ++i) uvs.push_back(Number(rng->Uniform(0, 8)));
    camera.fx = camera.fy = 20;
    camera.cx = kWidth / 2;
    camera.cy = kHeight / 2;
    camera.near_plane = Number(near_plane);
  }
  // What float holds.
  static T Number(double x) { return static_cast<T>(static_cast<float>(x)); }

  SceneT<T> View() const { return {.positions = positions, .faces = faces, .camera = camera}; }
};

// Of one mesh the levels are the same in either type, up to a rounding of a logarithm below 32 and
// of a quotient in it.
TEST(UvLevels, OfFloatMeshesLoseNothingInTheSetUp) {
  Rng rng(1, 1);
  int levels = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Wall<float> wall(4, 0.01, &rng);
    PreparedScene<float> scene;
    const Scene view = wall.View();
    PrepareRef(view, {wall.uvs, 2, Rate::kVertex}, Options(), &scene);
    const auto buffers = raster::MeshCast<double>(scene.buffers);
    const raster::ScreenMeshT<double> mesh = buffers.View();
    const std::vector<double> values(scene.attributes.values.begin(),
                                     scene.attributes.values.end());
    const raster::AttributeViewT<const double> attributes{values, 2, Rate::kVertex};
    for (std::size_t f = 0; f < mesh.faces(); ++f) {
      if (mesh.reject[f] != raster::kFaceDrawn) continue;
      const auto mode = Interpolation::kPerspective;
      const UvPlanes narrow = UvPlanesOf(scene.mesh, scene.attributes, 0, f, mode);
      const UvPlanes wide = UvPlanesOf(mesh, attributes, 0, f, mode);
      const auto plane = raster::MakeFacePlane(mesh, f);
      for (int at = 0; at < kWidth * kHeight; at += 7) {
        const int x = at % kWidth, y = at / kWidth, size[2] = {256, 256};
        if (!raster::Covers(raster::SnapFaceClockwise(mesh, f), x, y)) continue;
        const auto weights = raster::PixelWeightsRef(mesh, plane, f, mode, x + 0.5, y + 0.5);
        double uv[2];
        raster::InterpolateRef<double>(mesh, attributes, f, weights, uv);
        const float got = UvLevel<float>(narrow, x + 0.5, y + 0.5, uv, size);
        EXPECT_NEAR(got, UvLevel<double>(wide, x + 0.5, y + 0.5, uv, size), 4e-6) << trial;
        ++levels;
      }
    }
  }
  EXPECT_GT(levels, 9000);
}

template <class T>
SceneT<T> TwoSided(const Wall<T>& wall) {
  SceneT<T> scene = wall.View();
  scene.shading.normals = Normals::kFlat;
  scene.shading.two_sided = true;
  return scene;
}

// Cut at a hundred millionth of their size faces reach so far out of the image that the sign of
// their area there is beyond float. A normal turned the wrong way would be off by 2.
TEST(Sides, OfFacesThatReachFarOutAreTheReferences) {
  Renderer renderer{{.threads = 1}};
  Outputs request;
  request.color = request.alpha = false;
  request.normals = true;
  int pixels = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    Rng rng(seed, 2), same(seed, 2);
    const Wall<float> wall(100, 1e-6, &rng);
    const Wall<double> wide(100, 1e-6, &same);
    const Scene scene = TwoSided(wall);
    Frame frame;
    ASSERT_TRUE(renderer.Render({&scene, 1}, Options(), request, &frame).ok());
    const Images& images = frame.images();
    FrameImagesT<double> truth;
    ReferenceRender(TwoSided(wide), Options(), request, images.face_ids, &truth);
    int off = 0;
    for (std::size_t i = 0; i < images.normals.size(); ++i) {
      off += std::abs(static_cast<double>(images.normals[i]) - truth.normals[i]) > 1e-3;
    }
    EXPECT_EQ(off, 0) << "scene " << seed;
    for (const std::int32_t id : images.face_ids) pixels += id >= 0;
  }
  EXPECT_GT(pixels, 50000);
}

}  // namespace tilegrad::uv_level_test
