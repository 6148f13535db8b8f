// SPDX-License-Identifier: Apache-2.0
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <unordered_map>

#include "base/error.h"
#include "io/image_file.h"
#include "io/mesh_readers.h"
#include "scene/shapes.h"

namespace tilegrad::io {
namespace {

class MemoryStream : public Assimp::IOStream {
 public:
  explicit MemoryStream(Bytes bytes) : bytes_(std::move(bytes)) {}
  std::size_t Read(void* to, std::size_t size, std::size_t count) override {
    if (size == 0) return 0;
    const std::size_t whole = std::min(count, (bytes_.size() - at_) / size);
    std::memcpy(to, bytes_.data() + at_, whole * size);
    at_ += whole * size;
    return whole;
  }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  aiReturn Seek(std::size_t offset, aiOrigin origin) override {
    const std::size_t base = origin == aiOrigin_SET   ? 0
                             : origin == aiOrigin_CUR ? at_
                                                      : bytes_.size();
    const std::size_t target = origin == aiOrigin_END ? base - offset : base + offset;
    if (target > bytes_.size()) return aiReturn_FAILURE;
    at_ = target;
    return aiReturn_SUCCESS;
  }
  std::size_t Tell() const override { return at_; }
  std::size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  Bytes bytes_;
  std::size_t at_ = 0;
};

// Lets Assimp read side files (MTL) from a folder or archive; nothing is ever written.
class SourceSystem : public Assimp::IOSystem {
 public:
  explicit SourceSystem(const FileSource& source) : source_(source) {}
  bool Exists(const char* name) const override { return source_.Exists(name); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char*) override {
    auto bytes = source_.Read(name);
    return bytes.ok() ? new MemoryStream(std::move(bytes).value())
                      : nullptr;  // Assimp owns it and calls Close
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  const FileSource& source_;
};

glm::vec3 ToVec3(const aiVector3D& v) { return {v.x, v.y, v.z}; }

// Corners that agree in position and colour become one vertex; uv and normals stay per corner.
class Welder {
 public:
  explicit Welder(Mesh& mesh) : mesh_(mesh) {}
  std::int32_t Add(glm::vec3 position, const aiColor4D* color) {
    std::string key(reinterpret_cast<const char*>(&position), sizeof(position));
    if (color != nullptr) key.append(reinterpret_cast<const char*>(color), sizeof(*color));
    const auto [it, added] =
        seen_.try_emplace(std::move(key), static_cast<std::int32_t>(mesh_.positions.size()));
    if (added) {
      mesh_.positions.push_back(position);
      if (color != nullptr) mesh_.colors.emplace_back(color->r, color->g, color->b, color->a);
    }
    return it->second;
  }

 private:
  Mesh& mesh_;
  std::unordered_map<std::string, std::int32_t> seen_;
};

Result<Mesh> ConvertPart(const aiMesh& part, const std::string& place) {
  Mesh mesh;
  Welder welder(mesh);
  const aiColor4D* colors = part.mColors[0];
  std::vector<std::int32_t> vertex(part.mNumVertices);
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    vertex[i] = welder.Add(ToVec3(part.mVertices[i]), colors == nullptr ? nullptr : &colors[i]);
  }
  for (unsigned f = 0; f < part.mNumFaces; ++f) {
    const aiFace& face = part.mFaces[f];
    if (face.mNumIndices != 3) continue;
    for (int k = 0; k < 3; ++k) {
      if (face.mIndices[k] >= part.mNumVertices) {
        return DataLoss("{}: face {} uses vertex {} of {}", place, f, face.mIndices[k],
                        part.mNumVertices);
      }
    }
    mesh.faces.push_back(
        {vertex[face.mIndices[0]], vertex[face.mIndices[1]], vertex[face.mIndices[2]]});
    for (int k = 0; k < 3; ++k) {
      const unsigned i = face.mIndices[k];
      if (part.mTextureCoords[0] != nullptr) {
        mesh.corner_uvs.emplace_back(part.mTextureCoords[0][i].x, part.mTextureCoords[0][i].y);
      }
      if (part.mNormals != nullptr) mesh.corner_normals.push_back(ToVec3(part.mNormals[i]));
    }
  }
  return mesh;
}

// Materials of one scene, converted at first use, so that unused ones ask for no texture.
class Materials {
 public:
  Materials(const aiScene& scene, const FileSource& source, const std::string& name)
      : scene_(scene), source_(source), name_(name) {}

  Material Get(unsigned index, LoadedMesh& out) {
    Material material;
    if (index >= scene_.mNumMaterials) return material;
    const aiMaterial& from = *scene_.mMaterials[index];
    aiString text;
    if (from.Get(AI_MATKEY_NAME, text) == AI_SUCCESS) material.name = text.C_Str();
    aiColor3D diffuse(0.8f, 0.8f, 0.8f);
    float opacity = 1;
    from.Get(AI_MATKEY_COLOR_DIFFUSE, diffuse);
    from.Get(AI_MATKEY_OPACITY, opacity);
    material.base_color = {diffuse.r, diffuse.g, diffuse.b, opacity};
    if (from.GetTexture(aiTextureType_DIFFUSE, 0, &text) == AI_SUCCESS) {
      material.base_color_texture = Texture(text.C_Str(), out);
      // With a texture, OBJ's Kd is often left black or grey by exporters; the image alone is what
      // people meant.
      if (material.base_color_texture >= 0) material.base_color = {1, 1, 1, opacity};
    }
    return material;
  }

 private:
  int Texture(const std::string& image, LoadedMesh& out) {
    const aiTexture* embedded = scene_.GetEmbeddedTexture(image.c_str());
    if (embedded == nullptr) return AddTexture(source_, name_, image, out);
    if (embedded->mHeight != 0) {
      out.warnings.push_back(
          fmt::format("texture \"{}\" left out: embedded without compression", image));
      return -1;
    }
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(embedded->pcData);
    return AddTexture(DecodeImage({bytes, embedded->mWidth}, image), image, out);
  }

  const aiScene& scene_;
  const FileSource& source_;
  const std::string& name_;
};

struct NodeWalk {
  const aiScene& scene;
  std::string place;
  Materials materials;
  LoadedMesh out;
  std::unordered_map<unsigned, Material> converted;

  Status Visit(const aiNode& node, const aiMatrix4x4& parent) {
    const aiMatrix4x4 m = parent * node.mTransformation;
    for (unsigned i = 0; i < node.mNumMeshes; ++i)
      TILEGRAD_TRY(AddPart(*scene.mMeshes[node.mMeshes[i]], m));
    for (unsigned i = 0; i < node.mNumChildren; ++i) TILEGRAD_TRY(Visit(*node.mChildren[i], m));
    return {};
  }

  Status AddPart(const aiMesh& part, const aiMatrix4x4& m) {
    if ((part.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) == 0) {
      out.warnings.push_back(
          fmt::format("part \"{}\": points or lines left out", part.mName.C_Str()));
      return {};
    }
    TILEGRAD_ASSIGN(Mesh mesh, ConvertPart(part, place));
    if (mesh.faces.empty()) return {};
    if (!m.IsIdentity()) {
      Transform(
          mesh,
          {glm::vec3(m.a1, m.b1, m.c1), glm::vec3(m.a2, m.b2, m.c2), glm::vec3(m.a3, m.b3, m.c3)},
          {m.a4, m.b4, m.c4});
    }
    auto it = converted.find(part.mMaterialIndex);
    if (it == converted.end()) {
      it = converted.emplace(part.mMaterialIndex, materials.Get(part.mMaterialIndex, out)).first;
    }
    return AppendWithMaterial(std::move(mesh), it->second, out).Within(place);
  }
};

// Says what a part really holds. Some importers claim polygons where there are lines only, upon
// which triangulation aborts the program.
void CorrectPrimitiveTypes(const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    aiMesh& part = *scene.mMeshes[m];
    part.mPrimitiveTypes = 0;
    for (unsigned f = 0; f < part.mNumFaces; ++f)
      part.mPrimitiveTypes |= AI_PRIMITIVE_TYPE_FOR_N_INDICES(part.mFaces[f].mNumIndices);
  }
}

Result<LoadedMesh> Import(const FileSource& source, const std::string& name) {
  const std::string place = source.Describe(name);
  Assimp::Importer importer;
  importer.SetIOHandler(new SourceSystem(source));  // the importer owns it
  if (importer.ReadFile(name, 0) != nullptr) CorrectPrimitiveTypes(*importer.GetScene());
  const aiScene* scene =
      importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType);
  if (scene == nullptr || scene->mRootNode == nullptr) {
    return DataLoss("{}: {}", place, importer.GetErrorString());
  }
  NodeWalk walk{*scene, place, Materials(*scene, source, name), {}, {}};
  TILEGRAD_TRY(walk.Visit(*scene->mRootNode, aiMatrix4x4()));
  return std::move(walk.out);
}

}  // namespace

Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name) {
  const std::string place = source.Describe(name);
  if (!source.Exists(name)) return NotFound("{}: no such file", place);
  try {
    return Import(source, name);
  } catch (const std::exception& error) {  // Assimp's importers throw on some broken files
    return DataLoss("{}: {}", place, error.what());
  }
}

Result<LoadedMesh> ReadObj(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(const Bytes bytes, source.Read(name));
  TILEGRAD_TRY(
      CheckObj({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, source.Describe(name)));
  return ReadByAssimp(source, name);
}

}  // namespace tilegrad::io
