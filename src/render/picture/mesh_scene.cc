// SPDX-License-Identifier: Apache-2.0
#include "render/picture/mesh_scene.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "shade/surface_color.h"

namespace tilegrad {
namespace {

template <class Vec>
std::span<const float> Flat(const std::vector<Vec>& values) {
  static_assert(sizeof(Vec) == Vec::length() * sizeof(float));
  return {reinterpret_cast<const float*>(values.data()), values.size() * Vec::length()};
}

float Decode(float value, ColorSpace space) {
  return space == ColorSpace::kLinear ? SrgbToLinear(value) : value;
}

std::vector<float> DecodeTexels(const ImageU8& image, ColorSpace space) {
  std::array<float, 256> table;
  for (std::size_t i = 0; i < table.size(); ++i)
    table[i] = Decode(static_cast<float>(i) / 255.0f, space);
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t count = image.pixels.size() / channels;
  std::vector<float> out(3 * count);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t c = 0; c < 3; ++c) out[3 * p + c] = table[image.pixels[channels * p + c]];
  }
  return out;
}

// Alpha as a colour.
std::vector<float> AlphaTexels(const ImageU8& image) {
  std::vector<float> out;
  out.reserve(image.pixels.size() / 4 * 3);
  for (std::size_t i = 3; i < image.pixels.size(); i += 4)
    out.insert(out.end(), 3, static_cast<float>(image.pixels[i]) / 255.0f);
  return out;
}

// In formats without alpha modes only materials have alpha; 0 is more often a mistake than
// invisible glass.
SurfaceCover CoverOf(const Material& material, bool blend) {
  const float alpha = material.base_color.a;
  if (material.alpha_mode == AlphaMode::kMask)
    return {SurfaceCover::Kind::kMask, material.alpha_cutoff};
  const bool glass = material.alpha_mode == AlphaMode::kBlend || (alpha > 0 && alpha < 1);
  return {blend && glass ? SurfaceCover::Kind::kBlend : SurfaceCover::Kind::kOpaque};
}

}  // namespace

MeshScene::MeshScene(const Mesh& mesh, const MeshSceneOptions& options)
    : mesh_(mesh), options_(options), texels_(mesh.textures.size()) {
  scene_.positions = Flat(mesh.positions);
  scene_.faces = {mesh.faces.data()->data(), 3 * mesh.faces.size()};
  scene_.shading.two_sided = true;
  AddNormals();
  const bool by_corner = !mesh.corner_colors.empty();
  for (const glm::vec4& color : by_corner ? mesh.corner_colors : mesh.colors) {
    for (int c = 0; c < 3; ++c) colors_.push_back(Decode(color[c], options.color_space));
  }
  scene_.colors = {colors_, by_corner ? Rate::kCorner : Rate::kVertex};
  AddSurfaces();
  if (!textures_.empty()) {
    scene_.uvs = {Flat(mesh.corner_uvs), Rate::kCorner};
    scene_.textures = textures_;
  }
  AddCover();
}

void MeshScene::AddNormals() {
  scene_.shading.normals =
      options_.normals == NormalSource::kSmooth ? Normals::kSmooth : Normals::kFlat;
  if (options_.normals == NormalSource::kAligned) return AddAlignedNormals();
  if (options_.normals != NormalSource::kAuto) return;
  if (!mesh_.corner_normals.empty()) {
    scene_.normals = {Flat(mesh_.corner_normals), Rate::kCorner};
  } else if (!mesh_.normals.empty()) {
    scene_.normals = {Flat(mesh_.normals), Rate::kVertex};
  } else {
    return;
  }
  scene_.shading.normals = Normals::kGiven;
}

void MeshScene::AddAlignedNormals() {
  if (mesh_.corner_normals.empty() && mesh_.normals.empty()) return;
  for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
    const auto vertex = [&](std::size_t k) { return static_cast<std::size_t>(mesh_.faces[f][k]); };
    const glm::vec3 a = mesh_.positions[vertex(0)];
    const glm::vec3 winding =
        glm::cross(mesh_.positions[vertex(1)] - a, mesh_.positions[vertex(2)] - a);
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3 n =
          mesh_.corner_normals.empty() ? mesh_.normals[vertex(k)] : mesh_.corner_normals[3 * f + k];
      aligned_normals_.push_back(glm::dot(n, winding) < 0 ? -n : n);
    }
  }
  scene_.normals = {Flat(aligned_normals_), Rate::kCorner};
  scene_.shading.normals = Normals::kGiven;
}

// Index of the view of a material's texture, one per sampler.
int MeshScene::AddTexture(const Material& material) {
  if (material.base_color_texture < 0 || mesh_.corner_uvs.empty()) return -1;
  const auto index = static_cast<std::size_t>(material.base_color_texture);
  const ImageU8& image = mesh_.textures[index].image;
  if (texels_[index].empty()) texels_[index] = DecodeTexels(image, options_.color_space);
  const Texture view = {texels_[index], image.width, image.height, shade::WrapOf(material),
                        material.nearest ? Filter::kNearest : options_.filter};
  const auto same = [&](const Texture& v) {
    return v.texels.data() == view.texels.data() && v.wrap == view.wrap && v.filter == view.filter;
  };
  const auto found = std::find_if(textures_.begin(), textures_.end(), same);
  if (found != textures_.end()) return static_cast<int>(found - textures_.begin());
  textures_.push_back(view);
  return static_cast<int>(textures_.size()) - 1;
}

void MeshScene::AddSurfaces() {
  for (const Material& material : mesh_.materials) {
    Surface surface;
    for (int c = 0; c < 3; ++c) {
      surface.base_color[static_cast<std::size_t>(c)] =
          Decode(material.base_color[c], options_.color_space);
    }
    surface.texture = AddTexture(material);
    surface.ambient = options_.ambient;
    surface.diffuse = options_.diffuse;
    surface.specular = options_.specular;
    surface.shininess = options_.shininess;
    if (material.unlit) {
      surface.ambient = {1, 1, 1};
      surface.diffuse = surface.specular = {0, 0, 0};
    }
    surfaces_.push_back(surface);
  }
  if (surfaces_.empty()) {  // a mesh without materials: white times its vertex colours
    surfaces_.push_back(
        {{1, 1, 1}, -1, options_.ambient, options_.diffuse, options_.specular, options_.shininess});
  }
  single_sided_ =
      !mesh_.materials.empty() && std::none_of(mesh_.materials.begin(), mesh_.materials.end(),
                                               [](const Material& m) { return m.double_sided; });
  scene_.surfaces = surfaces_;
  scene_.face_surfaces = mesh_.face_materials;
}

void MeshScene::AddAlphaTextures() {
  alpha_textures_ = textures_;
  texture_alpha_.resize(texels_.size());
  for (Texture& view : alpha_textures_) {
    const auto holds = [&](const auto& texels) { return texels.data() == view.texels.data(); };
    const auto image = static_cast<std::size_t>(
        std::find_if(texels_.begin(), texels_.end(), holds) - texels_.begin());
    if (mesh_.textures[image].image.channels < 4) continue;  // no surface refers to it
    if (texture_alpha_[image].empty())
      texture_alpha_[image] = AlphaTexels(mesh_.textures[image].image);
    view.texels = texture_alpha_[image];
  }
}

void MeshScene::AddCover() {
  std::vector<SurfaceCover> covers;
  for (const Material& material : mesh_.materials)
    covers.push_back(CoverOf(material, options_.blend));
  const auto opaque = [](const SurfaceCover& c) { return c.kind == SurfaceCover::Kind::kOpaque; };
  if (std::all_of(covers.begin(), covers.end(), opaque)) return;
  AddAlphaTextures();
  alpha_surfaces_ = surfaces_;
  for (std::size_t m = 0; m < mesh_.materials.size(); ++m) {
    const Material& material = mesh_.materials[m];
    Surface& surface = alpha_surfaces_[m];
    surface.base_color.fill(material.base_color.a);
    const bool textured =
        surface.texture >= 0 && material.alpha_mode != AlphaMode::kOpaque &&
        mesh_.textures[static_cast<std::size_t>(material.base_color_texture)].image.channels == 4;
    if (!textured) surface.texture = -1;
  }
  for (const glm::vec4& color : mesh_.colors) vertex_alpha_.insert(vertex_alpha_.end(), 3, color.a);
  SceneCover& cover = cover_.emplace(SceneCover{scene_, std::move(covers)});
  cover.alpha.shading = {};
  cover.alpha.normals = {};
  cover.alpha.colors = {vertex_alpha_, Rate::kVertex};
  cover.alpha.surfaces = alpha_surfaces_;
  if (!textures_.empty()) cover.alpha.textures = alpha_textures_;
}

std::vector<glm::vec3> CornerColors(const Mesh& mesh) {
  const shade::SurfaceColor surface(mesh);
  std::vector<glm::vec3> out;
  out.reserve(3 * mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) out.push_back(surface.AtCorner(f, k));
  }
  return out;
}

}  // namespace tilegrad
