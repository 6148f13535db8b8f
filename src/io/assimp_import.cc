// SPDX-License-Identifier: Apache-2.0
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cstring>
#include <glm/mat4x4.hpp>
#include <iterator>
#include <memory>
#include <set>

#include "base/error.h"
#include "io/imported_scene.h"

namespace tilegrad::io {
namespace {

using SharedBytes = std::shared_ptr<const Bytes>;

class AssimpStream : public Assimp::IOStream {
 public:
  explicit AssimpStream(SharedBytes bytes) : bytes_(std::move(bytes)) {}
  std::size_t Read(void* to, std::size_t size, std::size_t count) override {
    if (size == 0) return 0;
    const std::size_t whole = std::min(count, (bytes_->size() - at_) / size);
    if (whole > 0) std::memcpy(to, bytes_->data() + at_, whole * size);
    at_ += whole * size;
    return whole;
  }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  aiReturn Seek(std::size_t offset, aiOrigin origin) override {
    const std::size_t base = origin == aiOrigin_SET   ? 0
                             : origin == aiOrigin_CUR ? at_
                                                      : bytes_->size();
    const std::size_t target = origin == aiOrigin_END ? base - offset : base + offset;
    if (target > bytes_->size()) return aiReturn_FAILURE;
    at_ = target;
    return aiReturn_SUCCESS;
  }
  std::size_t Tell() const override { return at_; }
  std::size_t FileSize() const override { return bytes_->size(); }
  void Flush() override {}

 private:
  SharedBytes bytes_;
  std::size_t at_ = 0;
};

// Serves the file itself from memory, others from the parent; never writes.
class ParentFiles : public Assimp::IOSystem {
 public:
  ParentFiles(const std::string& name, const Bytes& file, AskParent ask)
      : name_(name), file_(SharedBytes(), &file), ask_(ask) {}
  bool Exists(const char* name) const override {
    return name == name_ || ask_(kAskExists + std::string(name)).has_value();
  }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char*) override {
    if (name == name_) return new AssimpStream(file_);  // Assimp owns it and calls Close
    auto bytes = ask_(kAskContent + std::string(name));
    return bytes ? new AssimpStream(std::make_shared<const Bytes>(std::move(*bytes))) : nullptr;
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  const std::string& name_;
  SharedBytes file_;
  AskParent ask_;
};

ImportedPart ConvertPart(const aiMesh& from) {
  ImportedPart part;
  part.name = from.mName.C_Str();
  part.material = from.mMaterialIndex;
  const auto vec3 = [](const aiVector3D& v) { return glm::vec3(v.x, v.y, v.z); };
  const auto vec2 = [](const aiVector3D& v) { return glm::vec2(v.x, v.y); };
  const auto vec4 = [](const aiColor4D& c) { return glm::vec4(c.r, c.g, c.b, c.a); };
  const auto copy = [&](const auto* array, auto convert, auto& to) {
    if (array == nullptr) return;
    to.reserve(from.mNumVertices);
    std::transform(array, array + from.mNumVertices, std::back_inserter(to), convert);
  };
  copy(from.mVertices, vec3, part.positions);
  copy(from.mNormals, vec3, part.normals);
  copy(from.mTextureCoords[0], vec2, part.uvs);
  copy(from.mColors[0], vec4, part.colors);
  part.triangles.reserve(from.mNumFaces);
  for (unsigned f = 0; f < from.mNumFaces; ++f) {
    const aiFace& face = from.mFaces[f];
    if (face.mNumIndices == 3)
      part.triangles.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
  }
  return part;
}

// Things with commas between.
class CommaList {
 public:
  void Add(bool is, std::string_view what) {
    if (is) text.append(text.empty() ? "" : ", ").append(what);
  }
  std::string text;
};

// What a material says about its image that we ignore: we use the first uv set, untransformed, with
// repeat.
std::string NotReadOfImage(const aiMaterial& from, aiTextureType type) {
  const auto value = [&](const char* key, auto fallback) {
    from.Get(key, type, 0, fallback);
    return fallback;
  };
  CommaList list;
  list.Add(value(_AI_MATKEY_MAPPING_BASE, int{aiTextureMapping_UV}) != aiTextureMapping_UV,
           "its projection (a sphere's, a box's, ...)");
  const int set = value(_AI_MATKEY_UVWSRC_BASE, 0);
  list.Add(set != 0, fmt::format("uv set {}; set 0 stands in", set));
  constexpr int kWrap = aiTextureMapMode_Wrap;
  list.Add(value(_AI_MATKEY_MAPPINGMODE_U_BASE, kWrap) != kWrap ||
               value(_AI_MATKEY_MAPPINGMODE_V_BASE, kWrap) != kWrap,
           "its wrapping (clamped, mirrored or once); it repeats");
  const auto t = value(_AI_MATKEY_UVTRANSFORM_BASE, aiUVTransform());
  list.Add(t.mTranslation != aiVector2D(0, 0) || t.mScaling != aiVector2D(1, 1) || t.mRotation != 0,
           "its uv transform");
  return list.text;
}

// Materials for physically based lighting have the one instead of the other.
aiTextureType TypeOfImage(const aiMaterial& from) {
  return from.GetTextureCount(aiTextureType_DIFFUSE) > 0 ? aiTextureType_DIFFUSE
                                                         : aiTextureType_BASE_COLOR;
}

// Other visible properties of a material that are dropped.
std::string LeftOutOf(const aiMaterial& from) {
  CommaList list;
  list.Add(from.GetTextureCount(TypeOfImage(from)) > 1, "layers of its image but the first");
  list.Add(from.GetTextureCount(aiTextureType_OPACITY) > 0, "its image of opacity");
  list.Add(from.GetTextureCount(aiTextureType_LIGHTMAP) > 0, "its light map");
  list.Add(from.GetTextureCount(aiTextureType_DISPLACEMENT) > 0, "its displacement");
  aiColor3D emission(0, 0, 0);
  from.Get(AI_MATKEY_COLOR_EMISSIVE, emission);
  list.Add(!emission.IsBlack() || from.GetTextureCount(aiTextureType_EMISSIVE) > 0, "its emission");
  return list.text;
}

ImportedMaterial ConvertMaterial(const aiMaterial& from, const aiScene& scene) {
  ImportedMaterial material;
  aiString text;
  if (from.Get(AI_MATKEY_NAME, text) == AI_SUCCESS) material.name = text.C_Str();
  aiColor3D diffuse(0.8f, 0.8f, 0.8f);
  float opacity = 1;
  from.Get(AI_MATKEY_COLOR_DIFFUSE, diffuse);
  from.Get(AI_MATKEY_OPACITY, opacity);
  material.color = {diffuse.r, diffuse.g, diffuse.b, opacity};
  const aiTextureType type = TypeOfImage(from);
  if (from.GetTexture(type, 0, &text) != AI_SUCCESS) return material;
  if (text == aiString("$texture_dummy.bmp")) return material;  // of an MD2 without a skin
  material.image = text.C_Str();
  material.not_read = NotReadOfImage(from, type);
  const aiTexture* embedded = scene.GetEmbeddedTexture(text.C_Str());
  for (unsigned i = 0; embedded != nullptr && i < scene.mNumTextures; ++i) {
    if (scene.mTextures[i] == embedded) material.embedded = static_cast<std::int32_t>(i);
  }
  return material;
}

ImportedImage ConvertImage(const aiTexture& from) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(from.pcData);
  const bool encoded = from.mHeight == 0 && bytes != nullptr;  // then the width is its size
  return {from.mFilename.C_Str(), encoded ? Bytes(bytes, bytes + from.mWidth) : Bytes()};
}

// Composed in double: a part near its node's origin may be placed far from the scene's.
void PlaceParts(const aiNode& node, const glm::dmat4& parent, ImportedScene& scene) {
  const aiMatrix4x4& m = node.mTransformation;
  const glm::dmat4 to_scene = parent * glm::dmat4(m.a1, m.b1, m.c1, m.d1, m.a2, m.b2, m.c2, m.d2,
                                                  m.a3, m.b3, m.c3, m.d3, m.a4, m.b4, m.c4, m.d4);
  for (unsigned i = 0; i < node.mNumMeshes; ++i)
    scene.instances.push_back({node.mMeshes[i], glm::dmat4x3(to_scene)});
  for (unsigned i = 0; i < node.mNumChildren; ++i) PlaceParts(*node.mChildren[i], to_scene, scene);
}

void WarnOfPart(const aiMesh& mesh, std::vector<std::string>* warnings) {
  const auto warn = [&](bool is, std::string_view what) {
    if (is) warnings->push_back(fmt::format("part \"{}\": {}", mesh.mName.C_Str(), what));
  };
  warn(mesh.mNumBones > 0 || mesh.mNumAnimMeshes > 0,
       "bones and morph targets are not read; it is drawn as it was modelled");
  warn(mesh.HasVertexColors(1), "sets of colours but the first left out");
  warn((mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) == 0, "points or lines left out");
}

// For the materials that parts use.
void WarnOfMaterials(const aiScene& from, std::vector<std::string>* warnings) {
  std::set<unsigned> used;
  for (unsigned i = 0; i < from.mNumMeshes; ++i) used.insert(from.mMeshes[i]->mMaterialIndex);
  for (const unsigned i : used) {
    if (i >= from.mNumMaterials) continue;
    const std::string left_out = LeftOutOf(*from.mMaterials[i]);
    if (left_out.empty()) continue;
    warnings->push_back(fmt::format("material \"{}\": left out: {}",
                                    from.mMaterials[i]->GetName().C_Str(), left_out));
  }
}

ImportedScene ConvertScene(const aiScene& from) {
  ImportedScene scene;
  for (unsigned i = 0; i < from.mNumMeshes; ++i) {
    scene.parts.push_back(ConvertPart(*from.mMeshes[i]));
    WarnOfPart(*from.mMeshes[i], &scene.warnings);
  }
  for (unsigned i = 0; i < from.mNumMaterials; ++i)
    scene.materials.push_back(ConvertMaterial(*from.mMaterials[i], from));
  WarnOfMaterials(from, &scene.warnings);
  for (unsigned i = 0; i < from.mNumTextures; ++i)
    scene.images.push_back(ConvertImage(*from.mTextures[i]));
  PlaceParts(*from.mRootNode, glm::dmat4(1), scene);
  return scene;
}

// A face without indices has no type, and Assimp writes out of bounds when it sorts faces by type.
void DropEmptyFaces(aiMesh& part) {
  const auto empty = [](const aiFace& face) { return face.mNumIndices == 0; };
  aiFace* const end = std::remove_if(part.mFaces, part.mFaces + part.mNumFaces, empty);
  part.mNumFaces = static_cast<unsigned>(end - part.mFaces);
}

// Sets the primitive types that a part really has. Some importers claim polygons where there are
// only lines, on which triangulation aborts the program.
void CorrectFaces(const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    aiMesh& part = *scene.mMeshes[m];
    DropEmptyFaces(part);
    part.mPrimitiveTypes = 0;
    for (unsigned f = 0; f < part.mNumFaces; ++f)
      part.mPrimitiveTypes |= AI_PRIMITIVE_TYPE_FOR_N_INDICES(part.mFaces[f].mNumIndices);
  }
}

}  // namespace

Result<ImportedScene> ImportByAssimp(const std::string& name, const Bytes& file, AskParent ask) {
  try {
    auto* importer = new Assimp::Importer;
    importer->SetIOHandler(new ParentFiles(name, file, ask));  // the importer owns it
    if (importer->ReadFile(name, 0) != nullptr) CorrectFaces(*importer->GetScene());
    const aiScene* scene =
        importer->ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType);
    if (scene == nullptr || scene->mRootNode == nullptr)
      return DataLoss("{}", importer->GetErrorString());
    return ConvertScene(*scene);
  } catch (const std::bad_alloc&) {
    throw;                                 // RunGuarded reports it
  } catch (const std::exception& error) {  // Assimp's importers throw on some broken files
    return DataLoss("{}", error.what());
  }
}

}  // namespace tilegrad::io
