// SPDX-License-Identifier: Apache-2.0
// Prepares a Mesh from a file for the Renderer: materials become surfaces, images textures.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "render/picture/layers.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/scene.h"

namespace tilegrad {

// The encoding in which light is added and multiplied.
enum class ColorSpace {
  kLinear,  // linear, as in viewers: decodes colours first, and encodes pictures at the end
  kSrgb     // the files' sRGB values, as in training
};

enum class NormalSource {
  kAuto,    // the mesh's normals; flat if it has none, as glTF prescribes
  kSmooth,  // from positions
  kFlat,
  kAligned  // like kAuto, but flipped to the side of the faces' winding: authored normals may point
            // to either
};

struct MeshSceneOptions {
  ColorSpace color_space = ColorSpace::kLinear;
  NormalSource normals = NormalSource::kAuto;
  Filter filter = Filter::kTrilinear;  // for textures that do not ask for nearest
  // For all surfaces; unlit ones have ambient 1 and nothing else.
  std::array<float, 3> ambient = {0, 0, 0}, diffuse = {1, 1, 1}, specular = {0, 0, 0};
  float shininess = 10;
  bool blend = true;  // cover() makes surfaces transparent that ask for it; else they are opaque
};

// Keeps a reference to the mesh, which must be valid.
class MeshScene {
 public:
  MeshScene(const Mesh& mesh, const MeshSceneOptions& options);
  MeshScene(const MeshScene&) = delete;
  MeshScene& operator=(const MeshScene&) = delete;

  // Everything except camera and light; views into this and the mesh.
  const Scene& scene() const { return scene_; }
  // Whether every material asks for back-face culling.
  bool single_sided() const { return single_sided_; }
  // For materials with cut-outs or transparency; null if all are opaque. Views as above, no camera.
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
  std::vector<glm::vec3> aligned_normals_;  // per corner
  std::vector<float> colors_;               // [V,3]
  std::vector<std::vector<float>> texels_;  // by mesh texture; empty if unused
  std::vector<Texture> textures_;           // one per use: texture, wrap, filter
  std::vector<Surface> surfaces_;           // by mesh material
  // Of the cover: alpha replicated to three channels.
  std::optional<SceneCover> cover_;
  std::vector<float> vertex_alpha_;                // [V,3]
  std::vector<std::vector<float>> texture_alpha_;  // by mesh texture
  std::vector<Texture> alpha_textures_;            // parallel to textures_
  std::vector<Surface> alpha_surfaces_;
};

// The unlit colour of each corner, [3F]: factor x texture x vertex colour. `mesh` must be valid.
std::vector<glm::vec3> CornerColors(const Mesh& mesh);

}  // namespace tilegrad
