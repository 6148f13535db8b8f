// SPDX-License-Identifier: Apache-2.0
// The scene that fitting changes: everything that pictures of one object depend on, and its
// renderer.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/scene_fields.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "train/models/render_op.h"

namespace tilegrad::train {

// The mean of max(0, cos) over all directions is a quarter.
inline constexpr float kDirectionsPerMean = 4;
inline constexpr float kCutoff = 0.5f;  // glTF's default alphaCutoff

// V vertices, F faces, U texture coordinates. What is empty is not there.
struct FitScene {
  std::vector<float> positions;          // [V,3] world
  std::vector<std::int32_t> faces;       // [F,3]
  std::vector<float> colors;             // [V,3]
  std::vector<float> uvs;                // [U,2]
  std::vector<std::int32_t> uv_indices;  // [F,3]: corners that share one move together
  Image texture;                         // of 3 channels
  // [height,width] of a cut-out texture: the alpha of its texels, transparent below kCutoff; empty:
  // opaque. Not on the tape (cutout.h).
  std::vector<float> cutout;
  Filter filter = Filter::kBilinear;
  Wrap wrap = Wrap::kRepeat;
  Surface surface;                         // of the whole mesh; read under Lambert and Phong light
  std::array<float, 3> light = {0, 0, 1};  // its direction, towards it; of intensity 1
  std::array<float, 9> sh = {};
  ShadingModel shading;
  // The mean over all directions of the light, of each channel, stays 1: the first harmonic stays
  // what it is, and ambient + diffuse / kDirectionsPerMean is 1. Else colours and light could share
  // any factor.
  bool light_mean_fixed = false;
  std::vector<Camera> cameras;  // one for each view
  // Cameras turn about `pivot` and move in steps of `unit`: the object's middle and size.
  std::array<float, 3> pivot = {};
  float unit = 1;
  std::vector<float> gains;  // one for each view: its image has the scene's colours times this;
                             // empty: 1

  std::size_t vertices() const { return positions.size() / 3; }
  bool uses_lights() const { return UsesLights(shading); }
};

// What can be fitted.
enum class Parameter {
  kPositions,
  kColors,
  kTexture,
  kUv,
  kCamera,
  kLight,
  kSh,
  kMaterial,
  kExposure,
  kFocal
};
inline constexpr std::array kParameters = {
    Parameter::kPositions, Parameter::kColors, Parameter::kTexture, Parameter::kUv,
    Parameter::kCamera,    Parameter::kLight,  Parameter::kSh,      Parameter::kMaterial,
    Parameter::kExposure,  Parameter::kFocal};
const char* NameOf(Parameter parameter);  // "positions", ..., as on the command line

struct ParameterSet {
  std::array<bool, kParameters.size()> has = {};
  bool operator[](Parameter p) const { return has[static_cast<std::size_t>(p)]; }
  bool& operator[](Parameter p) { return has[static_cast<std::size_t>(p)]; }
  bool empty() const;
};

// Which of them no image depends on, and why, in a sentence without the name; "" for the others.
std::string WhyExcluded(const FitScene& scene, Parameter parameter);

// Renders views of a scene. One call at a time.
class FitRenderer {
 public:
  explicit FitRenderer(const Workers& workers) : context_(workers), renderer_(workers) {}

  // `scale`: pixels of the images wanted for a pixel of the cameras. `views` index into
  // scene.cameras.
  struct Job {
    std::span<const int> views;
    float scale = 1;
    RenderOptions options;
    bool alpha = true;
  };
  Status Render(const FitScene& scene, const Job& job);
  const Images& images() const { return renderer_.frame.images(); }

 private:
  nn::Context context_;
  SceneRenderer renderer_;
};

// A mesh with its first texture or its vertex colours, and back. Materials' factors are multiplied
// into colours. An error says what a FitScene cannot hold: several textures, say.
Result<FitScene> SceneOfMesh(const Mesh& mesh);
// The sphere's longitude and latitude (scene/shapes.h) as texture coordinates of a scene that
// has its faces; corners of a vertex share one where they are on the same side of the seam.
void SetSphereUv(const Mesh& sphere, FitScene* scene);
// Its normals are smooth; it is unlit unless the scene has light of its own.
Mesh MeshOfScene(const FitScene& scene);

}  // namespace tilegrad::train
