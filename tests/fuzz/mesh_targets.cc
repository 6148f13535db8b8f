// SPDX-License-Identifier: Apache-2.0
// Readers of meshes. Whatever they accept is valid, and our writer and reader agree on it.
#include <cmath>

#include "fuzz/target.h"
#include "io/image_file.h"
#include "io/imported_scene.h"
#include "io/mesh_file.h"

namespace tilegrad::fuzz::mesh_targets {

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
  const MemorySource source(name, input);
  const auto loaded = io::LoadMesh(source, name);
  if (!Accepted(loaded)) return;
  const Mesh& mesh = loaded->mesh;
  Require(Validate(mesh).ok(), "a mesh that was read is valid");
  Require(!mesh.faces.empty(), "a mesh that was read has a face");
  for (int k = 0; k < 3; ++k) Require(std::isfinite(loaded->origin[k]), "an origin is finite");
  if (mesh.faces.size() < 300 && mesh.textures.empty()) RoundTrip(mesh, loaded->origin);
}

void Gltf(Input input) {
  const bool binary = input.size() >= 4 && input[0] == 'g' && input[1] == 'l';
  LoadAs(binary ? "a.glb" : "a.gltf", input);
}

// What the child of a guarded process leaves behind: untrusted, for the importer may have gone
// wrong.
void Imported(Input input) {
  const auto scene = io::DecodeScene(input);
  if (!Accepted(scene)) return;
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
    Registration({"gltf", Gltf}),
    Registration({"obj", [](Input i) { LoadAs("a.obj", i); }}),
    Registration({"ply", [](Input i) { LoadAs("a.ply", i); }}),
    Registration({"off", [](Input i) { LoadAs("a.off", i); }}),
    Registration({"ac3d", [](Input i) { LoadAs("a.ac", i); }}),
    Registration({"imported", Imported, ImportedSeeds}),
};

}  // namespace tilegrad::fuzz::mesh_targets
