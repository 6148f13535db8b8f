// SPDX-License-Identifier: Apache-2.0
// How scenes are rendered, and which images of them are wanted.
#pragma once

#include "tilegrad/abi.h"

namespace tilegrad::inline v0 {

enum class Interpolation {
  kPerspective,   // attributes are linear on the face in space: what a camera sees
  kScreenLinear,  // linear on the screen: the implementation of the DIB-R paper
};
enum class FaceCulling {
  kNone,
  kBack,  // clockwise faces are not drawn, but take part in alpha
};
enum class AlphaRule {
  kAllFaces,  // equation 6 of the paper over all faces, within max_alpha_error
  // As the paper's implementations: faces whose box, grown by paper_box, holds the pixel, and of
  // these the first paper_faces in the order of the mesh. No bound, slow: for comparisons.
  kPaper,
};

struct RenderOptions {
  int width = 64, height = 64;  // pixels, 1..16384; of all images of a call
  // alpha = 1 - prod over faces (1 - exp(-d^2 / delta)), with d the distance to the face in NDC,
  // in which the image spans [-1, 1] in each axis. > 0; larger is softer.
  double delta = 1.0 / 7000;
  double max_alpha_error = 1e-6;  // of alpha, absolute, [0, 1]; larger is faster, 0 drops nothing
  Interpolation interpolation = Interpolation::kPerspective;
  FaceCulling culling = FaceCulling::kNone;
  AlphaRule alpha_rule = AlphaRule::kAllFaces;
  double paper_box = 0.02;  // NDC, >= 0
  int paper_faces = 30;     // >= 0

  bool operator==(const RenderOptions&) const = default;
};

// Which images are wanted. What is not wanted is not computed and takes no memory.
struct Outputs {
  bool color = true;  // faces are white in a scene that has nothing to colour them by
  bool alpha = true;
  bool attributes = true;  // where the scene has them
  bool depth = false;
  bool normals = false;
  bool uv = false;
  bool barycentrics = false;
};

}  // namespace tilegrad::inline v0
