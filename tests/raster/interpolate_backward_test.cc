// SPDX-License-Identifier: Apache-2.0
// interpolate_backward.h against interpolate_ref.h in double, on every target: any width, any
// number of channels, both modes, bands that do not begin at the image's top.
#include "raster/interpolate_backward.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "base/rng.h"
#include "base/simd_target.h"
#include "raster/conventions.h"
#include "raster/interpolate_ref.h"
#include "raster/mesh_cast.h"
#include "raster/visibility_ref.h"
#include "support/expect.h"

namespace tilegrad::raster::interpolate_backward_test {

// A jittered grid of cells, two faces each, over an image; some of them missing. Faces are several
// pixels high, so that nothing is ill-conditioned.
ScreenMeshBuffers JitteredGrid(int width, int height, Rng* rng) {
  constexpr int kCell = 5;
  ScreenMeshBuffers out;
  const int columns = width / kCell + 1, rows = height / kCell + 1;
  for (int i = 0; i <= rows; ++i) {
    for (int j = 0; j <= columns; ++j) {
      const double depth = rng->Uniform(1, 3);
      out.x.push_back(static_cast<float>(kCell * j + rng->Uniform(-1, 1)));
      out.y.push_back(static_cast<float>(kCell * i + rng->Uniform(-1, 1)));
      out.depth.push_back(static_cast<float>(depth));
      out.inverse_depth.push_back(static_cast<float>(1 / depth));
    }
  }
  const auto add = [&](int a, int b, int c) {
    if (rng->Uniform() < 0.2) return;
    out.source_face.push_back(static_cast<std::int32_t>(out.v0.size()));
    out.v0.push_back(a);
    out.v1.push_back(b);
    out.v2.push_back(c);
    out.reject.push_back(kFaceDrawn);
  };
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const int a = i * (columns + 1) + j, c = a + columns + 1;
      add(a, a + 1, c);
      add(a + 1, c + 1, c);
    }
  }
  out.packed.resize(out.x.size());
  out.Pack(0, out.x.size());
  out.source_vertices = static_cast<std::int32_t>(out.x.size());
  out.source_faces = static_cast<std::int32_t>(out.v0.size());
  out.width = width;
  out.height = height;
  return out;
}

// A band with everything that is read and the truth.
struct Case {
  int width, row_begin, row_end, channels;
  Interpolation mode;
  Rate rate;
  ScreenMeshBuffers mesh;
  std::vector<float> attributes, d_out;          // [rows,C], [C][band]
  std::vector<std::int32_t> faces;               // [band]
  std::vector<double> d_vertices, d_attributes;  // [V][3], as attributes
  // What rounding is measured by: sums of |g| |grad b| max |a| over the pixels of a vertex's faces.
  std::vector<double> vertex_scale;

  std::size_t band_pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(row_end - row_begin);
  }
  std::size_t rows() const { return rate == Rate::kVertex ? mesh.x.size() : 3 * mesh.v0.size(); }

  Case(int w, int c, Interpolation m, Rate r, Rng* rng)
      : width(w), row_begin(3), row_end(16), channels(c), mode(m), rate(r) {
    mesh = JitteredGrid(width, 20, rng);
    attributes.resize(rows() * static_cast<std::size_t>(channels));
    for (float& a : attributes) a = static_cast<float>(rng->Uniform(-1, 1));
    d_out.resize(band_pixels() * static_cast<std::size_t>(channels));
    for (float& d : d_out) d = static_cast<float>(rng->Uniform(-1, 1));
    std::vector<std::int32_t> image(static_cast<std::size_t>(width) * 20, kNoFace);
    VisibilityRef<float>(mesh.View(), row_begin, row_end, image);
    const auto first = static_cast<std::size_t>(row_begin * width);
    faces.assign(image.begin() + static_cast<std::ptrdiff_t>(first),
                 image.begin() + static_cast<std::ptrdiff_t>(first + band_pixels()));
    FindTruth();
  }

 private:
  void FindTruth() {
    const ScreenMeshBuffersT<double> buffers = MeshCast<double>(mesh);
    const ScreenMeshT<double> view = buffers.View();
    const std::vector<double> values(attributes.begin(), attributes.end());
    const AttributeViewT<const double> in{values, channels, rate};
    d_attributes.assign(values.size(), 0);
    vertex_scale.assign(mesh.x.size(), 0);
    std::vector<double> d[3], none;
    for (auto& array : d) array.assign(mesh.x.size(), 0);
    for (std::size_t i = 0; i < faces.size(); ++i) {
      if (faces[i] == kNoFace) continue;
      const auto f = static_cast<std::size_t>(faces[i]), w = static_cast<std::size_t>(width);
      const double px = static_cast<double>(i % w) + 0.5;
      const double py = static_cast<double>(i / w) + row_begin + 0.5;
      const FacePlane<double> plane = MakeFacePlane(view, f);
      std::vector<double> g;
      double size = 0, slope = 1;
      for (int c = 0; c < channels; ++c) {
        g.push_back(d_out[static_cast<std::size_t>(c) * band_pixels() + i]);
        size += std::abs(g.back());
      }
      InterpolateRefBackward<double>(view, in, plane, f, mode,
                                     PixelWeightsRef<double>(view, plane, f, mode, px, py), g,
                                     {d[0], d[1], d[2], none}, {d_attributes, channels, rate});
      for (int k = 0; k < 3; ++k) slope += std::hypot(plane.gx[k], plane.gy[k]);
      for (int k = 0; k < 3; ++k) {
        vertex_scale[static_cast<std::size_t>(view.vertex(f, k))] += size * slope;
      }
    }
    for (std::size_t v = 0; v < mesh.x.size(); ++v) {
      for (const auto& array : d) d_vertices.push_back(array[v]);
    }
  }
};

// What the band's faces add to vertices and attributes.
struct Gradients {
  std::vector<double> d_vertices, d_attributes;
};

Gradients Differentiate(const Case& c, const BackwardRequest& request, BandSums* sums) {
  const ScreenMesh mesh = c.mesh.View();
  const InterpolateInput input{&mesh, {c.attributes, c.channels, c.rate}, c.mode, false};
  SumBand(input,
          {{c.faces.data(), c.width, 0, c.row_begin, c.row_end},
           {c.d_out.data(), static_cast<std::ptrdiff_t>(c.band_pixels()), c.width}},
          sums);
  Gradients out{std::vector<double>(3 * c.mesh.x.size(), 0),
                std::vector<double>(c.attributes.size(), 0)};
  if (sums->faces() == 0) return out;
  const std::size_t stride = sums->stride();
  std::vector<float> d_faces(4 * stride * FaceGradientArrays(c.channels, request));
  FinishBand(input, *sums, request, d_faces);
  for (std::size_t s = 1; s < sums->count; ++s) {
    const auto f = static_cast<std::size_t>(sums->face[s]);
    const float* from = d_faces.data() + 4 * s;
    for (int k = 0; k < 3 && request.geometry; ++k, from += 4 * stride) {
      const auto v = static_cast<std::size_t>(mesh.vertex(f, k));
      for (std::size_t i = 0; i < 3; ++i) out.d_vertices[3 * v + i] += from[i];
    }
    for (int group = 0; 3 * group < c.channels && request.attributes; ++group) {
      for (int k = 0; k < 3; ++k, from += 4 * stride) {
        const auto row = c.rate == Rate::kVertex ? static_cast<std::size_t>(mesh.vertex(f, k))
                                                 : 3 * f + static_cast<std::size_t>(k);
        for (int i = 3 * group; i < std::min(3 * group + 3, c.channels); ++i) {
          out.d_attributes[row * static_cast<std::size_t>(c.channels) +
                           static_cast<std::size_t>(i)] += from[i - 3 * group];
        }
      }
    }
  }
  return out;
}

// Each pixel adds products of g, grad b and a that were rounded about 30 times; d_inverse_depth is
// multiplied by depths up to 3, twice.
constexpr double kTolerance = 9 * 30 * 0x1p-24;
constexpr double kMostPixels = 100;  // of the faces of a vertex, six of 12.5 pixels, jittered

void ExpectClose(const Case& c, const BackwardRequest& request, BandSums* sums,
                 const std::string& what) {
  const Gradients got = Differentiate(c, request, sums);
  for (std::size_t v = 0; v < c.mesh.x.size() && request.geometry; ++v) {
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_NEAR(got.d_vertices[3 * v + i], c.d_vertices[3 * v + i],
                  kTolerance * c.vertex_scale[v])
          << what << ", vertex " << v << ", number " << i;
    }
  }
  double scale = 0;  // weights are at most 1: no slopes
  for (const float g : c.d_out) scale = std::max(scale, static_cast<double>(std::abs(g)));
  for (std::size_t i = 0; i < got.d_attributes.size() && request.attributes; ++i) {
    ASSERT_NEAR(got.d_attributes[i], c.d_attributes[i], kTolerance * scale * kMostPixels)
        << what << ", attribute " << i;
  }
}

class InterpolateBackward : public testing::Test {
 protected:
  void TearDown() override { ASSERT_TRUE(ForceTarget("").ok()); }
};

TEST_F(InterpolateBackward, EqualsTheReferenceForAnyWidthAndChannels) {
  Rng rng(31, 1);
  BandSums sums;  // of one worker: bands of all sizes follow each other
  for (int width = 1; width <= 40; ++width) {
    const auto mode = width % 2 == 0 ? Interpolation::kPerspective : Interpolation::kScreenLinear;
    const auto rate = width % 3 == 0 ? Rate::kCorner : Rate::kVertex;
    const Case c(width, 1 + width % 8, mode, rate, &rng);
    for (const std::string target : EveryTarget()) {
      const std::string what = target + ", width " + std::to_string(width);
      ExpectClose(c, {true, true}, &sums, what);
      ExpectClose(c, {true, false}, &sums, what + ", geometry");
      ExpectClose(c, {false, true}, &sums, what + ", attributes");
    }
  }
}

TEST_F(InterpolateBackward, ABandOfBackgroundSeesNoFace) {
  Rng rng(32, 1);
  Case c(17, 3, Interpolation::kPerspective, Rate::kVertex, &rng);
  c.faces.assign(c.faces.size(), kNoFace);
  for (const std::string target : EveryTarget()) {
    BandSums sums;
    Differentiate(c, {true, true}, &sums);
    EXPECT_EQ(sums.faces(), 0u) << target;
  }
}

}  // namespace tilegrad::raster::interpolate_backward_test
