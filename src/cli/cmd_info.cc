// SPDX-License-Identifier: Apache-2.0
// tilegrad info: version, SIMD targets and why one was chosen, cores; or what mesh files hold.
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "base/parallel.h"
#include "base/simd_target.h"
#include "cli/command.h"
#include "cli/console.h"
#include "io/mesh_file.h"
#include "scene/topology.h"
#include "tilegrad/version.h"

namespace tilegrad::cli {
namespace {

struct InfoOptions {
  std::vector<std::string> meshes;
};

Status PrintProgramInfo() {
  Print("tilegrad {}\n", TILEGRAD_VERSION);
  Print("cores this process may use: {}\n", AvailableCores());
  Print("SIMD targets this CPU and build offer, best first:");
  for (const auto& name : RunnableTargets()) Print(" {}", name);
  const bool forced = !ForcedTarget().empty();
  Print(
      "\nin use: {} ({})\n", ActiveTarget(),
      forced ? "forced by TILEGRAD_TARGET" : "the best; set TILEGRAD_TARGET=NAME to force another");
  PrintResult({{"version", TILEGRAD_VERSION},
               {"cores", AvailableCores()},
               {"targets", RunnableTargets()},
               {"target", ActiveTarget()},
               {"forced", forced}});
  return {};
}

// Edges by place: where charts or normals meet, files have a vertex twice.
Topology EdgesByPlace(const Mesh& mesh) {
  std::map<std::tuple<float, float, float>, std::int32_t> places;
  std::vector<std::int32_t> place_of;
  for (const glm::vec3& p : mesh.positions) {
    const auto next = static_cast<std::int32_t>(places.size());
    place_of.push_back(places.try_emplace({p.x, p.y, p.z}, next).first->second);
  }
  std::vector<Face> faces = mesh.faces;
  for (Face& face : faces) {
    for (std::int32_t& v : face) v = place_of[static_cast<std::size_t>(v)];
  }
  return BuildTopology(faces, places.size());
}

std::string NamesOf(const Mesh& mesh) {
  std::string names;
  for (const Material& m : mesh.materials)
    names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", m.name);
  return names.empty() ? "" : ": " + names;
}

void PrintMesh(const std::string& file, const Mesh& mesh, const Topology& edges, bool watertight,
               const glm::dvec3& low, const glm::dvec3& high) {
  Print("{}\n  vertices: {}\n  faces: {}\n", file, mesh.positions.size(), mesh.faces.size());
  Print("  extent: {:g} x {:g} x {:g}, from ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g})\n",
        high.x - low.x, high.y - low.y, high.z - low.z, low.x, low.y, low.z, high.x, high.y,
        high.z);
  Print("  materials: {}{}\n", mesh.materials.size(), NamesOf(mesh));
  Print("  textures: {}\n", mesh.textures.size());
  for (const MeshTexture& t : mesh.textures)
    Print("    {}: {} x {} pixels\n", t.name, t.image.width, t.image.height);
  Print("  watertight: {}\n",
        watertight ? "yes"
                   : fmt::format("no: {} of one face, {} of more than two",
                                 Count(edges.boundary_edges, "edge"), edges.nonmanifold_edges));
}

nlohmann::ordered_json TexturesJson(const Mesh& mesh) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (const MeshTexture& t : mesh.textures)
    out.push_back({{"name", t.name}, {"width", t.image.width}, {"height", t.image.height}});
  return out;
}

Status DescribeMesh(const std::string& file, nlohmann::ordered_json* all) {
  TILEGRAD_ASSIGN(const io::LoadedMesh loaded, io::LoadMesh(Path(file)));
  for (const std::string& warning : loaded.warnings)
    PrintNote("tilegrad: warning: {}: {}\n", file, warning);
  const Mesh& mesh = loaded.mesh;
  const Bounds bounds = MeshBounds(mesh);
  const glm::dvec3 low = glm::dvec3(bounds.low) + loaded.origin,
                   high = glm::dvec3(bounds.high) + loaded.origin;
  const Topology edges = EdgesByPlace(mesh);
  const bool watertight = edges.boundary_edges == 0 && edges.nonmanifold_edges == 0;
  PrintMesh(file, mesh, edges, watertight, low, high);
  std::vector<std::string> materials;
  for (const Material& m : mesh.materials) materials.push_back(m.name);
  all->push_back({{"file", file},
                  {"vertices", mesh.positions.size()},
                  {"faces", mesh.faces.size()},
                  {"low", {low.x, low.y, low.z}},
                  {"high", {high.x, high.y, high.z}},
                  {"materials", materials},
                  {"textures", TexturesJson(mesh)},
                  {"watertight", watertight},
                  {"edges_of_one_face", edges.boundary_edges},
                  {"edges_of_more_than_two", edges.nonmanifold_edges}});
  return {};
}

// One bad mesh does not keep the others from being described; the first error is the result.
Status RunInfo(const InfoOptions& options) {
  if (options.meshes.empty()) return PrintProgramInfo();
  StopOnSignals();
  Status first;
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const std::string& file : options.meshes) {
    const Status status = DescribeMesh(file, &json);
    if (!first.ok() && !status.ok()) PrintNote("tilegrad: {}\n", status.message());
    if (first.ok()) first = status;
  }
  PrintResult(json);
  return first;
}

}  // namespace

void AddInfo(CommandList* list) {
  const auto [command, options] =
      AddCommand(list, "info",
                 "Show version, SIMD targets and cores; or, of mesh files, vertices, faces, "
                 "materials, textures, extent and watertightness",
                 RunInfo);
  command->Add("meshes", &options->meshes, "files: " + io::MeshFileEndings());
}

}  // namespace tilegrad::cli
