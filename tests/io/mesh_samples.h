// SPDX-License-Identifier: Apache-2.0
// One small file of each format that Assimp reads for us, for tests.
#pragma once

#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <array>
#include <assimp/Exporter.hpp>
#include <string>
#include <vector>

#include "io/samples.h"

namespace tilegrad::io {

struct MeshSample {
  std::string name;  // a file name; its ending is the format's
  Bytes bytes;
};

inline constexpr std::array<std::array<float, 3>, 4> kCorners = {
    {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}}};
inline constexpr std::array<std::array<std::uint8_t, 3>, 4> kFaces = {
    {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
inline constexpr std::array<float, 3> kColor = {0.8f, 0.2f, 0.4f};

// Flat: every corner is a vertex, with a normal and a uv, as exporters want it.
inline aiMesh* MakeAssimpMesh() {
  auto* mesh = new aiMesh;
  mesh->mName = "tetrahedron";
  mesh->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
  mesh->mNumVertices = 12;
  mesh->mVertices = new aiVector3D[12];
  mesh->mNormals = new aiVector3D[12];
  mesh->mTextureCoords[0] = new aiVector3D[12];
  mesh->mNumUVComponents[0] = 2;
  mesh->mNumFaces = 4;
  mesh->mFaces = new aiFace[4];
  for (unsigned f = 0; f < 4; ++f) {
    mesh->mFaces[f].mNumIndices = 3;
    mesh->mFaces[f].mIndices = new unsigned[3];
    for (unsigned k = 0; k < 3; ++k) {
      const auto& [x, y, z] = kCorners[kFaces[f][k]];
      const unsigned v = 3 * f + k;
      mesh->mFaces[f].mIndices[k] = v;
      mesh->mVertices[v] = {x, y, z};
      mesh->mNormals[v] = {0, 0, 1};
      mesh->mTextureCoords[0][v] = {x, y / 2, 0};
    }
  }
  return mesh;
}

inline aiMaterial* MakeAssimpMaterial() {
  auto* material = new aiMaterial;
  const aiString name("paint");
  const aiColor4D color(kColor[0], kColor[1], kColor[2], 1);
  material->AddProperty(&name, AI_MATKEY_NAME);
  material->AddProperty(&color, 1, AI_MATKEY_COLOR_DIFFUSE);
  return material;
}

// By way of a file: some exporters cannot write to memory.
inline Bytes Export(const char* format, const Path& scratch) {
  aiScene scene;
  scene.mMeshes = new aiMesh* [1] { MakeAssimpMesh() };
  scene.mNumMeshes = 1;
  scene.mMaterials = new aiMaterial* [1] { MakeAssimpMaterial() };
  scene.mNumMaterials = 1;
  scene.mRootNode = new aiNode("root");
  scene.mRootNode->addChildren(1, std::array<aiNode*, 1>{new aiNode("child")}.data());
  aiNode& child = *scene.mRootNode->mChildren[0];
  child.mNumMeshes = 1;
  child.mMeshes = new unsigned[1]{0};
  Assimp::Exporter exporter;
  const Path file = scratch / format;
  EXPECT_EQ(exporter.Export(&scene, format, file.string()), aiReturn_SUCCESS)
      << format << ": " << exporter.GetErrorString();
  return ReadFile(file).value();
}

// All hold the tetrahedron above, perhaps with axes exchanged, and, where the format has materials,
// its colour. Assimp's exporters write the first ones, into the folder `scratch`.
inline std::vector<MeshSample> MakeMeshSamples(const Path& scratch) {
  std::vector<MeshSample> samples = {
      {"text.stl", Export("stl", scratch)},  {"binary.stl", Export("stlb", scratch)},
      {"a.3ds", Export("3ds", scratch)},     {"a.dae", Export("collada", scratch)},
      {"text.fbx", Export("fbxa", scratch)}, {"a.x3d", Export("x3d", scratch)}};
  for (const char* name : {"binary.fbx", "a.3mf", "a.x", "a.ase", "a.lwo", "a.ms3d", "a.md2"})
    samples.push_back({name, StoredSample(name)});
  return samples;
}

}  // namespace tilegrad::io
