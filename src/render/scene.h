// SPDX-License-Identifier: Apache-2.0
// What the shaded renderer takes and gives: a scene with everything that gives it colour, the
// images that are wanted, and the same on the way back (paper, section 3.3; equation 7 in
// shade/combine.h).
//
// A scene is the SceneView of renderer.h, whose `attributes` are then the user's own channels, and
// more views over arrays of the caller. What is empty is not there: a scene with nothing but
// positions and faces has a silhouette, one with `colors` is shaded by them, one with `textures`
// and `uvs` is textured, and both are multiplied where both are there.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "render/pipeline/pipeline.h"
#include "shade/lambert.h"
#include "shade/spherical_harmonics.h"
#include "shade/texture.h"

namespace tilegrad {

enum class Lighting {
  kNone,                // I_l = 1
  kLambert,             // equation 10: `lights` or `light_directions`
  kPhong,               // equation 9: the same, and the eye
  kSphericalHarmonics,  // equation 11: `sh`
};

enum class NormalKind {
  kSmooth,  // from positions, weighted by the areas of the faces of a vertex
  kFlat,    // from positions, one for a face
  kGiven,   // `normals`; of any length
};

// The same for all scenes of a batch.
struct ShadingModel {
  Lighting lighting = Lighting::kNone;
  NormalKind normals = NormalKind::kSmooth;
  bool two_sided = false;  // normals of faces that are seen from behind (clockwise) are turned
  bool clamp = false;      // colours to [0, 1]; what is beyond has no gradient
  shade::ShBasis sh_basis = shade::ShBasis::kOrthonormal;
};

// What a surface makes of colour and light. Faces choose theirs by `face_surfaces`.
template <class T>
struct SurfaceT {
  std::array<T, 3> base_color = {T(1), T(1), T(1)};  // times texture times vertex colour
  int texture = -1;                                  // index into `textures`, -1: none
  // Of Lambert and Phong light; spherical harmonics have no use for them.
  std::array<T, 3> ambient = {T(0), T(0), T(0)};         // k_a; 0 in the paper
  std::array<T, 3> diffuse = {T(1), T(1), T(1)};         // k_d
  std::array<T, 3> specular = {T(0.4), T(0.4), T(0.4)};  // k_s; Phong
  T shininess = T(10);                                   // alpha of equation 8, 0 to 1e6; Phong
};
using Surface = SurfaceT<float>;

template <class T>
struct AttributeStreamT {
  std::span<const T> values;  // [V,C] or [F,3,C]
  AttributeRate rate = AttributeRate::kVertex;
};

template <class T>
struct ShadedSceneT : SceneViewT<T> {
  ShadingModel model;
  AttributeStreamT<T> colors;                        // C = 3
  AttributeStreamT<T> uvs;                           // C = 2; seams need rate kCorner
  AttributeStreamT<T> normals;                       // C = 3, world; with NormalKind::kGiven
  std::span<const shade::TextureViewT<T>> textures;  // of 3 channels
  // Empty: one surface as SurfaceT's defaults, which has texture 0 if there is one.
  std::span<const SurfaceT<T>> surfaces;
  std::span<const std::int32_t> face_surfaces;  // [F] indices into surfaces; empty: all 0
  // Directions from the surface towards the light, world, of any length > 0.
  std::span<const shade::DirectionalLightT<T>> lights;
  std::span<const T> light_directions;  // [V,3]: one light of intensity 1, instead of `lights`
  std::span<const T> sh;                // [9] coefficients
};

// Which images are wanted. `attributes` are the user's channels.
struct ShadedRequest : RenderRequest {
  bool color = true;
  bool normals = false;  // that shading uses: unit, world
  bool uv = false;
};

// 0 at background pixels. `attributes` [N,C,H,W] and `channels` are the user's.
template <class T>
struct ShadedFrameT : FrameT<T> {
  AlignedVector<T> color;    // [N,3,H,W]
  AlignedVector<T> normals;  // [N,3,H,W]
  AlignedVector<T> uv;       // [N,2,H,W]
};

// dL/d(image); an empty span is zero.
template <class T>
struct ShadedFrameGradientsT : FrameGradientsT<T> {
  std::span<const T> color, normals, uv;
  std::span<const T> depth;  // with Interpolation::kPerspective; background pixels are not read
};

// dL/d(scene), overwritten; an empty span (or false) is not computed. Scenes of a batch that are
// given the same array get their sum in it, in the order of scenes: of many views of one mesh, say.
template <class T>
struct ShadedGradientsT : SceneGradientsT<T> {
  std::span<T> colors, uvs, normals, light_directions;  // as in the scene
  std::span<const std::span<T>> textures;               // one for each; an empty one is not wanted
  std::span<SurfaceT<T>> surfaces;                      // entry by entry; [1] if the scene has none
  std::span<shade::DirectionalLightT<T>> lights;
  std::span<T> sh;
};

using ShadedScene = ShadedSceneT<float>;
using ShadedFrame = ShadedFrameT<float>;
using ShadedFrameGradients = ShadedFrameGradientsT<float>;
using ShadedGradients = ShadedGradientsT<float>;

}  // namespace tilegrad
