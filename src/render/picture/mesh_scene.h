// SPDX-License-Identifier: Apache-2.0
// A Mesh, as files give it, made ready for the Renderer: materials become surfaces, images
// textures.
#pragma once

#include <vector>

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

 private:
  int AddTexture(const Material& material);
  void AddSurfaces();
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
};

}  // namespace tilegrad
