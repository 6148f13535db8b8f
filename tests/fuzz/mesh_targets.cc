// SPDX-License-Identifier: Apache-2.0
// Readers of meshes. Whatever they accept is valid, and our writer and reader agree on it.
#include <cmath>

#include "base/read_budget.h"
#include "fuzz/target.h"
#include "io/image_file.h"
#include "io/imported_scene.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"

namespace tilegrad::fuzz::mesh_targets {

constexpr std::size_t kBudget = std::size_t{64} << 20;

void RoundTrip(const Mesh& mesh, const glm::dvec3& origin) {
  const auto glb = io::EncodeGlb(mesh, {.origin = origin});
  Require(glb.ok(), "a mesh that was read can be written");
  const MemorySource source("again.glb", *glb);
  const auto again = io::LoadMesh(source, "again.glb");
  // Vertices that no face uses are left out, but faces stay.
  Require(again.ok(), "what was written can be read");
  Require(again->mesh.faces.size() == mesh.faces.size(), "all faces come back");
}

void LoadAs(const std::string& name, Input input) {
  const ReadBudget budget(kBudget);
  const MemorySource source(name, input);
  const auto loaded = io::LoadMesh(source, name);
  if (!loaded.ok()) return Require(!loaded.status().message().empty(), "an error has a message");
  const Mesh& mesh = loaded->mesh;
  Require(Validate(mesh).ok(), "a mesh that was read is valid");
  Require(!mesh.faces.empty(), "a mesh that was read has a face");
  for (int k = 0; k < 3; ++k) Require(std::isfinite(loaded->origin[k]), "an origin is finite");
  if (mesh.faces.size() < 300 && mesh.textures.empty()) RoundTrip(mesh, loaded->origin);
}

Mesh SampleMesh() {
  Mesh mesh = Box({0, 0, 0}, {1, 2, 3});
  SetColor(mesh, {0.2f, 0.4f, 0.6f, 1});
  mesh.materials = {Material()};
  mesh.materials[0].name = "m";
  mesh.normals = SmoothNormals(mesh);
  return mesh;
}

Mesh TexturedMesh() {
  Mesh mesh = Box({0, 0, 0}, {1, 1, 1});
  mesh.corner_uvs.assign(3 * mesh.faces.size(), {0.25f, 0.5f});
  mesh.textures = {{"t.png", ImageU8(2, 2, 3, 90)}};
  mesh.materials = {Material()};
  mesh.materials[0].base_color_texture = 0;
  return mesh;
}

void Gltf(Input input) {
  const bool binary = input.size() >= 4 && input[0] == 'g' && input[1] == 'l';
  LoadAs(binary ? "a.glb" : "a.gltf", input);
}

// Positions of a triangle and three indices, as base64.
constexpr std::string_view kTriangleBuffer =
    "AAABAAIAAAAAAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAAAAAACAPwAAAAA=";

std::vector<Bytes> GltfSeeds() {
  const std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0,)"
      R"("translation":[1,2,3],"rotation":[0,0,0,1],"scale":[1,1,-1],"children":[2]},{"camera":0,)"
      R"("matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]},{"mesh":0}],"cameras":[{"type":"perspective",)"
      R"("perspective":{"yfov":0.7,"znear":0.1}}],"meshes":[{"primitives":[{"attributes":)"
      R"({"POSITION":1},"indices":0,"material":0,"mode":4}]}],"materials":[{"name":"m","alphaMode":)"
      R"("MASK","doubleSided":true,"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0.25,1],)"
      R"("baseColorTexture":{"index":0}},"extensions":{"KHR_materials_unlit":{}}}],"textures":)"
      R"([{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],"images":[{"uri":"t.png"}],)"
      R"("accessors":[{"bufferView":0,"componentType":5123,"count":3,"type":"SCALAR"},)"
      R"({"bufferView":1,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":6},{"buffer":0,"byteOffset":8,"byteLength":36}],)"
      R"("buffers":[{"byteLength":44,"uri":"data:application/octet-stream;base64,)" +
      std::string(kTriangleBuffer) + R"("}]})";
  const Bytes png = *io::EncodePng(ImageU8(2, 2, 3, 7));
  return {*io::EncodeGlb(SampleMesh()), *io::EncodeGlb(TexturedMesh(), {.origin = {1e6, 0, 0}}),
          *io::EncodeGlb(SampleMesh(), {.sun = glm::dvec3(1, 1, 1)}), ToBytes(json),
          JoinFiles({json, std::string(png.begin(), png.end())})};
}

std::vector<Bytes> ObjSeeds() {
  return {
      ToBytes("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
      JoinFiles({"mtllib m.mtl\no part\nv 0 0 0 1\nv 1 0 0 1 0 0 1\nv 0 1 0\nv 0 1 1\nvt 0 1\n"
                 "vt 1 0 0\nvn 0 0 1\ns 1\nusemtl red\nf 1/1/1 2/2/1 3//1 4\nusemtl b\nf -1 -2 -3\n"
                 "l 1 2\np 1\n",
                 "newmtl red\nKd 1 0 0\nd 0.5\nillum 2\nmap_Kd -s 2 2 -o 0 0 1 -clamp on t.png\n"
                 "newmtl b\nTr 0.25\nmap_d t.png\nPr 0.5\n"})};
}

std::vector<Bytes> PlySeeds() {
  std::string binary =
      "ply\nformat binary_little_endian 1.0\ncomment c\nelement vertex 3\nproperty float "
      "x\nproperty "
      "float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  for (int v = 0; v < 3; ++v) {
    const float xyz[] = {v == 1 ? 1.0f : 0.0f, v == 2 ? 1.0f : 0.0f, 0.5f};
    binary.append(reinterpret_cast<const char*>(xyz), 12).append("\x10\x20\x30");
  }
  const std::int32_t face[] = {0, 1, 2};
  binary.append("\x03").append(reinterpret_cast<const char*>(face), 12);
  return {ToBytes("ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
                  "property double z\nproperty float nx\nproperty float ny\nproperty float nz\n"
                  "property float s\nproperty float t\nelement face 1\n"
                  "property list uchar uint vertex_index\nproperty list uchar float texcoord\n"
                  "end_header\n0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n0 1 0 0 0 1 0 1\n"
                  "4 0 1 2 3 8 0 0 1 0 1 1 0 1\n"),
          ToBytes(binary)};
}

std::vector<Bytes> OffSeeds() {
  return {
      ToBytes("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
      ToBytes("COFF # c\n4 2 5\n0 0 0 255 0 0 255\n1 0 0 0 1 0 1\n1 1 0 9 9 9 9\n0 1 0 1 2 3 4\n"
              "4 0 1 2 3\n3 0 1 2 0.5 0.5 0.5\n")};
}

std::vector<Bytes> Ac3dSeeds() {
  const std::string head =
      "AC3Db\nMATERIAL \"red\" rgb 1 0 0  amb 1 1 1  emis 0 0 0  spec 0 0 0  shi 10  trans 0.2\n"
      "OBJECT world\nkids 1\nOBJECT poly\nname \"hull\"\nloc 1 2 3\nrot 1 0 0 0 1 0 0 0 1\n"
      "texture \"t.rgb\"\ntexrep 2 2\ntexoff 0 0\ncrease 30\nnumvert 4\n0 0 0\n1 0 0\n1 1 0\n0 1 "
      "0\n";
  return {
      ToBytes(head +
              "numsurf 2\nSURF 0x20\nmat 0\nrefs 4\n0 0 0\n1 1 0\n2 1 1\n3 0 1\nSURF 0x02\nmat 0\n"
              "refs 2\n0 0 0\n1 0 0\nkids 0\n"),
      ToBytes(
          "AC3Dc\nMAT \"m\"\nrgb 1 1 1\namb 0 0 0\nemis 0 0 0\nspec 0 0 0\nshi 1\ntrans 0\n"
          "ENDMAT\nOBJECT poly\ndata 3\nabc\nnumvert 3 0 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 "
          "0 1\nnumsurf 1\nSURF 0x34\nmat 0\nrefs 3\n0 0 0 1 1\n1 1 0 1 1\n2 0 1 1 1\nkids 0\n")};
}

// What the child of a guarded process leaves behind: untrusted, for the importer may have gone
// wrong.
void Imported(Input input) {
  const ReadBudget budget(kBudget);
  const auto scene = io::DecodeScene(input);
  if (!scene.ok()) return Require(!scene.status().message().empty(), "an error has a message");
  for (const io::ImportedInstance& i : scene->instances) {
    Require(i.part < scene->parts.size(), "an instance has its part");
  }
  for (const io::ImportedPart& p : scene->parts) {
    for (const auto& t : p.triangles) {
      for (const std::uint32_t v : t) Require(v < p.positions.size(), "a corner has its vertex");
    }
  }
  const Bytes again = io::EncodeScene(scene);
  Require(io::DecodeScene(again).ok(), "a scene that was decoded can be sent again");
}

std::vector<Bytes> ImportedSeeds() {
  io::ImportedScene scene;
  io::ImportedPart part;
  part.name = "p";
  part.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  part.normals.assign(3, {0, 0, 1});
  part.uvs.assign(3, {0, 1});
  part.colors.assign(3, {1, 1, 1, 1});
  part.triangles = {{0, 1, 2}};
  scene.parts = {part};
  scene.materials = {{"m", {1, 0, 0, 1}, "t.png", 0, ""}};
  scene.images = {{"t.png", *io::EncodePng(ImageU8(1, 1, 3, 5))}};
  scene.instances = {{0, glm::dmat4x3(1)}};
  scene.warnings = {"w"};
  const auto bytes = [](Result<io::ImportedScene> s) { return io::EncodeScene(s); };
  return {bytes(scene), bytes(io::ImportedScene()),
          bytes(Status(StatusCode::kDataLoss, "broken in the child"))};
}

const Registration kTargets[] = {
    Registration({"gltf", Gltf, GltfSeeds}),
    Registration({"obj", [](Input i) { LoadAs("a.obj", i); }, ObjSeeds}),
    Registration({"ply", [](Input i) { LoadAs("a.ply", i); }, PlySeeds}),
    Registration({"off", [](Input i) { LoadAs("a.off", i); }, OffSeeds}),
    Registration({"ac3d", [](Input i) { LoadAs("a.ac", i); }, Ac3dSeeds}),
    Registration({"imported", Imported, ImportedSeeds}),
};

}  // namespace tilegrad::fuzz::mesh_targets
