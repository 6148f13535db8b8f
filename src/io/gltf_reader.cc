// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/mat4x4.hpp>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "io/gltf_model.h"
#include "io/image_file.h"
#include "io/mesh_readers.h"
#include "scene/shapes.h"

namespace tilegrad::io {
namespace {

// Nodes without a parent.
std::vector<int> GltfRootNodes(const tinygltf::Model& model) {
  std::vector<bool> child(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const int c : node.children) {
      if (Has(child, c)) child[c] = true;
    }
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < child.size(); ++i) {
    if (!child[i]) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

// From its matrix, or from its translation, rotation and scale.
glm::dmat4 GltfLocalMatrix(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return glm::make_mat4(node.matrix.data());
  glm::dmat4 m(1);
  const auto& t = node.translation;
  const auto& r = node.rotation;
  const auto& s = node.scale;
  if (r.size() == 4) m = glm::mat4_cast(glm::normalize(glm::dquat(r[3], r[0], r[1], r[2])));
  if (s.size() == 3) {
    for (int c = 0; c < 3; ++c) m[c] *= s[static_cast<std::size_t>(c)];
  }
  if (t.size() == 3) m[3] = glm::dvec4(t[0], t[1], t[2], 1);
  return m;
}

// From each node to the world, whether it is part of a scene or not. Unspecified for nodes that
// form no tree.
std::vector<glm::dmat4> GltfWorldMatrices(const tinygltf::Model& model) {
  std::vector<glm::dmat4> world(model.nodes.size(), glm::dmat4(1));
  std::vector<bool> known(model.nodes.size(), false);
  std::vector<int> open = GltfRootNodes(model);
  for (const int root : open) world[root] = GltfLocalMatrix(model.nodes[root]);
  while (!open.empty()) {
    const int parent = open.back();
    open.pop_back();
    if (known[parent]) continue;
    known[parent] = true;
    for (const int child : model.nodes[parent].children) {
      if (!Has(world, child) || known[child]) continue;
      world[child] = world[parent] * GltfLocalMatrix(model.nodes[child]);
      open.push_back(child);
    }
  }
  return world;
}

// JOINTS_n and WEIGHTS_n: four more joints per vertex.
struct Influences {
  GltfAccessor joints, weights;
};

Result<GltfAccessor> OpenFour(const tinygltf::Model& model, const tinygltf::Primitive& p,
                              const std::string& key, std::size_t vertices,
                              const std::string& what) {
  const auto found = p.attributes.find(key);
  if (found == p.attributes.end()) return DataLoss("{}: no {} beside its counterpart", what, key);
  const std::string place = what + ": " + key;
  TILEGRAD_ASSIGN(GltfAccessor out, GltfAccessor::OpenAttribute(model, found->second, 4, place));
  if (out.count() != vertices)
    return DataLoss("{} has {} elements for {} vertices", place, out.count(), vertices);
  return out;
}

Result<std::vector<Influences>> ReadInfluences(const tinygltf::Model& model,
                                               const tinygltf::Primitive& p, std::size_t vertices,
                                               const std::string& what) {
  std::vector<Influences> out;
  for (int set = 0;; ++set) {
    const std::string joints = fmt::format("JOINTS_{}", set);
    const std::string weights = fmt::format("WEIGHTS_{}", set);
    if (p.attributes.count(joints) + p.attributes.count(weights) == 0) return out;
    TILEGRAD_ASSIGN(GltfAccessor j, OpenFour(model, p, joints, vertices, what));
    TILEGRAD_ASSIGN(GltfAccessor w, OpenFour(model, p, weights, vertices, what));
    out.push_back({std::move(j), std::move(w)});
  }
}

// The weighted mean of the matrices of a vertex's joints.
Result<glm::dmat4> MatrixOf(const std::vector<Influences>& influences, std::size_t vertex,
                            std::span<const glm::dmat4> joints, const std::string& what) {
  glm::dmat4 sum(0);
  double total = 0;
  const auto joint = [&](const Influences& from, int k) {
    return static_cast<double>(from.joints.Float(vertex, k));
  };
  const auto add = [&](double index, double weight) -> Status {
    if (!(index >= 0 && index < static_cast<double>(joints.size()))) {
      return DataLoss("{}: vertex {} uses joint {}, but its skin has {}", what, vertex, index,
                      joints.size());
    }
    sum += weight * joints[static_cast<std::size_t>(index)];
    total += weight;
    return {};
  };
  for (const Influences& from : influences) {
    for (int k = 0; k < 4; ++k) {
      const auto weight = static_cast<double>(from.weights.Float(vertex, k));
      if (weight != 0) TILEGRAD_TRY(add(joint(from, k), weight));
    }
  }
  if (total == 0) {
    sum = glm::dmat4(0);
    TILEGRAD_TRY(add(joint(influences[0], 0), 1));
  }
  return sum / total;
}

// Like Transform of scene/shapes.h, but without flipping faces: a mirror applies to the whole mesh.
void TurnNormal(const glm::dmat3& m, glm::vec3* n) {
  const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  const glm::dvec3 turned = cofactor * glm::dvec3(*n);
  const double length = glm::length(turned);
  if (length > 0) *n = glm::vec3(turned / length);
}

// For each joint of a skin: from the bind pose to the current pose. `world`: of all nodes. DataLoss
// names `what` and what does not exist.
Result<std::vector<glm::dmat4>> GltfJointMatrices(const tinygltf::Model& model, int skin,
                                                  std::span<const glm::dmat4> world,
                                                  const std::string& what) {
  if (!Has(model.skins, skin)) return DataLoss("{}: skin {} does not exist", what, skin);
  const tinygltf::Skin& from = model.skins[skin];
  std::vector<glm::dmat4> out;
  for (const int joint : from.joints) {
    if (!Has(world, joint))
      return DataLoss("{}: skin {}: node {}, a joint, does not exist", what, skin, joint);
    out.push_back(world[joint]);
  }
  if (from.inverseBindMatrices < 0) return out;
  const std::string place = fmt::format("{}: skin {}: inverse bind matrices", what, skin);
  TILEGRAD_ASSIGN(const GltfAccessor inverse,
                  GltfAccessor::OpenAttribute(model, from.inverseBindMatrices, 16, place));
  if (inverse.count() < out.size())
    return DataLoss("{}: {} for {} joints", place, inverse.count(), out.size());
  for (std::size_t j = 0; j < out.size(); ++j) {
    glm::dmat4 bind;
    for (int k = 0; k < 16; ++k) bind[k / 4][k % 4] = static_cast<double>(inverse.Float(j, k));
    out[j] *= bind;
  }
  return out;
}

// Whether the primitive has joints.
bool IsSkinned(const tinygltf::Primitive& p) { return p.attributes.count("JOINTS_0") > 0; }

// Moves the vertices of the primitive's mesh with their joints. Weights need not sum to 1; a vertex
// without any follows its first joint. `exact` gets positions before rounding.
Status ApplyGltfSkin(const tinygltf::Model& model, const tinygltf::Primitive& p,
                     std::span<const glm::dmat4> joints, const std::string& what, Mesh* mesh,
                     std::vector<glm::dvec3>* exact) {
  TILEGRAD_ASSIGN(const auto influences, ReadInfluences(model, p, mesh->positions.size(), what));
  for (std::size_t v = 0; v < mesh->positions.size(); ++v) {
    TILEGRAD_ASSIGN(const glm::dmat4 m, MatrixOf(influences, v, joints, what));
    exact->emplace_back(m * glm::dvec4(mesh->positions[v], 1));
    mesh->positions[v] = glm::vec3(exact->back());
    if (!mesh->normals.empty()) TurnNormal(glm::dmat3(m), &mesh->normals[v]);
  }
  return {};
}

constexpr int kMaxNodeDepth = 256;  // the walk is recursive
constexpr std::size_t kMostTypeShown = 80;

// Placement of the primitives of a node's mesh.
using SharedVertices = std::map<std::string, std::int32_t>;  // first vertex by VertexKey

struct PrimitivePlace {
  glm::dmat4 matrix;
  std::span<const double> weights;  // of morph targets
  std::vector<glm::dmat4> joints;   // of its skin: replace `matrix`
  SharedVertices shared = {};       // of this mesh's primitives so far
};

TextureWrap WrapOf(int number) {
  return number == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? TextureWrap::kClamp
         : number == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? TextureWrap::kMirror
                                                           : TextureWrap::kRepeat;
}

// Primitives with the same key have the same vertices, whatever their uvs.
std::string VertexKey(const tinygltf::Primitive& p) {
  std::string key;
  const auto add = [&](const std::map<std::string, int>& attributes) {
    for (const auto& [name, accessor] : attributes) {
      if (!name.starts_with("TEXCOORD_")) key += fmt::format("{} {} ", name, accessor);
    }
    key += ';';
  };
  add(p.attributes);
  for (const auto& target : p.targets) add(target);
  return key;
}

struct GltfWalk {
  const tinygltf::Model& model;
  const FileSource& source;
  std::string name, place;
  LoadedMesh out;
  std::vector<std::optional<int>> textures;  // by glTF image
  std::vector<bool> visited;                 // by node
  std::vector<glm::dmat4> world;             // by node, if there are skins
  std::set<std::string> warned = {};

  Status AddMesh(const tinygltf::Node& node, const glm::dmat4& m, const std::string& what) {
    const tinygltf::Mesh& mesh = model.meshes[node.mesh];
    PrimitivePlace at{m, node.weights.empty() ? mesh.weights : node.weights, {}};
    if (node.skin >= 0) {
      TILEGRAD_ASSIGN(at.joints, GltfJointMatrices(model, node.skin, world, what));
    }
    for (std::size_t i = 0; i < mesh.primitives.size(); ++i)
      TILEGRAD_TRY(AddPrimitive(mesh.primitives[i], at, fmt::format("{} primitive {}", what, i)));
    return {};
  }

  Status AddPrimitive(const tinygltf::Primitive& p, PrimitivePlace& at, const std::string& what) {
    const bool triangles =
        p.mode == -1 || (p.mode >= TINYGLTF_MODE_TRIANGLES && p.mode <= TINYGLTF_MODE_TRIANGLE_FAN);
    if (!triangles) {
      out.Warn("{}: points or lines left out", what);
      return {};
    }
    TILEGRAD_ASSIGN(Mesh mesh, ConvertGltfPrimitive(model, p, at.weights, what));
    if (mesh.faces.empty()) return {};
    FinishColors(ColorNumbers::kLinear, &mesh.colors, &out.warnings);
    if (p.attributes.count("COLOR_1") > 0) Warn("sets of vertex colours but COLOR_0 are left out");
    const Material material = ConvertMaterial(p.material);
    if (material.base_color_texture >= 0 && mesh.corner_uvs.empty()) {
      Warn("material \"{}\": its texture is not drawn where a mesh has no {}", material.name,
           GltfBaseColorOf(model, p.material).uv.Key());
    }
    return AppendPrimitive(std::move(mesh), p, material, at, what).Within(what);
  }

  Status AppendPrimitive(Mesh mesh, const tinygltf::Primitive& p, const Material& material,
                         PrimitivePlace& at, const std::string& what) {
    std::vector<glm::dvec3> exact;
    const glm::dmat4& m = at.matrix;
    if (!at.joints.empty() && IsSkinned(p)) {
      TILEGRAD_TRY(ApplyGltfSkin(model, p, at.joints, what, &mesh, &exact));
    } else {
      for (const glm::vec3& v : mesh.positions) exact.emplace_back(m * glm::dvec4(v, 1));
      if (m != glm::dmat4(1))
        Transform(mesh, {glm::vec3(m[0]), glm::vec3(m[1]), glm::vec3(m[2])}, glm::vec3(m[3]));
    }
    const auto next = static_cast<std::int32_t>(out.mesh.positions.size());
    const auto [first, added] = at.shared.try_emplace(VertexKey(p), next);
    if (!added) return AppendFacesWithMaterial(mesh, first->second, material, out);
    return AppendWithMaterial(std::move(mesh), material, out, exact);
  }

  // Each warning once.
  template <class... Args>
  void Warn(fmt::format_string<Args...> format, Args&&... args) {
    std::string warning = fmt::format(format, std::forward<Args>(args)...);
    if (warned.insert(warning).second) out.warnings.push_back(std::move(warning));
  }

  void WarnOfOtherScenes() {
    for (std::size_t i = 0; i < visited.size(); ++i) {
      if (!visited[i] && model.nodes[i].mesh >= 0)
        return Warn("meshes that are not in the scene are left out");
    }
  }

  Material ConvertMaterial(int index) {
    Material material;
    material.base_color = glm::vec4(1);  // glTF's default
    if (!Has(model.materials, index)) {
      if (index >= 0) Warn("material {} does not exist: white instead", index);
      return material;
    }
    const tinygltf::Material& from = model.materials[index];
    material.name = from.name;
    const GltfBaseColor color = GltfBaseColorOf(model, index);
    material.base_color = glm::vec4(color.factor);  // linear, until FinishMaterials
    material.alpha_mode = from.alphaMode == "MASK"    ? AlphaMode::kMask
                          : from.alphaMode == "BLEND" ? AlphaMode::kBlend
                                                      : AlphaMode::kOpaque;
    if (material.alpha_mode == AlphaMode::kOpaque) material.base_color.a = 1;
    if (material.alpha_mode == AlphaMode::kMask)
      material.alpha_cutoff = static_cast<float>(std::clamp(from.alphaCutoff, 0.0, 2.0));
    material.double_sided = from.doubleSided;
    material.unlit = from.extensions.count("KHR_materials_unlit") > 0;
    material.base_color_texture = ImageTexture(color.texture);
    SetSampler(color.texture, &material);
    const auto& emission = from.emissiveFactor;
    if (std::any_of(emission.begin(), emission.end(), [](double c) { return c > 0; }))
      Warn("material \"{}\": its emission is not drawn", material.name);
    return material;
  }

  void AddCamera(const tinygltf::Node& node, const glm::dmat4& m) {
    if (!Has(model.cameras, node.camera)) return;
    const tinygltf::Camera& from = model.cameras[node.camera];
    const std::string label = from.name.empty() ? node.name : from.name;
    if (from.type != "perspective") {
      out.Warn("camera \"{}\" is orthographic: left out", label);
      return;
    }
    MeshFileCamera camera;
    camera.name = label;
    for (int i = 0; i < 16; ++i) camera.camera.node_to_world[i] = m[i % 4][i / 4];
    camera.camera.yfov = from.perspective.yfov;
    camera.camera.aspect_ratio = from.perspective.aspectRatio;
    camera.camera.znear = from.perspective.znear;
    out.cameras.push_back(std::move(camera));
  }

  void SetSampler(int texture, Material* material) {
    if (!Has(model.textures, texture)) return;
    const int index = model.textures[texture].sampler;
    if (!Has(model.samplers, index)) return;
    const tinygltf::Sampler& sampler = model.samplers[index];
    material->wrap = {WrapOf(sampler.wrapS), WrapOf(sampler.wrapT)};
    material->nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
  }

  int ImageTexture(int texture) {
    if (texture < 0) return -1;
    const bool there = Has(model.textures, texture);
    const std::string other = there ? GltfImageExtension(model.textures[texture]) : "";
    const int image = there ? model.textures[texture].source : -1;
    const bool has_image = Has(model.images, image);
    if (!other.empty() || !has_image) {
      Warn("texture {} {}; the material's colour stands in", texture,
           !other.empty() ? "has its image in " + other + " only, which is not read"
           : there        ? "has no image"
                          : "does not exist");
    }
    if (!has_image) return -1;
    if (!textures[image]) textures[image] = AddImage(model.images[image], image);
    return *textures[image];
  }

  int AddImage(const tinygltf::Image& image, int index) {
    std::string label = image.name.empty() ? fmt::format("image {}", index) : image.name;
    if (image.bufferView >= 0) {
      const auto bytes = GltfViewBytes(model, image.bufferView, label);
      return AddTexture(bytes.ok() ? DecodeImage(*bytes, label) : bytes.status(), label, out);
    }
    if (!image.image.empty()) return AddTexture(DecodeImage(image.image, label), label, out);
    if (image.uri.starts_with("data:")) {  // tinygltf took it for a file name
      const std::string type = image.uri.substr(0, std::min(image.uri.find(','), kMostTypeShown));
      return AddTexture(DataLoss("{}: \"{}\" is not read; save it as PNG or JPEG", label, type),
                        label, out);
    }
    return AddTextureFile(source, FindByUri(source, name, image.uri), DecodePercent(image.uri),
                          out);
  }

  Status Visit(int index, const glm::dmat4& parent, int depth) {
    if (depth > kMaxNodeDepth)
      return DataLoss("{}: nodes are nested more than {} deep", place, kMaxNodeDepth);
    if (!Has(model.nodes, index)) return DataLoss("{}: node {} does not exist", place, index);
    // Nodes form trees: a second visit is a cycle, or shared children, whose number of paths may
    // grow without bound.
    if (visited[index])
      return DataLoss("{}: node {} is reached twice; nodes must form a tree", place, index);
    visited[index] = true;
    const tinygltf::Node& node = model.nodes[index];
    const glm::dmat4 m = parent * GltfLocalMatrix(node);
    AddCamera(node, m);
    if (node.mesh >= 0) {
      if (!Has(model.meshes, node.mesh))
        return DataLoss("{}: node {} names mesh {}, which does not exist", place, index, node.mesh);
      TILEGRAD_TRY(AddMesh(node, m, fmt::format("{}: mesh {}", place, node.mesh)));
    }
    for (const int child : node.children) TILEGRAD_TRY(Visit(child, m, depth + 1));
    return {};
  }
};

// The nodes of the default scene, or of the first one, or all root nodes.
std::vector<int> SceneNodes(const tinygltf::Model& model) {
  if (model.scenes.empty()) return GltfRootNodes(model);
  return model.scenes[Has(model.scenes, model.defaultScene) ? model.defaultScene : 0].nodes;
}

}  // namespace

Result<LoadedMesh> ReadGltf(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(GltfDocument document, ReadGltfDocument(source, name));
  const tinygltf::Model& model = document.model;
  GltfWalk walk{model,
                source,
                name,
                source.Describe(name),
                {},
                std::vector<std::optional<int>>(model.images.size()),
                std::vector<bool>(model.nodes.size()),
                model.skins.empty() ? std::vector<glm::dmat4>() : GltfWorldMatrices(model)};
  walk.out.warnings = std::move(document.warnings);
  for (const int root : SceneNodes(model)) TILEGRAD_TRY(walk.Visit(root, glm::dmat4(1), 0));
  walk.WarnOfOtherScenes();
  return std::move(walk.out);
}

}  // namespace tilegrad::io
