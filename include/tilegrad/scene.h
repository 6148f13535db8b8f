// SPDX-License-Identifier: Apache-2.0
// The scene: views of the caller's arrays, which must stay alive and unchanged until the last
// Backward of the frame. Empty arrays are absent: positions and faces alone give a silhouette,
// `colors` give vertex colours, `textures` with `uvs` give texture; with both, they are multiplied.
//
// Shapes: V vertices, F faces, C channels; row-major, the last axis is contiguous.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "tilegrad/abi.h"
#include "tilegrad/camera.h"

namespace tilegrad::inline v0 {

enum class Rate { kVertex, kCorner };

// Values interpolated over faces.
template <class T>
struct StreamT {
  std::span<const T> values{};  // [V,C]; [F,3,C] with Rate::kCorner: seams without extra vertices
  Rate rate = Rate::kVertex;
};

enum class Wrap {
  kRepeat,  // the texture tiles the plane
  kClamp,   // outside [0, 1] the border texels are repeated
  kMirror,  // tiles of the texture and its mirror image alternate
  // Different modes along u and v.
  kRepeatClamp,
  kClampMirror,
  kMirrorRepeat,
  kRepeatMirror,
  kClampRepeat,
  kMirrorClamp,
};
enum class Filter {
  kNearest,    // no gradient to uvs
  kBilinear,   // between the four nearest texels
  kTrilinear,  // and between two mip levels, chosen by the pixel's footprint
};

// [height,width,3], row 0 on top; (u, v) = (0, 0) is the lower left corner. Sides 1..16384.
template <class T>
struct TextureT {
  std::span<const T> texels{};
  int width = 0, height = 0;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kBilinear;
};

enum class Lighting {
  kNone,                // light is 1
  kLambert,             // uses `lights` or `light_directions`
  kPhong,               // the same, with a highlight towards the eye
  kSphericalHarmonics,  // `sh`: degree 2, nine coefficients
};
enum class Normals {
  kSmooth,  // per vertex, from positions, weighted by face area
  kFlat,    // per face, from positions
  kGiven,   // the scene's `normals`, of any length
};

// The same for all scenes of a batch.
struct ShadingModel {
  Lighting lighting = Lighting::kNone;
  Normals normals = Normals::kSmooth;
  bool two_sided = false;  // flips normals of faces seen from behind
  bool clamp = false;      // colours to [0, 1]; clamped values have no gradient
  bool operator==(const ShadingModel&) const = default;
};

// colour = base_color * texture * vertex colour * (ambient + diffuse * light) + specular *
// highlight
template <class T>
struct SurfaceT {
  std::array<T, 3> base_color = {T(1), T(1), T(1)};
  int texture = -1;  // index into `textures`, -1: none
  // For Lambert and Phong lighting; spherical harmonics ignore them.
  std::array<T, 3> ambient = {T(0), T(0), T(0)};
  std::array<T, 3> diffuse = {T(1), T(1), T(1)};
  std::array<T, 3> specular = {T(0.4), T(0.4), T(0.4)};  // Phong
  T shininess = T(10);                                   // Phong; 0..1e6
};

template <class T>
struct LightT {
  std::array<T, 3> direction = {T(0), T(0), T(1)};  // from the surface to the light, world, not 0
  T intensity = T(1);
};

// All scenes of a batch have the same parts (an array empty in one is empty in all), rates and
// model.
template <class T>
struct SceneT {
  std::span<const T> positions{};         // [V,3] world
  std::span<const std::int32_t> faces{};  // [F,3] indices in [0, V); counter-clockwise is the front
  CameraT<T> camera{};

  StreamT<T> colors{};   // C = 3
  StreamT<T> uvs{};      // C = 2
  StreamT<T> normals{};  // C = 3, world; with Normals::kGiven
  std::span<const TextureT<T>> textures{};
  std::span<const SurfaceT<T>> surfaces{};  // empty: the default, with texture 0 if there is one
  std::span<const std::int32_t> face_surfaces{};  // [F] indices into surfaces; empty: all 0
  ShadingModel shading{};
  std::span<const LightT<T>> lights{};
  std::span<const T> light_directions{};  // [V,3]: one light of intensity 1, instead of `lights`
  std::span<const T> sh{};                // [9] orthonormal real harmonics: 1, -y, z, -x, xy, -yz,
                                          // 3z^2-1, -xz, x^2-y^2
  StreamT<T> attributes{};                // anything else, C = channels
  int channels = 0;
};

using Stream = StreamT<float>;
using Texture = TextureT<float>;
using Surface = SurfaceT<float>;
using Light = LightT<float>;
using Scene = SceneT<float>;

// dL/d(scene). Empty spans and null pointers are not computed and cost nothing. Scenes of a batch
// may share an array, as for many views of one mesh: it receives their sum, added in scene order.
// Arrays that overlap partly, or differ in kind or size, are an error.
template <class T>
struct SceneGradientsT {
  std::span<T> positions{};      // shapes as in the scene
  CameraT<T>* camera = nullptr;  // per entry, as if all entries were free; near_plane gets 0
  std::span<T> colors{}, uvs{}, normals{};
  std::span<const std::span<T>> textures{};  // one per texture; empty ones are not computed
  std::span<SurfaceT<T>> surfaces{};         // [1] if the scene has none; `texture` is not written
  std::span<LightT<T>> lights{};
  std::span<T> light_directions{}, sh{}, attributes{};
};
using SceneGradients = SceneGradientsT<float>;

}  // namespace tilegrad::inline v0
