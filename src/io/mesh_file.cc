// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_file.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <set>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/text.h"
#include "io/guarded_process.h"
#include "io/image_file.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"
#include "scene/shapes.h"

namespace tilegrad::io {
namespace {

struct Format {
  std::string_view endings;  // each between spaces
  Result<LoadedMesh> (*read)(const FileSource& source, const std::string& name);
};
// Assimp's importers run in child processes; the list has those that read sound files correctly
// (tests/io/assimp_formats_test.cc).
constexpr Format kFormats[] = {
    {" .glb .gltf ", ReadGltf},
    {" .obj ", ReadObj},
    {" .ply ", ReadPly},
    {" .off ", ReadOff},
    {" .ac .acc ", ReadAc3d},
    {" .stl .3ds .dae .fbx .3mf .x .x3d .ase .lwo .ms3d .md2 ", ReadByAssimp}};

const Format* FindFormat(const std::string& name) {
  const std::string ending = " " + MeshEnding(name) + " ";
  const auto* found = std::find_if(std::begin(kFormats), std::end(kFormats), [&](const Format& f) {
    return f.endings.find(ending) != std::string_view::npos;
  });
  return found == std::end(kFormats) ? nullptr : found;
}

std::string Folder(const std::string& name) {
  const auto slash = name.find_last_of('/');
  return slash == std::string::npos ? "" : name.substr(0, slash + 1);
}

// Files have many parts with few materials: drops the last one if it equals an earlier one.
void MergeLastMaterial(Mesh& mesh, std::size_t first_face) {
  const Material& last = mesh.materials.back();
  const auto found = std::find(mesh.materials.begin(), mesh.materials.end() - 1, last);
  if (found == mesh.materials.end() - 1) return;
  const auto index = static_cast<std::int32_t>(found - mesh.materials.begin());
  std::fill(mesh.face_materials.begin() + static_cast<std::ptrdiff_t>(first_face),
            mesh.face_materials.end(), index);
  mesh.materials.pop_back();
}

std::size_t BytesOf(const Mesh& mesh) {
  const auto bytes = [](const auto&... arrays) {
    return ((arrays.size() * sizeof(arrays[0])) + ...);
  };
  return bytes(mesh.positions, mesh.faces, mesh.normals, mesh.colors, mesh.corner_uvs,
               mesh.corner_normals);
}

glm::vec3 UnitOr(glm::vec3 normal, glm::vec3 fallback) {
  const glm::dvec3 n(normal);  // its square must not overflow
  const double length = glm::length(n);
  return length > 0 ? glm::vec3(n / length) : fallback;
}

// Normals follow from the surface, so a non-finite one is no reason to refuse the mesh.
void DropNonFiniteNormals(LoadedMesh& loaded) {
  bool dropped = false;
  for (auto* normals :
       {&loaded.mesh.normals, &loaded.mesh.corner_normals, &loaded.tables.normals}) {
    for (glm::vec3& normal : *normals) {
      if (std::isfinite(normal.x) && std::isfinite(normal.y) && std::isfinite(normal.z)) continue;
      normal = glm::vec3(0);  // MakeNormalsUnit replaces it by the surface's own
      dropped = true;
    }
  }
  if (dropped)
    loaded.warnings.emplace_back("normals that are not finite are computed from the surface");
}

// Files hold normals of any length, zero included.
void MakeNormalsUnit(Mesh& mesh) {
  if (mesh.normals.empty() && mesh.corner_normals.empty()) return;
  const auto smooth = SmoothNormals(mesh);
  for (std::size_t v = 0; v < mesh.normals.size(); ++v)
    mesh.normals[v] = UnitOr(mesh.normals[v], smooth[v]);
  for (std::size_t c = 0; c < mesh.corner_normals.size(); ++c)
    mesh.corner_normals[c] = UnitOr(mesh.corner_normals[c], smooth[mesh.faces[c / 3][c % 3]]);
}

constexpr double kFar = 256;         // times its size
constexpr double kTooCoarse = 1024;  // steps across the mesh

struct ExactBounds {
  glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-low};
  double size() const { return std::max({high.x - low.x, high.y - low.y, high.z - low.z}); }
  double farthest(int axis) const { return std::max(std::abs(low[axis]), std::abs(high[axis])); }
};

// Indices are not validated yet.
template <class Use>
void EachUsed(const LoadedMesh& loaded, Use use) {
  for (const Face& face : loaded.mesh.faces) {
    for (const std::int32_t v : face) {
      if (v >= 0 && static_cast<std::size_t>(v) < loaded.exact.size()) use(loaded.exact[v]);
    }
  }
}

ExactBounds BoundsOf(const LoadedMesh& loaded) {
  ExactBounds b;
  EachUsed(loaded, [&](const glm::dvec3& p) {
    b.low = glm::min(b.low, p);
    b.high = glm::max(b.high, p);
  });
  return b;
}

double FloatStep(double value) {
  const auto f = static_cast<float>(value);
  return std::nextafter(f, std::numeric_limits<float>::infinity()) - f;
}

// The step between the coordinates of an axis, if all are numbers of float precision that is too
// coarse for the mesh; else 0. Text with few digits also gives such numbers.
double CoarseStep(const LoadedMesh& loaded, const ExactBounds& bounds, int axis) {
  const double step = FloatStep(bounds.farthest(axis));
  if (step * kTooCoarse <= bounds.size()) return 0;
  bool floats = true;
  std::set<double> values;
  EachUsed(loaded, [&](const glm::dvec3& p) {
    floats = floats && static_cast<double>(static_cast<float>(p[axis])) == p[axis];
    if (floats && values.size() < 2 * kTooCoarse) values.insert(p[axis]);
  });
  if (!floats || values.size() < 3) return 0;  // two values, as of a box, do not show a step
  double least = std::numeric_limits<double>::infinity();
  for (auto at = values.begin(); at != values.end() && std::next(at) != values.end(); ++at)
    least = std::min(least, *std::next(at) - *at);
  return std::isfinite(least) ? std::max(least, step) : step;
}

std::string Point(const glm::dvec3& p) { return fmt::format("({}, {}, {})", p.x, p.y, p.z); }

void WarnOfSteps(LoadedMesh& loaded, const ExactBounds& bounds, const glm::dvec3& origin) {
  std::string axes;
  double step = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double here = CoarseStep(loaded, bounds, axis);
    if (here > 0) axes += fmt::format("{}{}", axes.empty() ? "" : ", ", "xyz"[axis]);
    step = std::max(step, here);
  }
  if (axes.empty()) return;
  loaded.Warn(
      "the coordinates lack precision: around {}, {} come in steps of {}, and the mesh "
      "is {} across; move it near the origin, or write more digits",
      Point(origin), axes, step, bounds.size());
}

// A round point near the centre, so that subtracting it keeps round numbers round.
glm::dvec3 OriginFor(const ExactBounds& bounds) {
  const double unit = std::exp2(std::ceil(std::log2(bounds.size())));
  return unit * glm::round((0.5 * bounds.low + 0.5 * bounds.high) / unit);
}

void MoveCameras(LoadedMesh& loaded) {
  for (MeshFileCamera& camera : loaded.cameras) {
    for (int axis = 0; axis < 3; ++axis)
      camera.camera.node_to_world[static_cast<std::size_t>(4 * axis + 3)] -= loaded.origin[axis];
  }
}

// Sets the mesh's positions from `exact`, which it consumes. If the mesh is farther from the origin
// than 256 times its size, float would keep less than 16 bits of its shape: then subtracts a point
// near its centre first, from cameras too, stores it in `origin`, and warns. Also warns of
// coordinates in steps due to the file's own low precision.
void PlaceNearOrigin(LoadedMesh& loaded) {
  const ExactBounds bounds = BoundsOf(loaded);
  const double farthest = std::max({bounds.farthest(0), bounds.farthest(1), bounds.farthest(2)});
  if (bounds.size() > 0 && std::isfinite(farthest) && farthest > kFar * bounds.size()) {
    loaded.origin = OriginFor(bounds);
    MoveCameras(loaded);
    loaded.Warn(
        "{} was subtracted from all coordinates, which are too far from the origin for their size",
        Point(loaded.origin));
    WarnOfSteps(loaded, bounds, loaded.origin);
  }
  loaded.mesh.positions.clear();
  for (const glm::dvec3& p : loaded.exact) loaded.mesh.positions.emplace_back(p - loaded.origin);
  loaded.exact = {};
}

// An error of the file itself names it already, one of a part or a side file does not.
Status WithinOnce(const Status& status, const std::string& place) {
  return status.message().starts_with(place + ":") ? status : status.Within(place);
}

}  // namespace

std::string ShortList(const std::set<std::string, std::less<>>& names) {
  constexpr std::size_t kMost = 8;
  std::string list;
  std::size_t count = 0;
  for (const std::string& name : names) {
    if (count++ == kMost) break;
    list += fmt::format("{}\"{}\"", list.empty() ? "" : ", ", name);
  }
  if (names.size() > kMost) list += fmt::format(" and {} more", names.size() - kMost);
  return list;
}

std::optional<std::string> FindBeside(const FileSource& source, const std::string& mesh_name,
                                      std::string_view mentioned) {
  std::string slashes(mentioned);
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  for (const std::string& name : {slashes, DecodePercent(slashes)}) {
    const std::string base = name.substr(name.find_last_of('/') + 1);
    for (const std::string& candidate : {Folder(mesh_name) + name, Folder(mesh_name) + base}) {
      if (source.Exists(candidate)) return candidate;
    }
  }
  return std::nullopt;
}

std::optional<std::string> FindByUri(const FileSource& source, const std::string& mesh_name,
                                     std::string_view uri) {
  auto found = FindBeside(source, mesh_name, DecodePercent(uri));
  return found ? found : FindBeside(source, mesh_name, uri);
}

int AddTexture(Result<ImageU8> image, const std::string& image_name, LoadedMesh& out) {
  if (!image.ok()) {
    out.Warn("texture left out: {}", image.status().message());
    out.lost_appearance.push_back(image.status());
    return -1;
  }
  out.mesh.textures.push_back({image_name, ToColor(std::move(image).value())});
  return static_cast<int>(out.mesh.textures.size()) - 1;
}

int AddTextureFile(const FileSource& source, const std::optional<std::string>& file,
                   const std::string& image_name, LoadedMesh& out) {
  if (!file) {
    out.Warn("texture \"{}\" not found; the material's colour stands in", image_name);
    out.lost_appearance.push_back(NotFound("{}: no such texture", image_name));
    return -1;
  }
  // Not by name alone: an image inside the mesh may have the same one.
  const std::string key = NormalizeName(*file).value_or(*file);
  const auto [known, added] = out.texture_of_file.try_emplace(key, -1);
  if (!added) return known->second;
  const auto bytes = source.Read(*file);
  known->second = AddTexture(
      bytes.ok() ? DecodeImage(*bytes, source.Describe(*file)) : bytes.status(), image_name, out);
  return known->second;
}

int AddTexture(const FileSource& source, const std::string& mesh_name,
               const std::string& image_name, LoadedMesh& out) {
  return AddTextureFile(source, FindBeside(source, mesh_name, image_name), image_name, out);
}

Status AppendWithMaterial(Mesh part, const Material& material, LoadedMesh& out,
                          std::span<const glm::dvec3> exact) {
  if (out.mesh.positions.size() + part.positions.size() > kMaxMeshElements ||
      out.mesh.faces.size() + part.faces.size() > kMaxMeshElements) {
    return ResourceExhausted("the mesh has more than {} vertices or faces", kMaxMeshElements);
  }
  TILEGRAD_TRY(ReadBudget::Take(BytesOf(part), "vertices and faces"));
  out.exact.insert(out.exact.end(), exact.begin(), exact.end());
  // Until PlaceNearOrigin, positions only serve for missing normals of parts: small numbers,
  // however far away.
  const glm::dvec3 near = part.faces.empty() ? glm::dvec3(0) : exact[part.faces[0][0]];
  for (std::size_t v = 0; v < exact.size(); ++v) part.positions[v] = glm::vec3(exact[v] - near);
  const std::size_t faces_before = out.mesh.faces.size();
  part.materials = {Material{}};
  part.face_materials.assign(part.faces.size(), 0);
  if (out.mesh.faces.empty()) {
    std::swap(part.textures, out.mesh.textures);
    out.mesh = std::move(part);
  } else {
    Append(out.mesh, part);
  }
  out.mesh.materials.back() = material;
  MergeLastMaterial(out.mesh, faces_before);
  return {};
}

Status AppendFacesWithMaterial(const Mesh& part, std::int32_t first, const Material& material,
                               LoadedMesh& out) {
  Mesh& mesh = out.mesh;
  const std::size_t before = mesh.faces.size(), after = before + part.faces.size();
  if (after > kMaxMeshElements)
    return ResourceExhausted("the mesh has more than {} vertices or faces", kMaxMeshElements);
  TILEGRAD_TRY(ReadBudget::Take(BytesOf(part), "vertices and faces"));
  for (const auto& [a, b, c] : part.faces) mesh.faces.push_back({a + first, b + first, c + first});
  if (!mesh.corner_uvs.empty() || !part.corner_uvs.empty()) {
    mesh.corner_uvs.resize(3 * before, glm::vec2(0));
    mesh.corner_uvs.insert(mesh.corner_uvs.end(), part.corner_uvs.begin(), part.corner_uvs.end());
    mesh.corner_uvs.resize(3 * after, glm::vec2(0));
  }
  mesh.face_materials.resize(after, static_cast<std::int32_t>(mesh.materials.size()));
  mesh.materials.push_back(material);
  MergeLastMaterial(mesh, before);
  return {};
}

void Polygon::AddTo(LoadedMesh& out) {
  positions_.clear();
  for (const std::int32_t v : corners)
    positions_.emplace_back(out.exact[v] - out.exact[corners[0]]);  // small numbers, however far
  TriangulatePolygon(positions_, triangles);
  for (const auto& [a, b, c] : triangles)
    out.mesh.faces.push_back({corners[a], corners[b], corners[c]});
}

std::string MeshEnding(const std::string& name) {
  return LowerCase(Path(name).extension().string());
}

std::string MeshFileEndings() {
  std::string list;
  for (auto [rest, read] : kFormats) {
    for (auto ending = NextToken(rest); !ending.empty(); ending = NextToken(rest))
      list.append(list.empty() ? "" : ", ").append(ending);
  }
  return list;
}

bool IsMeshFileName(const std::string& name) { return FindFormat(name) != nullptr; }

Result<LoadedMesh> LoadMesh(const FileSource& source, const std::string& name) {
  const std::string place = source.Describe(name);
  const Format* format = FindFormat(name);
  if (format == nullptr && !source.Exists(name)) return NotFound("{}: no such file", place);
  if (format == nullptr) {
    return InvalidArgument("{}: \"{}\" is not the extension of a supported mesh format ({})", place,
                           MeshEnding(name), MeshFileEndings());
  }
  const ShortageWatch watch;
  const ReadBudget budget;
  auto loaded = format->read(source, name);
  if (GuardedMustStop()) return Cancelled("{}: stopped while it was read", place);
  TILEGRAD_TRY(watch.Check(place));
  TILEGRAD_TRY(WithinOnce(budget.status(), place));  // even if a texture was dropped
  if (!loaded.ok()) return loaded.status();
  if (loaded->mesh.faces.empty()) return DataLoss("{}: no triangles in it", place);
  loaded->texture_of_file.clear();
  PlaceNearOrigin(*loaded);
  DropNonFiniteNormals(*loaded);
  if (const Status valid = Validate(loaded->mesh); !valid.ok())
    return DataLoss("{}: {}", place, valid.message());
  for (auto* colors : {&loaded->mesh.colors, &loaded->mesh.corner_colors})
    FinishColors(ColorNumbers::kShown, colors, &loaded->warnings);
  const bool gltf = format->read == ReadGltf;
  FinishMaterials(gltf ? ColorNumbers::kLinear : ColorNumbers::kShown, *loaded);
  if (!gltf) WarnOfTransparentColors(*loaded);  // glTF says when alpha counts
  MakeNormalsUnit(loaded->mesh);
  return loaded;
}

Result<LoadedMesh> LoadMesh(const Path& path) {
  if (IsFolder(path))
    return InvalidArgument("{}: is a folder; name a mesh file in it", path.string());
  // The source starts one folder above the mesh's: textures often are in "../images".
  Path folder = path.parent_path();
  const Path last = folder.filename();
  if (last.empty() || last == "." || last == "..") {
    std::error_code error;
    folder = std::filesystem::absolute(path, error).lexically_normal().parent_path();
  }
  const Path above = folder.has_parent_path() ? folder.parent_path() : Path(".");
  std::vector<Path> files;
  auto loaded =
      LoadMesh(*OpenFolder(above, &files), (folder.filename() / path.filename()).string());
  if (loaded.ok()) loaded->files = std::move(files);
  return loaded;
}

}  // namespace tilegrad::io
