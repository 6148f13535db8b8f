// SPDX-License-Identifier: Apache-2.0
#include "bindings/mesh_dict.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "bindings/to_python.h"

namespace tilegrad::python {
namespace {

constexpr std::array kTextureWraps = {"repeat", "mirror", "clamp"};
constexpr std::array kAlphaModes = {"opaque", "mask", "blend"};

// The index of a name.
template <class Enum, std::size_t n>
Enum EnumOf(const char* function, const py::handle& value,
            const std::array<const char*, n>& names) {
  const auto name = py::cast<std::string>(value);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    throw py::value_error(fmt::format("{}: '{}' is not one of '{}'", function, name,
                                      fmt::join(names.begin(), names.end(), "', '")));
  }
  return static_cast<Enum>(found - names.begin());
}

// "repeat" along both axes, or "repeat clamp" along u and v.
std::string NameOf(const std::array<TextureWrap, 2>& wrap) {
  const auto name = [](TextureWrap w) { return kTextureWraps[static_cast<std::size_t>(w)]; };
  return wrap[0] == wrap[1] ? name(wrap[0]) : fmt::format("{} {}", name(wrap[0]), name(wrap[1]));
}

std::array<TextureWrap, 2> WrapOfName(const char* function, const std::string& name) {
  const std::size_t space = std::min(name.find(' '), name.size());
  const auto along = [&](const std::string& way) {
    return EnumOf<TextureWrap>(function, py::str(way), kTextureWraps);
  };
  const TextureWrap u = along(name.substr(0, space));
  return {u, space == name.size() ? u : along(name.substr(space + 1))};
}

// None where there is nothing.
template <class T, class Vector>
py::object ArrayOrNone(Vector values, std::vector<py::ssize_t> shape) {
  if (values.empty()) return py::none();
  return OwnedArray<T>(std::move(values), std::move(shape));
}

py::dict MaterialToDict(const Material& m) {
  const auto& c = m.base_color;
  return py::dict(py::arg("name") = Text(m.name),
                  py::arg("base_color") = py::make_tuple(c.r, c.g, c.b, c.a),
                  py::arg("texture") = m.base_color_texture, py::arg("wrap") = NameOf(m.wrap),
                  py::arg("nearest") = m.nearest,
                  py::arg("alpha_mode") = kAlphaModes[static_cast<std::size_t>(m.alpha_mode)],
                  py::arg("alpha_cutoff") = m.alpha_cutoff,
                  py::arg("double_sided") = m.double_sided, py::arg("unlit") = m.unlit);
}

Material MaterialFromDict(const char* function, const py::dict& dict) {
  Material m;
  m.name = py::cast<std::string>(dict["name"]);
  const auto color = py::cast<std::array<float, 4>>(dict["base_color"]);
  m.base_color = {color[0], color[1], color[2], color[3]};
  m.base_color_texture = py::cast<int>(dict["texture"]);
  m.wrap = WrapOfName(function, py::cast<std::string>(dict["wrap"]));
  m.nearest = py::cast<bool>(dict["nearest"]);
  m.alpha_mode = EnumOf<AlphaMode>(function, dict["alpha_mode"], kAlphaModes);
  m.alpha_cutoff = py::cast<float>(dict["alpha_cutoff"]);
  m.double_sided = py::cast<bool>(dict["double_sided"]);
  m.unlit = py::cast<bool>(dict["unlit"]);
  return m;
}

py::dict TextureToDict(MeshTexture texture) {
  ImageU8& image = texture.image;
  std::vector<py::ssize_t> shape = {image.height, image.width, image.channels};
  return py::dict(
      py::arg("name") = Text(texture.name),
      py::arg("image") = OwnedArray<std::uint8_t>(std::move(image.pixels), std::move(shape)));
}

MeshTexture TextureFromDict(const char* function, const py::dict& dict) {
  MeshTexture out{py::cast<std::string>(dict["name"]),
                  ImageFromPython(function, "image", dict["image"])};
  if (out.image.channels == 3 || out.image.channels == 4) return out;
  throw py::value_error(
      fmt::format("{}: a texture has 3 or 4 channels, got {}", function, out.image.channels));
}

// Copies dict[name], if present, into a vector of records of T.
template <class T, class Record>
void Read(const char* function, const py::dict& dict, const char* name,
          std::vector<py::ssize_t> shape, std::vector<Record>* out) {
  const py::object array = dict.attr("get")(name);
  if (array.is_none()) return;
  const auto values = SpanOf<T>(array, function, name, shape);
  out->resize(values.size_bytes() / sizeof(Record));
  if (!values.empty()) std::memcpy(out->data(), values.data(), values.size_bytes());
}

}  // namespace

ImageU8 ImageFromPython(const char* function, const char* argument, const py::object& pixels) {
  const auto values = SpanOf<std::uint8_t>(pixels, function, argument, {kAny, kAny, kAny});
  const auto array = py::reinterpret_borrow<py::array>(pixels);
  ImageU8 image(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)),
                static_cast<int>(array.shape(2)));
  std::copy(values.begin(), values.end(), image.pixels.begin());
  return image;
}

py::dict MeshToDict(Mesh mesh) {
  const auto vertices = static_cast<py::ssize_t>(mesh.positions.size()),
             faces = static_cast<py::ssize_t>(mesh.faces.size());
  py::list materials, textures;
  for (const Material& m : mesh.materials) materials.append(MaterialToDict(m));
  for (MeshTexture& t : mesh.textures) textures.append(TextureToDict(std::move(t)));
  py::dict out;
  out["positions"] = OwnedArray<float>(std::move(mesh.positions), {vertices, 3});
  out["faces"] = OwnedArray<std::int32_t>(std::move(mesh.faces), {faces, 3});
  out["normals"] = ArrayOrNone<float>(std::move(mesh.normals), {vertices, 3});
  out["colors"] = ArrayOrNone<float>(std::move(mesh.colors), {vertices, 4});
  out["corner_uvs"] = ArrayOrNone<float>(std::move(mesh.corner_uvs), {faces, 3, 2});
  out["corner_normals"] = ArrayOrNone<float>(std::move(mesh.corner_normals), {faces, 3, 3});
  out["corner_colors"] = ArrayOrNone<float>(std::move(mesh.corner_colors), {faces, 3, 4});
  out["face_materials"] = ArrayOrNone<std::int32_t>(std::move(mesh.face_materials), {faces});
  out["materials"] = materials;
  out["textures"] = textures;
  return out;
}

Mesh MeshFromDict(const char* function, const py::dict& dict) {
  Mesh mesh;
  Read<float>(function, dict, "positions", {kAny, 3}, &mesh.positions);
  Read<std::int32_t>(function, dict, "faces", {kAny, 3}, &mesh.faces);
  Read<float>(function, dict, "normals", {kAny, 3}, &mesh.normals);
  Read<float>(function, dict, "colors", {kAny, 4}, &mesh.colors);
  Read<float>(function, dict, "corner_uvs", {kAny, 3, 2}, &mesh.corner_uvs);
  Read<float>(function, dict, "corner_normals", {kAny, 3, 3}, &mesh.corner_normals);
  Read<float>(function, dict, "corner_colors", {kAny, 3, 4}, &mesh.corner_colors);
  Read<std::int32_t>(function, dict, "face_materials", {kAny}, &mesh.face_materials);
  for (const py::handle m : dict["materials"])
    mesh.materials.push_back(MaterialFromDict(function, py::cast<py::dict>(m)));
  for (const py::handle t : dict["textures"])
    mesh.textures.push_back(TextureFromDict(function, py::cast<py::dict>(t)));
  return mesh;
}

}  // namespace tilegrad::python
