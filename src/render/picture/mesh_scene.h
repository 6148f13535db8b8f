// SPDX-License-Identifier: Apache-2.0
// A Mesh, as files give it, made ready for the Renderer: materials become surfaces, images
// textures.
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

// Scenes whose surfaces have holes or let light through, drawn layer by layer from the front (depth
// peeling): every pixel sees its own layers in the right order, however faces lie in the file or
// cut each other. Not differentiable.

// How much of what is behind a surface it hides.
struct SurfaceCover {
  enum class Kind {
    kOpaque,  // everything
    kMask,    // everything where its alpha is at least `cutoff`; elsewhere it is not there
    kBlend    // the share that its alpha is
  };
  Kind kind = Kind::kOpaque;
  float cutoff = 0.5f;

  float Of(float alpha) const;  // 0..1
};

struct SceneCover {
  Scene alpha;                         // the same faces, unlit, coloured by their alpha
  std::vector<SurfaceCover> surfaces;  // of the scene, as face_surfaces has them
};

// What is seen, in the order of layers: of each pixel that shows a face in this layer, its index,
// and the share of what is behind that it hides. Returns whether the pixel needs no layer more.
using TakeLayer = std::function<bool(const Images& layer, std::size_t pixel, float cover)>;

class LayerRenderer {
 public:
  explicit LayerRenderer(const Workers& workers) : engine_(workers) {}

  // Draws image after image of `scene`, until every pixel is done. Behind kMostLayers faces nothing
  // is drawn.
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

// Pictures of a mesh: under the fixed light of datasets, and unlit for people who look at
// predictions. Not differentiable.

// Pictures of a mesh with its materials under a light that is fixed in the world, so that a point
// has one colour in all views: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5)
// and a fill light of 0.2 from (-0.6, 0.3, -0.75), in the numbers of the files, cut at 1. Surfaces
// are two-sided, cut out where they ask for an alpha mask, else opaque, and normals of files are
// turned to the side of the winding, since real models are soups of shells. 4 x 4 samples a pixel.
//
// Owns a renderer and its scratch memory; one call at a time, on the calling thread.
class LitRenderer {
 public:
  LitRenderer();
  ~LitRenderer();
  LitRenderer(LitRenderer&&) noexcept;

  // `cameras` are those of square images of `size` pixels, 1 to 4096. Returns
  // [cameras][4][size][size], planar RGBA, RGB composited over black; alpha is the covered share.
  // Errors: an invalid mesh or one without faces, and those of Renderer::Render.
  Result<std::vector<std::uint8_t>> Render(const Mesh& mesh, std::span<const Camera> cameras,
                                           int size);
  // One such picture as an RGBA image, straight alpha.
  Result<ImageU8> RenderStraight(const Mesh& mesh, const Camera& camera, int size);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Predicted colours hold the light of the training images: unlit, over kPaper, 3 x 3 samples a
// pixel. One RGB picture of size x size for each camera, whose lenses are for `camera_size` pixels
// a side.
struct UnlitPictures {
  std::span<const Camera> cameras;
  int camera_size = 64;
  int size = 256;
};
Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const UnlitPictures& request,
                                      const Workers& workers);

// The unlit colour of each corner, [3F]: factor x texture x vertex colour. `mesh` is valid.
std::vector<glm::vec3> CornerColors(const Mesh& mesh);

// The light of datasets: Lambert with ambient 0.45, a key light of 0.45 from (0.35, 0.8, 0.5) and a
// fill light of 0.2 from (-0.6, 0.3, -0.75), fixed in the world, in the numbers of the files.

inline constexpr float kDatasetAmbient = 0.45f;

std::array<Light, 2> DatasetLights();  // key, fill; directions are unit

// White, with that ambient light.
Surface DatasetSurface();

}  // namespace tilegrad
