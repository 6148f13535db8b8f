// SPDX-License-Identifier: Apache-2.0
// Between meshes of files and scenes that are fitted.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/error.h"
#include "fit/scene.h"
#include "scene/shapes.h"

namespace tilegrad::train {
namespace {

// `uvs` of the corners of a mesh with these faces. Corners of one vertex with the same coordinates
// share them.
void SetUvs(const std::vector<Face>& faces, const std::vector<glm::vec2>& uvs, FitScene* scene) {
  scene->uvs.clear();
  scene->uv_indices.clear();
  std::map<std::pair<std::int32_t, std::pair<float, float>>, std::int32_t> known;
  for (std::size_t i = 0; i < uvs.size(); ++i) {
    const glm::vec2 uv = uvs[i];
    const std::int32_t vertex = faces[i / 3][i % 3];
    const auto [at, added] =
        known.try_emplace({vertex, {uv.x, uv.y}}, static_cast<std::int32_t>(scene->uvs.size() / 2));
    if (added) scene->uvs.insert(scene->uvs.end(), {uv.x, uv.y});
    scene->uv_indices.push_back(at->second);
  }
}

glm::vec3 BaseColorFactor(const Mesh& mesh) {
  return mesh.materials.empty() ? glm::vec3(1) : glm::vec3(mesh.materials[0].base_color);
}

void SetTexture(const Mesh& mesh, FitScene* scene) {
  const ImageU8& image =
      mesh.textures[static_cast<std::size_t>(mesh.materials[0].base_color_texture)].image;
  const glm::vec3 factor = BaseColorFactor(mesh);
  scene->texture = Image(image.width, image.height, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        scene->texture.at(x, y)[c] = static_cast<float>(image.at(x, y)[c]) / 255 * factor[c];
      }
    }
  }
}

// Of vertices: the mean of its corners' where colours are theirs. Empty if there are none.
std::vector<glm::vec4> VertexColors(const Mesh& mesh) {
  if (mesh.corner_colors.empty()) return mesh.colors;
  std::vector<glm::vec4> colors(mesh.positions.size(), glm::vec4(0));
  std::vector<float> counts(mesh.positions.size(), 0);
  for (std::size_t c = 0; c < mesh.corner_colors.size(); ++c) {
    const std::int32_t v = mesh.faces[c / 3][c % 3];
    colors[v] += mesh.corner_colors[c];
    counts[v] += 1;
  }
  for (std::size_t v = 0; v < colors.size(); ++v)
    colors[v] = counts[v] > 0 ? colors[v] / counts[v] : glm::vec4(1);
  return colors;
}

void SetColors(const Mesh& mesh, bool textured, FitScene* scene) {
  const glm::vec3 factor = textured ? glm::vec3(1) : BaseColorFactor(mesh);
  const std::vector<glm::vec4> colors = VertexColors(mesh);
  if (colors.empty() && textured) return;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const glm::vec3 own = colors.empty() ? glm::vec3(1) : glm::vec3(colors[v]);
    for (int c = 0; c < 3; ++c) scene->colors.push_back(own[c] * factor[c]);
  }
}

ImageU8 ToBytes(const Image& image) {
  ImageU8 out(image.width, image.height, image.channels);
  std::transform(image.pixels.begin(), image.pixels.end(), out.pixels.begin(), [](float v) {
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp(v, 0.0f, 1.0f)));
  });
  return out;
}

Image WithAlpha(const Image& rgb, const std::vector<float>& alpha) {
  Image out(rgb.width, rgb.height, 4);
  for (std::size_t t = 0; t < alpha.size(); ++t) {
    std::copy_n(&rgb.pixels[3 * t], 3, &out.pixels[4 * t]);
    out.pixels[4 * t + 3] = alpha[t];
  }
  return out;
}

constexpr const char* kFitted = "fitted";

void AddTexture(const FitScene& scene, Mesh* mesh) {
  for (const std::int32_t u : scene.uv_indices) {
    const auto at = 2 * static_cast<std::size_t>(u);
    mesh->corner_uvs.emplace_back(scene.uvs[at], scene.uvs[at + 1]);
  }
  mesh->materials = {{.name = kFitted, .base_color = glm::vec4(1), .base_color_texture = 0}};
  if (scene.cutout.empty()) {
    mesh->textures.push_back({kFitted, ToBytes(scene.texture)});
    return;
  }
  mesh->textures.push_back({kFitted, ToBytes(WithAlpha(scene.texture, scene.cutout))});
  mesh->materials[0].alpha_mode = AlphaMode::kMask;
  mesh->materials[0].alpha_cutoff = kCutoff;
}

}  // namespace

Result<FitScene> SceneOfMesh(const Mesh& mesh) {
  TILEGRAD_TRY(Validate(mesh));
  if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
  if (mesh.materials.size() > 1) {
    return InvalidArgument("the mesh has {} materials, a fit takes one: merge them first",
                           mesh.materials.size());
  }
  FitScene scene;
  for (const glm::vec3& p : mesh.positions) {
    scene.positions.insert(scene.positions.end(), {p.x, p.y, p.z});
  }
  for (const Face& f : mesh.faces) scene.faces.insert(scene.faces.end(), f.begin(), f.end());
  if (!mesh.corner_uvs.empty()) SetUvs(mesh.faces, mesh.corner_uvs, &scene);
  const bool textured = !mesh.corner_uvs.empty() && !mesh.materials.empty() &&
                        mesh.materials[0].base_color_texture >= 0;
  if (textured) SetTexture(mesh, &scene);
  SetColors(mesh, textured, &scene);
  return scene;
}

void SetSphereUv(const Mesh& sphere, FitScene* scene) {
  SetUvs(sphere.faces, SphereUvs(sphere), scene);
}

Mesh MeshOfScene(const FitScene& scene) {
  Mesh mesh;
  for (std::size_t i = 0; i < scene.positions.size(); i += 3) {
    mesh.positions.emplace_back(scene.positions[i], scene.positions[i + 1], scene.positions[i + 2]);
  }
  for (std::size_t i = 0; i < scene.faces.size(); i += 3) {
    mesh.faces.push_back({scene.faces[i], scene.faces[i + 1], scene.faces[i + 2]});
  }
  for (std::size_t i = 0; i < scene.colors.size(); i += 3) {
    mesh.colors.emplace_back(scene.colors[i], scene.colors[i + 1], scene.colors[i + 2], 1.0f);
  }
  mesh.normals = SmoothNormals(mesh);
  if (!scene.texture.empty()) AddTexture(scene, &mesh);
  // Under a fitted light, colours are those of the surface; else they hold the images' light.
  if (scene.shading.lighting == Lighting::kNone) SetUnlit(mesh, kFitted);
  return mesh;
}

}  // namespace tilegrad::train
