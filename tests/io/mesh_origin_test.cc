// SPDX-License-Identifier: Apache-2.0
// Coordinates far from the origin: what is subtracted, and what a file has no digits for.
#include <gtest/gtest.h>

#include <cstring>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io {
namespace {

const glm::dvec3 kPlace(431000, 4600000, 300);

class MeshOriginTest : public TempFolderTest {
 protected:
  LoadedMesh Load(const Path& path) {
    auto loaded = LoadMesh(path);
    EXPECT_TRUE(loaded.ok()) << loaded.status().message();
    return loaded.ok() ? std::move(*loaded) : LoadedMesh{};
  }
};

// The unit sphere, its vertices with `digits` digits, around `place`.
std::string Rows(const char* format, const glm::dvec3& place) {
  std::string out;
  for (const glm::vec3& v : Icosphere(2, 1).positions) {
    const glm::dvec3 p = place + glm::dvec3(v);
    out += fmt::format(fmt::runtime(format), p.x, p.y, p.z);
  }
  return out;
}

std::string FaceRows(const char* format, int from) {
  std::string out;
  for (const auto& [a, b, c] : Icosphere(2, 1).faces)
    out += fmt::format(fmt::runtime(format), a + from, b + from, c + from);
  return out;
}

std::string Ply(const char* type, const std::string& rows) {
  return fmt::format(
             "ply\nformat ascii 1.0\nelement vertex 162\nproperty {0} x\nproperty {0} y\n"
             "property {0} z\nelement face 320\nproperty list uchar int "
             "vertex_indices\nend_header\n",
             type) +
         rows + FaceRows("3 {} {} {}\n", 0);
}

std::string Off(const std::string& rows) {
  return "OFF\n162 320 0\n" + rows + FaceRows("3 {} {} {}\n", 0);
}

std::string Obj(const std::string& rows) { return rows + FaceRows("f {} {} {}\n", 1); }

void ExpectRound(const LoadedMesh& loaded, double tolerance) {
  EXPECT_EQ(loaded.origin, kPlace);
  ASSERT_EQ(loaded.mesh.positions.size(), 162u);
  for (const glm::vec3& p : loaded.mesh.positions)
    EXPECT_NEAR(glm::length(glm::dvec3(p)), 1, tolerance);
  ASSERT_FALSE(loaded.warnings.empty());
  EXPECT_NE(loaded.warnings[0].find("(431000, 4600000, 300) was subtracted"), std::string::npos)
      << loaded.warnings[0];
}

TEST_F(MeshOriginTest, TextWithDigitsIsRound) {
  const std::string rows = Rows("{:.6f} {:.6f} {:.6f}\n", kPlace);
  for (const Path& path : {Write("a.obj", Obj(Rows("v {:.6f} {:.6f} {:.6f}\n", kPlace))),
                           Write("a.ply", Ply("double", rows)), Write("a.off", Off(rows))}) {
    SCOPED_TRACE(path.string());
    const auto loaded = Load(path);
    ExpectRound(loaded, 2e-6);  // digits to 5e-7 in each of three, and 2^-24
    EXPECT_EQ(loaded.warnings.size(), 1u);
  }
}

// In float, 4600000 has steps of 0.5.
TEST_F(MeshOriginTest, CoordinatesWithoutDigitsAreAWarning) {
  std::string rows;
  for (const glm::vec3& v : Icosphere(2, 1).positions) {
    const glm::vec3 p(kPlace + glm::dvec3(v));
    rows += fmt::format("{:.12g} {:.12g} {:.12g}\n", p.x, p.y, p.z);
  }
  for (const Path& path : {Write("a.ply", Ply("float", rows)), Write("a.off", Off(rows))}) {
    const auto loaded = Load(path);
    ASSERT_EQ(loaded.warnings.size(), 2u);
    EXPECT_NE(loaded.warnings[1].find("x, y come in steps of 0.5, and the mesh is 2 across"),
              std::string::npos)
        << loaded.warnings[1];
  }
  // Seven digits leave 1 of the y.
  const auto short_text = Load(Write("b.obj", Obj(Rows("v {:.7g} {:.7g} {:.7g}\n", kPlace))));
  ASSERT_EQ(short_text.warnings.size(), 2u);
  EXPECT_NE(short_text.warnings[1].find("y come in steps of 1,"), std::string::npos)
      << short_text.warnings[1];
}

// Nothing is subtracted from what float can hold, and not a bit changes.
TEST_F(MeshOriginTest, NearMeshesStayAsTheyAre) {
  for (const double far : {0.0, 1.0, 500.0}) {  // 501 is less than 256 times 2
    const auto loaded = Load(Write("a.off", Off(Rows("{:.9g} {:.9g} {:.9g}\n", {far, 0, 0}))));
    EXPECT_EQ(loaded.origin, glm::dvec3(0));
    EXPECT_TRUE(loaded.warnings.empty());
    EXPECT_NEAR(loaded.mesh.positions[0].x, far + Icosphere(2, 1).positions[0].x, 3e-5);
  }
  EXPECT_EQ(Load(Write("b.off", Off(Rows("{:.9g} {:.9g} {:.9g}\n", {520, 0, 0})))).origin,
            glm::dvec3(520, 0, 0));
}

// A vertex that no face uses has no say; its place stays right.
TEST_F(MeshOriginTest, UnusedVerticesDoNotCount) {
  const auto loaded =
      Load(Write("a.obj", Obj(Rows("v {:.6f} {:.6f} {:.6f}\n", kPlace)) + "v 0 0 0\n"));
  EXPECT_EQ(loaded.origin, kPlace);
  EXPECT_EQ(loaded.mesh.positions.back(), glm::vec3(-431000, -4600000, -300));
}

// A notched polygon, whose corners float would move by half of its size.
TEST_F(MeshOriginTest, PolygonsAreCutRightFarAway) {
  const auto loaded =
      Load(Write("a.obj",
                 "v 431000.1 4600000.1 300\nv 431000.9 4600000.1 300\nv 431000.9 4600000.9 300\n"
                 "v 431000.5 4600000.2 300\nv 431000.1 4600000.9 300\nf 1 2 3 4 5\n"));
  ASSERT_EQ(loaded.mesh.faces.size(), 3u);
  for (const auto& [a, b, c] : loaded.mesh.faces) {
    const auto& p = loaded.mesh.positions;
    EXPECT_GT(glm::cross(p[b] - p[a], p[c] - p[a]).z, 0);
  }
}

}  // namespace
}  // namespace tilegrad::io
