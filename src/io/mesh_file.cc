// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_file.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "base/error.h"
#include "io/image_file.h"
#include "io/mesh_readers.h"
#include "scene/shapes.h"

namespace tilegrad::io {
namespace {

// Vertices or faces of one mesh: 2^26 faces with all attributes take about 6 GB, and three times as
// many corners still have 32-bit indices.
constexpr std::size_t kMaxElements = std::size_t{1} << 26;

constexpr std::array<std::string_view, 2> kGltfEndings = {".gltf", ".glb"};
constexpr std::array<std::string_view, 13> kAssimpEndings = {
    ".obj", ".ac",  ".ply", ".stl",  ".off", ".dae", ".fbx",
    ".3ds", ".lwo", ".x",   ".ms3d", ".3mf", ".ase"};

std::string Ending(const std::string& name) {
  std::string ending = Path(name).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending;
}

template <class List>
bool Contains(const List& list, const std::string& ending) {
  return std::find(list.begin(), list.end(), ending) != list.end();
}

std::string Folder(const std::string& name) {
  const auto slash = name.find_last_of('/');
  return slash == std::string::npos ? "" : name.substr(0, slash + 1);
}

// Textures are 3 or 4 channels: grey becomes RGB, grey with alpha RGBA.
ImageU8 ToColor(ImageU8 image) {
  if (image.channels >= 3) return image;
  const bool alpha = image.channels == 2;
  ImageU8 out(image.width, image.height, alpha ? 4 : 3);
  const std::size_t count = static_cast<std::size_t>(image.width) * image.height;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint8_t* from = &image.pixels[i * image.channels];
    std::uint8_t* to = &out.pixels[i * out.channels];
    std::fill_n(to, 3, from[0]);
    if (alpha) to[3] = from[1];
  }
  return out;
}

}  // namespace

int AddTexture(Result<ImageU8> image, const std::string& image_name, LoadedMesh& out) {
  if (!image.ok()) {
    out.warnings.push_back(fmt::format("texture left out: {}", image.status().message()));
    return -1;
  }
  out.mesh.textures.push_back({image_name, ToColor(std::move(image).value())});
  return static_cast<int>(out.mesh.textures.size()) - 1;
}

int AddTexture(const FileSource& source, const std::string& mesh_name,
               const std::string& image_name, LoadedMesh& out) {
  for (std::size_t t = 0; t < out.mesh.textures.size(); ++t) {
    if (out.mesh.textures[t].name == image_name) return static_cast<int>(t);
  }
  std::string slashes = image_name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const std::string base = slashes.substr(slashes.find_last_of('/') + 1);
  for (const std::string& candidate : {Folder(mesh_name) + slashes, Folder(mesh_name) + base}) {
    if (!source.Exists(candidate)) continue;
    const auto bytes = source.Read(candidate);
    if (!bytes.ok()) return AddTexture(bytes.status(), image_name, out);
    return AddTexture(DecodeImage(*bytes, source.Describe(candidate)), image_name, out);
  }
  out.warnings.push_back(
      fmt::format("texture \"{}\" not found; the material's colour stands in", image_name));
  return -1;
}

Status AppendWithMaterial(Mesh part, const Material& material, LoadedMesh& out) {
  if (out.mesh.positions.size() + part.positions.size() > kMaxElements ||
      out.mesh.faces.size() + part.faces.size() > kMaxElements) {
    return ResourceExhausted("the mesh has more than {} vertices or faces", kMaxElements);
  }
  part.materials = {Material{}};
  part.face_materials.assign(part.faces.size(), 0);
  if (out.mesh.faces.empty()) {
    std::swap(part.textures, out.mesh.textures);
    out.mesh = std::move(part);
  } else {
    Append(out.mesh, part);
  }
  out.mesh.materials.back() = material;
  return {};
}

bool IsMeshFileName(const std::string& name) {
  const std::string ending = Ending(name);
  return Contains(kGltfEndings, ending) || Contains(kAssimpEndings, ending);
}

Result<LoadedMesh> LoadMesh(const FileSource& source, const std::string& name) {
  const std::string ending = Ending(name), place = source.Describe(name);
  const bool gltf = Contains(kGltfEndings, ending);
  if (!gltf && !Contains(kAssimpEndings, ending)) {
    return InvalidArgument(
        "{}: the ending \"{}\" is none of a mesh format that is read (glb, gltf, obj, ac, ply, "
        "stl, off, "
        "dae, fbx, 3ds, ...)",
        place, ending);
  }
  auto loaded = gltf ? ReadGltf(source, name) : ReadByAssimp(source, name);
  if (!loaded.ok()) return loaded.status();
  if (loaded->mesh.faces.empty()) return DataLoss("{}: no triangles in it", place);
  if (const Status valid = Validate(loaded->mesh); !valid.ok())
    return DataLoss("{}: {}", place, valid.message());
  return loaded;
}

Result<LoadedMesh> LoadMesh(const Path& path) {
  const Path folder = path.has_parent_path() ? path.parent_path() : Path(".");
  return LoadMesh(*OpenFolder(folder), path.filename().string());
}

}  // namespace tilegrad::io
