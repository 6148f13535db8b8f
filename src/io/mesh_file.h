// SPDX-License-Identifier: Apache-2.0
// Mesh files: glTF and GLB (tinygltf); OBJ with MTL, PLY, OFF and AC3D (our own readers); STL, 3DS,
// Collada, FBX, 3MF, DirectX X, X3D, ASE, LWO, MS3D and MD2 (Assimp, in a child process per file).
#pragma once

#include <fmt/format.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "io/archive.h"
#include "scene/camera_conventions.h"
#include "scene/mesh.h"

namespace tilegrad::io {

// A perspective camera in the file (glTF only).
struct MeshFileCamera {
  std::string name;  // of the camera, else of its node, else empty
  GltfCamera camera;
};

// The file's own lists of texture coordinates and normals, shared by corners: OBJ only. As written:
// of any length, without the material's texture transform.
struct MeshFileTables {
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec3> normals;
  std::vector<std::int32_t> corner_uvs, corner_normals;  // [3F] indices; -1: the corner has none
};

// Faces from `first_face` up to the next part's belong to the object of that name.
struct MeshFilePart {
  std::string name;
  std::size_t first_face = 0;
};

struct LoadedMesh {
  Mesh mesh;  // valid (scene/mesh.h: Validate), with at least one face; all parts merged, node
              // transforms applied, polygons triangulated, normals unit, colours in [0, 1]
  std::vector<std::string> warnings;  // what was missing or dropped, and its substitute
  // Why images and material libraries named by the file are missing or unreadable. Also in
  // warnings.
  std::vector<Status> lost_appearance;
  std::vector<MeshFileCamera> cameras;  // in the order of the scene's nodes
  MeshFileTables tables;
  std::vector<MeshFilePart> parts;  // ascending; AC3D only
  // Subtracted from the file's coordinates, cameras included: positions + origin is the position in
  // the world. 0, unless the mesh is farther from the origin than 256 times its size.
  glm::dvec3 origin{0};
  // Scratch of readers, empty afterwards: positions before rounding, textures by file.
  std::vector<glm::dvec3> exact;
  std::map<std::string, int> texture_of_file;
  std::vector<Path> files;  // files read: the mesh, its MTL, buffers and images

  template <class... Args>
  void Warn(fmt::format_string<Args...> format, Args&&... args) {
    warnings.push_back(fmt::format(format, std::forward<Args>(args)...));
  }
};

// OBJ, PLY, OFF, AC3D, glTF: the file's vertices in its order, once each, used by faces or not.
// Assimp repeats a vertex for each corner; equal ones are merged.
//
// The extension selects the format. Errors name the file and, if the format has positions, the
// position in it. A missing texture is a warning; the material's colour replaces it. Lines and
// points are dropped with a warning. Side files (MTL, images) are searched for in the mesh's folder
// and its sibling folders.
Result<LoadedMesh> LoadMesh(const Path& path);
Result<LoadedMesh> LoadMesh(const FileSource& source, const std::string& name);

// The supported extensions, for messages: ".glb, .gltf, ...".
std::string MeshFileEndings();

// Whether LoadMesh reads this extension (any case).
bool IsMeshFileName(const std::string& name);

// Writes meshes as binary glTF 2.0, which every viewer opens.

struct GlbOptions {
  glm::dvec3 origin = glm::dvec3(0);  // translation of the node, in double: LoadedMesh::origin
  // Adds a white directional light from this direction, not 0 (KHR_lights_punctual): a surface
  // facing it shows its base colour. Lights materials that are not `unlit`.
  std::optional<glm::dvec3> sun = std::nullopt;
};

// One primitive per used material. Keeps positions, faces, normals, vertex colours, uv, base
// colours, textures (embedded as PNG) and all other material properties; per-corner attributes
// split vertices where necessary. Stores linear colours, as glTF requires; LoadMesh converts them
// back. An error if the mesh is not valid or has no face.
Result<Bytes> EncodeGlb(const Mesh& mesh, const GlbOptions& options = {});
Status SaveGlb(const Path& path, const Mesh& mesh, const GlbOptions& options = {});  // atomic

}  // namespace tilegrad::io
