// SPDX-License-Identifier: Apache-2.0
// Mesh files: glTF and GLB (tinygltf); OBJ with MTL, PLY, OFF and AC3D (readers of our own); STL,
// 3DS, Collada, FBX, 3MF, DirectX X, X3D, ASE, LWO, MS3D and MD2 (Assimp, in a process of its own
// for each file).
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "io/archive.h"
#include "scene/camera_conventions.h"
#include "scene/mesh.h"

namespace tilegrad::io {

// A perspective camera that the file holds (glTF only).
struct MeshFileCamera {
  std::string name;  // of the camera, else of its node, else empty
  GltfCamera camera;
};

// A file's own lists of texture coordinates and normals, which corners share: OBJ only. As written:
// of any length, without the material's texture transform.
struct MeshFileTables {
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec3> normals;
  std::vector<std::int32_t> corner_uvs, corner_normals;  // [3F] indices; -1: a corner without
};

// Faces from `first_face` up to the next part's are of the object of that name.
struct MeshFilePart {
  std::string name;
  std::size_t first_face = 0;
};

struct LoadedMesh {
  Mesh mesh;  // valid (scene/mesh.h: Validate), with at least one face; all parts merged, node
              // transforms applied, polygons split, normals unit, colours in [0, 1]
  std::vector<std::string> warnings;  // what was missing or dropped, and its substitute
  // Of images and material libraries that the file names: why each is missing, or cannot be read.
  // They are warnings, too.
  std::vector<Status> lost_appearance;
  std::vector<MeshFileCamera> cameras;  // in the order of the scene's nodes
  MeshFileTables tables;
  std::vector<MeshFilePart> parts;  // ascending; AC3D only
  // What was subtracted from the file's coordinates, from cameras too: positions + origin is the
  // place in the world. 0, unless the mesh is farther from the origin than 256 times its size.
  glm::dvec3 origin{0};
  // Of readers, empty afterwards: positions before they are rounded, textures by their files.
  std::vector<glm::dvec3> exact;
  std::map<std::string, int> texture_of_file;
  std::vector<Path> files;  // that were read: the mesh, its MTL, buffers and images
};

// Vertices are those of the file, in its order, once each, whether a face uses them or not: OBJ,
// PLY, OFF, AC3D, glTF. Assimp's formats repeat a vertex for each corner; equal ones are merged.
//
// The format follows the file name's ending. Errors name the file and, where the format has places,
// the place in it. A missing texture is a warning; the material's colour stands in. Lines and
// points are left out with a warning. Side files (MTL, images) are looked for in the mesh's folder
// and in the folders beside it.
Result<LoadedMesh> LoadMesh(const Path& path);
Result<LoadedMesh> LoadMesh(const FileSource& source, const std::string& name);

// The endings that are read, for messages: ".glb, .gltf, ...".
std::string MeshFileEndings();

// Whether the ending (any case) is one that LoadMesh reads.
bool IsMeshFileName(const std::string& name);

// Writes meshes as binary glTF 2.0, which every viewer opens.

struct GlbOptions {
  glm::dvec3 origin = glm::dvec3(0);  // added by the node, in double: LoadedMesh::origin
  // From this direction, not 0, comes a white directional light (KHR_lights_punctual): a surface
  // that faces it has its base colour. It lights materials that are not `unlit`.
  std::optional<glm::dvec3> sun = std::nullopt;
};

// One primitive a material that is used. Positions, faces, normals, vertex colours, uv, base
// colours, textures (as PNG inside) and everything else of materials are kept; per-corner
// attributes split vertices where they must. Colours are stored linear, as glTF asks; LoadMesh
// turns them back. An error if the mesh is not valid or has no face.
Result<Bytes> EncodeGlb(const Mesh& mesh, const GlbOptions& options = {});
Status SaveGlb(const Path& path, const Mesh& mesh,
               const GlbOptions& options = {});  // whole or not at all

}  // namespace tilegrad::io
