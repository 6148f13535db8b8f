// SPDX-License-Identifier: Apache-2.0
// Mesh files: glTF and GLB (tinygltf); PLY, OFF and AC3D; OBJ with MTL, STL, 3DS, Collada, FBX,
// 3MF, DirectX X, X3D, ASE, LWO and MS3D (Assimp, in a process of its own for each file).
#pragma once

#include <string>
#include <vector>

#include "io/archive.h"
#include "scene/camera_conventions.h"
#include "scene/mesh.h"

namespace tilegrad::io {

// A perspective camera that the file holds (glTF only).
struct MeshFileCamera {
  std::string name;  // of the camera, else of its node, else empty
  GltfCamera camera;
};

struct LoadedMesh {
  Mesh mesh;  // valid (scene/mesh.h: Validate), with at least one face; all parts merged, node
              // transforms applied, polygons split, normals unit, colours in [0, 1]
  std::vector<std::string> warnings;    // what was missing or dropped, and its substitute
  std::vector<MeshFileCamera> cameras;  // in the order of the scene's nodes
  std::vector<Path> files;              // that were read: the mesh, its MTL, buffers and images
};

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

}  // namespace tilegrad::io
