// SPDX-License-Identifier: Apache-2.0
// The rules of conventions.h: fill rule, depth order, ties; on every instruction set.
#include "raster/visibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/rng.h"
#include "base/simd_target.h"
#include "raster/bin.h"
#include "raster/conventions.h"
#include "raster/coverage.h"
#include "raster/visibility_ref.h"

namespace tilegrad::raster::visibility_test {

// A mesh that is on the screen already.
struct Flat {
  int width, height;
  ScreenMeshBuffers buffers;

  Flat(int w, int h) : width(w), height(h) {}
  std::int32_t Vertex(double px, double py, double depth = 1) {
    buffers.x.push_back(static_cast<float>(px));
    buffers.y.push_back(static_cast<float>(py));
    buffers.depth.push_back(static_cast<float>(depth));
    buffers.inverse_depth.push_back(static_cast<float>(1 / depth));
    return static_cast<std::int32_t>(buffers.x.size()) - 1;
  }
  void AddFace(std::int32_t a, std::int32_t b, std::int32_t c) {
    const auto f = static_cast<std::int32_t>(buffers.v0.size());
    buffers.v0.push_back(a);
    buffers.v1.push_back(b);
    buffers.v2.push_back(c);
    buffers.source_face.push_back(f);
    buffers.reject.push_back(kFaceDrawn);
  }
  ScreenMesh Finish() {
    buffers.width = width;
    buffers.height = height;
    buffers.packed.resize(buffers.x.size());
    buffers.Pack(0, buffers.x.size());
    buffers.source_vertices = static_cast<std::int32_t>(buffers.x.size());
    buffers.source_faces = static_cast<std::int32_t>(buffers.v0.size());
    for (std::size_t f = 0; f < buffers.v0.size(); ++f) {
      buffers.reject[f] = ShapeReject(SnapFace(buffers.View(), f), false);
    }
    return buffers.View();
  }
};

DrawnFaces DrawnFacesOf(const ScreenMesh& mesh) {
  std::vector<std::uint8_t> reject(mesh.reject.begin(), mesh.reject.end());
  DrawnFaces out;
  SetUpFaces(mesh, /*cull_back=*/false, reject, {.drawn = &out});
  return out;
}

// Faces of a whole image, by bins.
std::vector<std::int32_t> Visible(const ScreenMesh& mesh) {
  const SquareGrid bins = BinGrid(mesh.width, mesh.height);
  const DrawnFaces drawn = DrawnFacesOf(mesh);
  BinListBuffers buffers;
  const BinLists lists = BinDrawnFaces(drawn, bins, &buffers);
  std::vector<std::int32_t> out(static_cast<std::size_t>(mesh.width) * mesh.height, -7);
  VisibilityBin bin;
  for (std::size_t b = 0; b < bins.cells(); ++b) {
    const PixelRect rect = bins.rect(b);
    ComputeVisibility(mesh, {drawn.storage, lists[b]}, rect, &bin);
    for (int i = rect.y0; i < rect.y1; ++i) {
      for (int j = rect.x0; j < rect.x1; ++j) {
        out[static_cast<std::size_t>(i) * mesh.width + j] =
            bin.face[(i - rect.y0) * kBinSize + j - rect.x0];
      }
    }
  }
  return out;
}

std::vector<std::int32_t> VisibleRef(const ScreenMesh& mesh) {
  std::vector<std::int32_t> out(static_cast<std::size_t>(mesh.width) * mesh.height);
  VisibilityRef<float>(mesh, 0, mesh.height, out);
  return out;
}

class VisibilityOnEveryTarget : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { ASSERT_TRUE(ForceTarget(GetParam()).ok()); }
  void TearDown() override { ASSERT_TRUE(ForceTarget("").ok()); }
};

// A rectangle of n x n jittered quads, each cut along a random diagonal with random winding; every
// vertex coordinate is a multiple of `grid` pixels, so many centres lie exactly on edges and
// corners.
Flat JitteredRectangle(int n, double cell, double grid, Rng* rng) {
  Flat flat(static_cast<int>(n * cell) + 3, static_cast<int>(n * cell) + 2);
  const auto snap = [&](double v) { return std::round(v / grid) * grid; };
  for (int r = 0; r <= n; ++r) {
    for (int c = 0; c <= n; ++c) {
      const bool border = r == 0 || c == 0 || r == n || c == n;
      const double amount = border ? 0 : 0.3 * cell;
      flat.Vertex(snap(1 + c * cell + rng->Uniform(-amount, amount)),
                  snap(1 + r * cell + rng->Uniform(-amount, amount)));
    }
  }
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c < n; ++c) {
      std::int32_t q[4] = {r * (n + 1) + c, r * (n + 1) + c + 1, (r + 1) * (n + 1) + c + 1,
                           (r + 1) * (n + 1) + c};
      const auto turn = static_cast<std::size_t>(rng->Below(2));
      flat.AddFace(q[turn], q[turn + 1], q[turn + 2]);
      if (rng->Below(2) == 0) std::swap(q[turn], q[turn + 2]);
      flat.AddFace(q[turn], q[turn + 2], q[(turn + 3) % 4]);
    }
  }
  return flat;
}

TEST_P(VisibilityOnEveryTarget, EveryPixelOfATriangulatedRectangleIsCoveredExactlyOnce) {
  Rng rng(5, 1);
  for (const double grid : {0.5, 0.25, 1.0 / 1024, 1e-7}) {
    for (int round = 0; round < 8; ++round) {
      Flat flat = JitteredRectangle(6 + round, 2.0 + round, grid, &rng);
      const ScreenMesh mesh = flat.Finish();
      std::vector<int> count(static_cast<std::size_t>(mesh.width) * mesh.height, 0);
      for (std::size_t f = 0; f < mesh.faces(); ++f) {
        if (mesh.reject[f] != kFaceDrawn) continue;
        const auto shape = SnapFaceClockwise(mesh, f);
        for (std::size_t p = 0; p < count.size(); ++p) {
          count[p] +=
              Covers(shape, static_cast<int>(p) % mesh.width, static_cast<int>(p) / mesh.width);
        }
      }
      const auto seen = Visible(mesh);
      const double end = 1 + (6 + round) * (2.0 + round);
      for (std::size_t p = 0; p < count.size(); ++p) {
        const double x = static_cast<int>(p) % mesh.width + 0.5;
        const double y = static_cast<int>(p) / mesh.width + 0.5;
        const bool inside = x >= 1 && x < end && y >= 1 && y < end;
        EXPECT_EQ(count[p], inside ? 1 : 0) << "pixel " << x << ", " << y << " grid " << grid;
        EXPECT_EQ(seen[p] >= 0, inside) << "pixel " << x << ", " << y << " grid " << grid;
      }
    }
  }
}

// With corners of up to `size` away from its middle, at any depth.
void AddTriangle(double x, double y, double size, Rng* rng, Flat* flat) {
  std::int32_t v[3];
  for (auto& index : v) {
    index = flat->Vertex(x + rng->Uniform(-size, size), y + rng->Uniform(-size, size),
                         rng->Uniform(1, 3));
  }
  flat->AddFace(v[0], v[1], v[2]);
}

// Triangles of every size, some far off-screen, many overlapping.
Flat RandomTriangles(int count, double spread, Rng* rng, int width = 45, int height = 39) {
  Flat flat(width, height);
  for (int f = 0; f < count; ++f) {
    const double cx = rng->Uniform(-5, width + 5), cy = rng->Uniform(-5, height + 6);
    AddTriangle(cx, cy, spread * std::pow(10, rng->Uniform(-2, 0)), rng, &flat);
  }
  return flat;
}

TEST_P(VisibilityOnEveryTarget, EqualsTheReferenceBitForBit) {
  Rng rng(6, 2);
  // 1e6 leaves the guard band: edges in 128 bits.
  for (const double spread : {2.0, 30.0, 1000.0, 1e6}) {
    for (int round = 0; round < 4; ++round) {
      Flat flat = RandomTriangles(60, spread, &rng);
      const ScreenMesh mesh = flat.Finish();
      EXPECT_EQ(Visible(mesh), VisibleRef(mesh)) << "spread " << spread;
    }
  }
}

// Faces of a few pixels, of which it is known from the start what they cover: across the borders of
// bins and of the image, and by themselves.
TEST_P(VisibilityOnEveryTarget, SmallFacesEqualTheReferenceAcrossBins) {
  Rng rng(8, 4);
  for (const auto& [width, height] : {std::pair{150, 131}, {64, 64}, {3, 70}, {66, 2}, {1, 1}}) {
    Flat flat(width, height);
    const int count = 40 + width * height / 15;
    for (int f = 0; f < count; ++f) {
      const double cx = rng.Uniform(-2, width + 2), cy = rng.Uniform(-2, height + 2);
      AddTriangle(cx, cy, rng.Uniform(0.1, 3.5), &rng, &flat);
    }
    const ScreenMesh mesh = flat.Finish();
    EXPECT_EQ(Visible(mesh), VisibleRef(mesh)) << width << " x " << height;
  }
}

// A face that has pixel centres in its box, but covers none, is not listed.
TEST_P(VisibilityOnEveryTarget, SmallFacesWithoutAPixelAreNotDrawn) {
  Flat flat(8, 8);
  const auto a = flat.Vertex(1.6, 2.4), b = flat.Vertex(3.4, 4.3), c = flat.Vertex(3.45, 4.3);
  flat.AddFace(a, b, c);
  flat.AddFace(a, flat.Vertex(4, 2), b);
  const DrawnFaces drawn = DrawnFacesOf(flat.Finish());
  ASSERT_EQ(drawn.counts[0], 1u);
  EXPECT_EQ(drawn.list(0)[0].face, 1);
}

// What a pixel shows, layer by layer, by sorting all faces that cover it.
std::vector<std::int32_t> LayersAt(const std::vector<VisibilitySetup<float>>& faces, int x, int y) {
  std::vector<std::pair<float, std::int32_t>> covering;
  for (const auto& face : faces) {
    if (!Covers(face.shape, x, y)) continue;
    const float z = face.depth.At(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
    covering.emplace_back(-z, face.face);
  }
  std::sort(covering.begin(), covering.end());
  std::vector<std::int32_t> out;
  for (std::size_t i = 0; i < covering.size(); ++i) {
    if (i == 0 || covering[i].first != covering[i - 1].first) out.push_back(covering[i].second);
  }
  return out;
}

TEST_P(VisibilityOnEveryTarget, PeelingShowsAllLayersInTheirOrder) {
  Rng rng(9, 5);
  for (const double spread : {4.0, 100.0, 1e6}) {
    Flat flat = RandomTriangles(50, spread, &rng);
    for (std::size_t f = 0; f < 3; ++f) {  // some again: at one depth only one is seen
      flat.AddFace(flat.buffers.v0[f], flat.buffers.v1[f], flat.buffers.v2[f]);
    }
    const ScreenMesh mesh = flat.Finish();
    const auto faces = SetUpDrawnFaces(mesh);
    const DrawnFaces drawn = DrawnFacesOf(mesh);
    BinListBuffers buffers;
    const BinLists lists = BinDrawnFaces(drawn, BinGrid(mesh.width, mesh.height), &buffers);
    const PixelRect rect{0, 0, mesh.width, mesh.height};  // one bin
    std::vector<float> behind(kBinSize * kBinSize, std::numeric_limits<float>::infinity());
    std::vector<std::vector<std::int32_t>> seen(kBinSize * kBinSize);
    VisibilityBin bin;
    bool more = true;
    for (int layer = 0; layer < 60 && more; ++layer) {
      PeelVisibility(mesh, {drawn.storage, lists[0]}, rect, behind.data(), &bin);
      more = false;
      for (int i = 0; i < mesh.height * kBinSize; ++i) {
        const auto at = static_cast<std::size_t>(i);
        behind[at] = bin.inverse_depth[i];
        if (bin.face[i] == kNoFace) continue;
        seen[at].push_back(bin.face[i]);
        more = true;
      }
    }
    EXPECT_FALSE(more);
    for (int y = 0; y < mesh.height; ++y) {
      for (int x = 0; x < mesh.width; ++x) {
        ASSERT_EQ(seen[static_cast<std::size_t>(y * kBinSize + x)], LayersAt(faces, x, y))
            << "pixel " << x << "," << y << " spread " << spread;
      }
    }
  }
}

TEST_P(VisibilityOnEveryTarget, CoincidingFacesShowTheLowerId) {
  Rng rng(7, 3);
  constexpr int kCount = 60;
  Flat flat = RandomTriangles(kCount, 100, &rng);
  for (std::size_t f = 0; f < kCount; ++f) {  // the same again, the other way round
    flat.AddFace(flat.buffers.v0[f], flat.buffers.v2[f], flat.buffers.v1[f]);
  }
  std::size_t covered = 0;
  for (const std::int32_t id : Visible(flat.Finish())) {
    EXPECT_LT(id, kCount);
    covered += id >= 0;
  }
  EXPECT_GT(covered, 1000u);
}

TEST_P(VisibilityOnEveryTarget, CentreOnTheDiagonalBelongsToTheFaceWhoseLeftEdgeItIs) {
  // Figure of rule 3: A below the diagonal, B above, of the square [0, 2) x [0, 2).
  Flat flat(2, 2);
  const auto tl = flat.Vertex(0, 0), tr = flat.Vertex(2, 0), br = flat.Vertex(2, 2),
             bl = flat.Vertex(0, 2);
  flat.AddFace(tl, bl, br);  // A
  flat.AddFace(tl, br, tr);  // B
  EXPECT_EQ(Visible(flat.Finish()), (std::vector<std::int32_t>{1, 1, 0, 1}));
}

TEST_P(VisibilityOnEveryTarget, DegenerateFacesCoverNothing) {
  Flat flat(8, 8);
  const auto a = flat.Vertex(1, 1), b = flat.Vertex(7, 7), c = flat.Vertex(4, 4);
  flat.AddFace(a, b, c);
  flat.AddFace(a, a, b);
  flat.AddFace(a, a, a);
  const ScreenMesh mesh = flat.Finish();
  for (std::size_t f = 0; f < 3; ++f) EXPECT_EQ(mesh.reject[f], kFaceDegenerate);
  for (const std::int32_t id : Visible(mesh)) EXPECT_EQ(id, kNoFace);
}

INSTANTIATE_TEST_SUITE_P(Targets, VisibilityOnEveryTarget, testing::ValuesIn(RunnableTargets()),
                         [](const auto& param) { return param.param; });

TEST(Bin, ListsAreAscendingAndMissNoCoveringFace) {
  Rng rng(8, 4);
  Flat flat = RandomTriangles(400, 150, &rng, 300, 200);
  const ScreenMesh mesh = flat.Finish();
  const SquareGrid grid = BinGrid(mesh.width, mesh.height);
  const DrawnFaces drawn = DrawnFacesOf(mesh);
  BinListBuffers buffers;
  const BinLists bins = BinDrawnFaces(drawn, grid, &buffers);
  std::size_t listed = 0;
  for (std::size_t t = 0; t < grid.cells(); ++t) {
    EXPECT_TRUE(std::is_sorted(bins[t].begin(), bins[t].end()));
    listed += bins[t].size();
    const PixelRect rect = grid.rect(t);
    for (std::size_t f = 0; f < mesh.faces(); ++f) {
      if (mesh.reject[f] != kFaceDrawn) continue;
      bool covers = false;
      const auto shape = SnapFaceClockwise(mesh, f);
      for (int i = rect.y0; i < rect.y1; ++i) {
        for (int j = rect.x0; j < rect.x1; ++j) covers |= Covers(shape, j, i);
      }
      if (!covers) continue;
      EXPECT_TRUE(std::any_of(bins[t].begin(), bins[t].end(), [&](std::int32_t i) {
        return drawn.storage[static_cast<std::size_t>(i)].face == static_cast<int>(f);
      }));
    }
  }
  EXPECT_LT(listed, mesh.faces() * grid.cells() / 2);  // it does reject
}

}  // namespace tilegrad::raster::visibility_test
