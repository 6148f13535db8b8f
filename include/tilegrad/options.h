// SPDX-License-Identifier: Apache-2.0
// How to render scenes, and which images to compute.
#pragma once

#include "tilegrad/abi.h"

namespace tilegrad::inline v0 {

enum class Interpolation {
  kPerspective,   // attributes are linear on the face in world space: perspective-correct
  kScreenLinear,  // linear on the screen, as in the implementation of the DIB-R paper
};
enum class FaceCulling {
  kNone,
  kBack,  // do not draw clockwise faces; they still take part in alpha
};
enum class AlphaRule {
  kAllFaces,  // equation 6 of the paper over all faces, within max_alpha_error
  // As the paper's implementations: the first paper_faces faces, in mesh order, whose bounding box,
  // grown by paper_box, contains the pixel. No error bound, slow: for comparisons.
  kPaper,
};

struct RenderOptions {
  int width = 64, height = 64;  // pixels, 1..16384; the same for all images of a call
  // alpha = 1 - prod over faces (1 - exp(-d^2 / delta)), with d the distance to the face in NDC,
  // in which the image spans [-1, 1] in each axis. > 0; larger is softer.
  double delta = 1.0 / 7000;
  double max_alpha_error = 1e-6;  // of alpha, absolute, [0, 1]; larger is faster, 0 drops no face
  Interpolation interpolation = Interpolation::kPerspective;
  FaceCulling culling = FaceCulling::kNone;
  AlphaRule alpha_rule = AlphaRule::kAllFaces;
  double paper_box = 0.02;  // NDC, >= 0
  int paper_faces = 30;     // >= 0

  bool operator==(const RenderOptions&) const = default;
};

// Which images to compute. The others cost no time and no memory.
struct Outputs {
  bool color = true;  // faces are white if the scene specifies no colour
  bool alpha = true;
  bool attributes = true;  // if the scene has them
  bool depth = false;
  bool normals = false;
  bool uv = false;
  bool barycentrics = false;
};

}  // namespace tilegrad::inline v0
