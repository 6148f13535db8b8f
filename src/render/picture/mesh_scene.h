// SPDX-License-Identifier: Apache-2.0
// A Mesh, as files give it, made ready for the Renderer: materials become surfaces, images
// textures.
#pragma once

#include <optional>
#include <vector>

#include "render/picture/layers.h"
#include "scene/mesh.h"
#include "tilegrad/scene.h"

namespace tilegrad {

// In which numbers light is added and multiplied.
enum class ColorSpace {
  kLinear,  // as viewers do: colours are decoded first, and pictures encoded in the end
  kSrgb     // in the numbers of the files, as training does
};

enum class NormalSource {
  kAuto,    // the mesh's own; flat where it has none, as glTF prescribes
  kSmooth,  // from positions
  kFlat,
  kAligned  // as kAuto, turned to the side of the faces' winding: authors' point to either
};

struct MeshSceneOptions {
  ColorSpace color_space = ColorSpace::kLinear;
  NormalSource normals = NormalSource::kAuto;
  Filter filter = Filter::kTrilinear;  // of textures that do not ask for nearest
  // Of all surfaces; those that are unlit have ambient 1 and nothing else.
  std::array<float, 3> ambient = {0, 0, 0}, diffuse = {1, 1, 1}, specular = {0, 0, 0};
  float shininess = 10;
  bool blend = true;  // surfaces that ask for it let light through, in cover(); else opaque
};

// Keeps a reference to the mesh, which is valid.
class MeshScene {
 public:
  MeshScene(const Mesh& mesh, const MeshSceneOptions& options);
  MeshScene(const MeshScene&) = delete;
  MeshScene& operator=(const MeshScene&) = delete;

  // Everything but the camera and the light; views into this and the mesh.
  const Scene& scene() const { return scene_; }
  // Whether every material asks that back faces are not drawn.
  bool single_sided() const { return single_sided_; }
  // Of materials with holes or transparency; null: all are opaque. Views as above, no camera.
  const SceneCover* cover() const { return cover_ ? &*cover_ : nullptr; }

 private:
  int AddTexture(const Material& material);
  void AddSurfaces();
  void AddCover();
  void AddAlphaTextures();
  void AddNormals();
  void AddAlignedNormals();

  const Mesh& mesh_;
  MeshSceneOptions options_;
  Scene scene_;
  bool single_sided_ = false;
  std::vector<glm::vec3> aligned_normals_;  // of corners
  std::vector<float> colors_;               // [V,3]
  std::vector<std::vector<float>> texels_;  // by the mesh's texture; empty: not used
  std::vector<Texture> textures_;           // by use: texture, wrap, filter
  std::vector<Surface> surfaces_;           // by the mesh's material
  // Of the cover: alpha three times over.
  std::optional<SceneCover> cover_;
  std::vector<float> vertex_alpha_;                // [V,3]
  std::vector<std::vector<float>> texture_alpha_;  // by the mesh's texture
  std::vector<Texture> alpha_textures_;            // as textures_
  std::vector<Surface> alpha_surfaces_;
};

}  // namespace tilegrad
