// SPDX-License-Identifier: Apache-2.0
// Prepares a Mesh from a file for the Renderer: materials become surfaces, images textures.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "render/engine.h"
#include "scene/camera.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/scene.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Depth peeling for scenes with cut-out or transparent surfaces: draws them layer by layer from the
// front, so that every pixel gets its layers in the right order, whatever the order of faces in the
// file and however they intersect. Not differentiable.

// How much a surface hides of what is behind it.
struct SurfaceCover {
  enum class Kind {
    kOpaque,  // everything
    kMask,    // everything where alpha >= `cutoff`; elsewhere the surface is absent
    kBlend    // a fraction equal to its alpha
  };
  Kind kind = Kind::kOpaque;
  float cutoff = 0.5f;

  float Of(float alpha) const;  // 0..1
};

struct SceneCover {
  Scene alpha;                         // the same faces, unlit, coloured by their alpha
  std::vector<SurfaceCover> surfaces;  // of the scene, indexed by face_surfaces
};

// Receives layers in order: called for each pixel that shows a face in this layer, with its index
// and the fraction that it hides of what is behind. Returns whether the pixel needs no more layers.
using TakeLayer = std::function<bool(const Images& layer, std::size_t pixel, float cover)>;

class LayerRenderer {
 public:
  explicit LayerRenderer(const Workers& workers) : engine_(workers) {}

  // Draws layer after layer of `scene` until every pixel is done, at most kMostLayers.
  Status Render(const Scene& scene, const SceneCover& cover, const RenderOptions& options,
                const Outputs& outputs, const TakeLayer& take);

  static constexpr int kMostLayers = 64;
  const PlanReport& plan() const { return plan_; }  // of the first layer

 private:
  Status DrawAlpha(const SceneCover& cover, const Camera& camera, const RenderOptions& options);
  Status RenderAll(const Scene& scene, const SceneCover& cover, const RenderOptions& options,
                   const Outputs& outputs, const TakeLayer& take);
  bool Visit(const Scene& scene, const SceneCover& cover, const TakeLayer& take);

  Engine engine_;
  FrameImages layer_, alpha_;
  PlanReport plan_;
};

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

// Pictures of a mesh: under the fixed light of datasets, and unlit for viewing predictions. Not
// differentiable.

// Pictures of a mesh with its materials under lights fixed in the world, so that a point has the
// same colour in all views: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5)
// and a fill light of 0.2 from (-0.6, 0.3, -0.75), on sRGB values, clamped at 1. Surfaces are
// two-sided, cut out by their alpha mask if they have one, else opaque; the file's normals are
// flipped to the side of the winding, since real models are soups of shells. 4 x 4 samples per
// pixel.
//
// Owns a renderer and its scratch memory; one call at a time, on the calling thread.
class LitRenderer {
 public:
  LitRenderer();
  ~LitRenderer();
  LitRenderer(LitRenderer&&) noexcept;

  // `cameras` are for square images of `size` pixels, 1 to 4096. Returns [cameras][4][size][size],
  // planar RGBA, RGB composited over black; alpha is coverage. Errors: an invalid mesh or one
  // without faces, and those of Renderer::Render.
  Result<std::vector<std::uint8_t>> Render(const Mesh& mesh, std::span<const Camera> cameras,
                                           int size);
  // One picture as an RGBA image, straight alpha.
  Result<ImageU8> RenderStraight(const Mesh& mesh, const Camera& camera, int size);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Predicted colours include the light of the training images, so these pictures are unlit, over
// kPaper, with 3 x 3 samples per pixel. One RGB picture of size x size per camera; the lenses are
// for `camera_size` pixels a side.
struct UnlitPictures {
  std::span<const Camera> cameras;
  int camera_size = 64;
  int size = 256;
};
Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const UnlitPictures& request,
                                      const Workers& workers);

// The unlit colour of each corner, [3F]: factor x texture x vertex colour. `mesh` must be valid.
std::vector<glm::vec3> CornerColors(const Mesh& mesh);

// The light of datasets: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5) and a
// fill light of 0.2 from (-0.6, 0.3, -0.75), fixed in the world, on sRGB values.

inline constexpr float kDatasetAmbient = 0.45f;

std::array<Light, 2> DatasetLights();  // key, fill; directions are unit

// White, with that ambient light.
Surface DatasetSurface();

}  // namespace tilegrad
