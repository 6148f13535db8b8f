// SPDX-License-Identifier: Apache-2.0
// Mesh files, and meshes made ready for the renderer.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "bindings/mesh_dict.h"
#include "bindings/to_python.h"
#include "io/mesh_file.h"
#include "render/picture/mesh_scene.h"

namespace tilegrad::python {
namespace {

py::dict CameraToDict(const io::MeshFileCamera& from) {
  const auto& m = from.camera.node_to_world;
  return py::dict(
      py::arg("name") = Text(from.name), py::arg("node_to_world") = CopyOf<double>(m, {4, 4}),
      py::arg("yfov") = from.camera.yfov, py::arg("aspect_ratio") = from.camera.aspect_ratio,
      py::arg("znear") = from.camera.znear);
}

// The file's own lists; None if it has none.
py::object TablesToDict(io::MeshFileTables tables) {
  if (tables.uvs.empty() && tables.normals.empty()) return py::none();
  const auto add = [](py::dict& out, const char* name, auto values, auto corners) {
    const auto count = static_cast<py::ssize_t>(values.size()),
               faces = static_cast<py::ssize_t>(corners.size()) / 3;
    const auto width = static_cast<py::ssize_t>(decltype(values)::value_type::length());
    if (count == 0) return;
    out[name] = OwnedArray<float>(std::move(values), {count, width});
    out[("face_" + std::string(name)).c_str()] =
        OwnedArray<std::int32_t>(std::move(corners), {faces, 3});
  };
  py::dict out;
  add(out, "uvs", std::move(tables.uvs), std::move(tables.corner_uvs));
  add(out, "normals", std::move(tables.normals), std::move(tables.corner_normals));
  return out;
}

py::dict LoadMesh(const Path& path, std::size_t max_bytes) {
  auto loaded = LoadWithin(max_bytes, [&] { return io::LoadMesh(path); });
  py::dict out = MeshToDict(std::move(loaded.mesh));
  py::list warnings, cameras;
  for (const std::string& warning : loaded.warnings) warnings.append(Text(warning));
  for (const io::MeshFileCamera& camera : loaded.cameras) cameras.append(CameraToDict(camera));
  out["warnings"] = warnings;
  out["cameras"] = cameras;
  out["origin"] =
      CopyOf<double>(std::array{loaded.origin.x, loaded.origin.y, loaded.origin.z}, {3});
  out["tables"] = TablesToDict(std::move(loaded.tables));
  return out;
}

void SaveMesh(const Path& path, const py::dict& dict) {
  const Mesh mesh = MeshFromDict("save_mesh", dict);
  const auto o = py::cast<std::array<double, 3>>(dict["origin"]);
  const io::GlbOptions options{.origin = {o[0], o[1], o[2]}};
  ThrowIfError(WithoutGil([&] { return io::SaveGlb(path, mesh, options).Within(path.string()); }));
}

constexpr const char* kNormalKinds[] = {"smooth", "flat", "given"};
constexpr const char* kWraps[] = {"repeat",        "clamp",        "mirror",
                                  "repeat clamp",  "clamp mirror", "mirror repeat",
                                  "repeat mirror", "clamp repeat", "mirror clamp"};
constexpr const char* kFilters[] = {"nearest", "bilinear", "trilinear"};

py::object StreamArray(const StreamT<float>& stream, py::ssize_t channels) {
  if (stream.values.empty()) return py::none();
  const auto count = static_cast<py::ssize_t>(stream.values.size()) / channels;
  if (stream.rate == Rate::kVertex) return CopyOf(stream.values, {count, channels});
  return CopyOf(stream.values, {count / 3, 3, channels});
}

py::list SurfaceList(std::span<const Surface> surfaces) {
  py::list out;
  for (const Surface& s : surfaces) {
    out.append(py::dict(py::arg("base_color") = s.base_color, py::arg("texture") = s.texture,
                        py::arg("ambient") = s.ambient, py::arg("diffuse") = s.diffuse,
                        py::arg("specular") = s.specular, py::arg("shininess") = s.shininess));
  }
  return out;
}

py::list TextureList(std::span<const Texture> textures) {
  py::list out;
  for (const Texture& t : textures) {
    out.append(py::dict(py::arg("texels") = CopyOf(t.texels, {t.height, t.width, 3}),
                        py::arg("wrap") = kWraps[static_cast<std::size_t>(t.wrap)],
                        py::arg("filter") = kFilters[static_cast<std::size_t>(t.filter)]));
  }
  return out;
}

// The parts of a scene that come from the mesh, in the words of include/tilegrad/scene.h.
py::dict SceneOfMesh(const py::dict& dict, bool linear, const std::string& normals) {
  const Mesh mesh = MeshFromDict("Mesh.scene", dict);
  ThrowIfError(Validate(mesh).Within("Mesh.scene"));
  if (mesh.faces.empty()) throw py::value_error("Mesh.scene: the mesh has no face");
  MeshSceneOptions options;
  options.color_space = linear ? ColorSpace::kLinear : ColorSpace::kSrgb;
  options.normals = normals == "smooth" ? NormalSource::kSmooth
                    : normals == "flat" ? NormalSource::kFlat
                                        : NormalSource::kAuto;
  const MeshScene made(mesh, options);
  const Scene& scene = made.scene();
  py::dict out;
  out["colors"] = StreamArray(scene.colors, 3);
  out["uvs"] = StreamArray(scene.uvs, 2);
  out["normals"] = StreamArray(scene.normals, 3);
  out["textures"] = TextureList(scene.textures);
  out["surfaces"] = SurfaceList(scene.surfaces);
  out["normal_kind"] = kNormalKinds[static_cast<std::size_t>(scene.shading.normals)];
  return out;
}

}  // namespace

void BindMeshes(py::module_& m) {
  m.def("load_mesh", &LoadMesh, "The arrays of a mesh file.");
  m.def("save_mesh", &SaveMesh, "Writes a .glb file.");
  m.def("mesh_endings", &io::MeshFileEndings, "Endings of files that load_mesh reads.");
  m.def("scene_of_mesh", &SceneOfMesh,
        "The parts of a scene that come from a mesh; normals: \"auto\", \"smooth\" or \"flat\".");
}

}  // namespace tilegrad::python
