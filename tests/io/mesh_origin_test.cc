// SPDX-License-Identifier: Apache-2.0
// Coordinates far from the origin: what is subtracted, and what a file has no digits for.
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::io::mesh_origin_test {

const glm::dvec3 kPlace(431000, 4600000, 300);

class MeshOriginTest : public TempFolderTest {
 protected:
  LoadedMesh Load(const Path& path) { return Ok(LoadMesh(path)).value(); }
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
  ExpectIn(loaded.warnings[0], "(431000, 4600000, 300) was subtracted");
}

TEST_F(MeshOriginTest, TextWithDigitsIsRound) {
  const std::string rows = Rows("{:.6f} {:.6f} {:.6f}\n", kPlace);
  for (const Path& path : {Write("a.obj", Obj(Rows("v {:.6f} {:.6f} {:.6f}\n", kPlace))),
                           Write("a.ply", Ply("double", rows)), Write("a.off", Off(rows))}) {
    SCOPED_TRACE(path.string());
    const auto loaded = Load(path);
    ExpectRound(loaded, 2e-6);  // digits to 5e-7 in each of three, and 2^-24
    EXPECT_EQ(loaded.warnings.size(), 1u) << fmt::format("{}", fmt::join(loaded.warnings, "|"));
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
    ExpectIn(loaded.warnings[1], "x, y come in steps of 0.5, and the mesh is 2 across");
  }
  // Seven digits leave 1 of the y.
  const auto short_text = Load(Write("b.obj", Obj(Rows("v {:.7g} {:.7g} {:.7g}\n", kPlace))));
  ASSERT_EQ(short_text.warnings.size(), 2u);
  ExpectIn(short_text.warnings[1], "y come in steps of 1,");
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

using Json = nlohmann::json;

// A glTF file with a triangle strip's four vertices (x, y, 0) in float, and the document's parts.
std::string Gltf(const std::string& folder, const Json& nodes, const Json& primitives) {
  const float corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  const std::uint16_t indices[6] = {0, 1, 2, 2, 1, 3};
  std::string bytes(reinterpret_cast<const char*>(corners), sizeof(corners));
  bytes.append(reinterpret_cast<const char*>(indices), sizeof(indices));
  std::ofstream(folder + "/b.bin", std::ios::binary) << bytes;
  const Json view = {{"buffer", 0}, {"byteLength", 48}},
             index_view = {{"buffer", 0}, {"byteOffset", 48}, {"byteLength", 12}};
  const auto triangle = [](int offset) {
    return Json{{"bufferView", 1},
                {"byteOffset", offset},
                {"componentType", 5123},
                {"count", 3},
                {"type", "SCALAR"}};
  };
  const Json position = {{"bufferView", 0}, {"componentType", 5126}, {"count", 4},
                         {"type", "VEC3"},  {"min", {0, 0, 0}},      {"max", {1, 1, 0}}};
  return Json{{"asset", {{"version", "2.0"}}},
              {"buffers", Json::array({{{"uri", "b.bin"}, {"byteLength", 60}}})},
              {"bufferViews", {view, index_view}},
              {"accessors", {position, triangle(0), triangle(6), position}},
              {"materials", {{{"name", "a"}}, {{"name", "b"}}}},
              {"meshes", Json::array({{{"primitives", primitives}}})},
              {"scenes", Json::array({{{"nodes", Json::array({0})}}})},
              {"nodes", nodes}}
      .dump();
}

Json Primitive(int position, int indices, int material) {
  return {{"attributes", {{"POSITION", position}}}, {"indices", indices}, {"material", material}};
}

// The vertices are local, two nodes carry the place: their sum is formed in double.
TEST_F(MeshOriginTest, GltfNodesFarAway) {
  const Json nodes = {{{"translation", {400000.25, 4600000.125, 300}}, {"children", {1, 2}}},
                      {{"mesh", 0}, {"translation", {31000.125, 0, 0}}},
                      {{"camera", 0}, {"translation", {31000.125, 0, 3}}}};
  auto document = Json::parse(Gltf(folder_.string(), nodes, Json::array({Primitive(0, 1, 0)})));
  document["cameras"] =
      Json::array({{{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}}});
  const auto loaded = Load(Write("a.gltf", document.dump()));
  EXPECT_EQ(loaded.origin, glm::dvec3(431001, 4600001, 300));
  ASSERT_EQ(loaded.mesh.positions.size(), 4u);
  EXPECT_EQ(loaded.mesh.positions[3], glm::vec3(0.375f, 0.125f, 0));
  EXPECT_EQ(glm::dvec3(loaded.mesh.positions[0]) + loaded.origin,
            glm::dvec3(431000.375, 4600000.125, 300));
  ASSERT_EQ(loaded.cameras.size(), 1u);  // it looks at the corner from 3 above, as in the file
  const auto& m = loaded.cameras[0].camera.node_to_world;
  EXPECT_EQ(glm::dvec3(m[3], m[7], m[11]), glm::dvec3(-0.625, -0.875, 3));
  EXPECT_EQ(loaded.warnings.size(), 1u) << fmt::format("{}", fmt::join(loaded.warnings, "|"));
}

// Normals that a part has not are made of its own small numbers, first or last: in float, all four
// corners have one x.
TEST_F(MeshOriginTest, NormalsOfPartsWithoutAny) {
  const Json nodes = Json::array({{{"mesh", 0},
                                   {"translation", {4600000, 300, 0.5}},
                                   {"rotation", {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}},
                                   {"scale", {0.1, 0.1, 0.1}}}});
  Json with = Primitive(3, 1, 1);
  with["attributes"]["NORMAL"] = 0;  // its own positions, which are no normals of the plane
  for (const bool first : {false, true}) {
    const Json parts = first ? Json{with, Primitive(0, 1, 0)} : Json{Primitive(0, 1, 0), with};
    const auto loaded = Load(Write("a.gltf", Gltf(folder_.string(), nodes, parts)));
    ASSERT_EQ(loaded.mesh.normals.size(), 8u);
    for (std::size_t v = 0; v < 3; ++v) {  // the turned plane faces -y
      const glm::vec3 n = loaded.mesh.normals[v + (first ? 4 : 0)];
      EXPECT_LT(glm::length(n - glm::vec3(0, -1, 0)), 1e-6f) << n.x << " " << n.y << " " << n.z;
    }
  }
}

// Primitives of one mesh with one accessor of positions share its vertices; others do not.
TEST_F(MeshOriginTest, GltfSharedAccessors) {
  const Json nodes = Json::array({{{"mesh", 0}}});
  const auto shared = Load(
      Write("a.gltf", Gltf(folder_.string(), nodes, {Primitive(0, 1, 0), Primitive(0, 2, 1)})));
  EXPECT_EQ(shared.mesh.positions,
            (std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}));
  EXPECT_EQ(shared.mesh.faces, (std::vector<Face>{{0, 1, 2}, {2, 1, 3}}));
  EXPECT_EQ(shared.mesh.face_materials, (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(shared.mesh.materials[1].name, "b");
  const auto apart =
      Load(Write("b.gltf", Gltf(folder_.string(), nodes,
                                {Primitive(0, 1, 0), Primitive(3, 2, 1), Primitive(0, 2, 0)})));
  EXPECT_EQ(apart.mesh.positions.size(), 8u);
  EXPECT_EQ(apart.mesh.faces, (std::vector<Face>{{0, 1, 2}, {6, 5, 7}, {2, 1, 3}}));
  EXPECT_EQ(apart.mesh.face_materials, (std::vector<std::int32_t>{0, 1, 0}));
}

}  // namespace tilegrad::io::mesh_origin_test
