// SPDX-License-Identifier: Apache-2.0
// What the views have in common, on a coarse grid: a soft visual hull of masks that are in doubt.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/camera.h"

namespace tilegrad::train {

class CommonHull {
 public:
  struct Place {
    float x, y, depth;  // pixels, pixels, world units
  };

  // A cube of cells around `middle`, half as wide as the views see there; of these the ones that
  // all but a tenth of the views have in their images.
  CommonHull(std::span<const Camera> cameras, ImageSize size, glm::vec3 middle,
             const Workers& workers);

  // How full each cell is: little where more than a share `tolerance` of the views, `inside`
  // [N,H,W], say that there is nothing.
  void Vote(std::span<const float> inside, double tolerance, const Workers& workers);

  // How full the fullest cell is that each pixel of a view looks at, [H,W] in [0, 1].
  std::vector<float> Silhouette(std::size_t view) const;

  float reach() const { return 0.5f * cell_ * kSide; }  // half of the cube's side, world units

  // Where a view sees a point; (-1, -1) where it is not before the camera.
  Place Project(std::size_t view, glm::vec3 p) const;

 private:
  static constexpr int kSide = 96;  // cells along the cube

  glm::vec3 Centre(std::size_t cell) const;

  std::vector<Camera> cameras_;
  ImageSize size_;
  glm::vec3 low_;
  float cell_ = 0;
  std::vector<float> full_;     // [x][y][z]
  std::vector<bool> possible_;  // cells that enough views see
};

}  // namespace tilegrad::train
