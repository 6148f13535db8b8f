// SPDX-License-Identifier: Apache-2.0
// What views see of a solid on a grid, and whether they agree on its colours: the test of space
// carving (K. Kutulakos, S. Seitz: A theory of shape by space carving, 2000).
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "base/function_ref.h"
#include "base/parallel.h"
#include "fit/input.h"
#include "scene/level_set.h"

namespace tilegrad::train {

// Between the grid's points linearly; where the grid ends, -cell.
float SampleGrid(const ScalarGrid& grid, glm::vec3 point);

// The training views of an input at about 100 to 200 pixels, with the depth that each pixel sees.
class PhotoViews {
 public:
  struct Pixel {
    std::uint32_t view;  // of the training views
    std::uint32_t at;    // of [H,W]
  };
  // Straight colours of a point that at least three views see.
  struct Agreement {
    float difference = 0;  // |pixel - mean of the others|, mean over the channels, at most kMost
    bool known = false;    // at least two other views see the point
  };
  static constexpr float kMost = 0.3f;

  PhotoViews(const FitInput& input, const ScalarGrid& solid, const Workers& workers);

  // Pixels of the masks that see the solid, by views and rows.
  std::vector<Pixel> Seeing() const;

  // The same pixels' depths of a solid that is part of the former one.
  void Look(std::span<const Pixel> pixels, const ScalarGrid& solid, const Workers& workers);
  // Depths, world units along the viewing direction; infinite where a pixel sees nothing.
  std::vector<float> Depths(std::span<const Pixel> pixels) const;
  void SetDepths(std::span<const Pixel> pixels, std::span<const float> depths);

  // The point that a pixel sees, or that lies `further` behind it, world units along its ray.
  glm::vec3 PointOf(Pixel pixel, float further = 0) const;

  // The points between two depths of a pixel's ray, `step` world units from each other.
  void Trace(Pixel pixel, float from, float to, float step,
             FunctionRef<void(glm::vec3 point)> visit) const;

  // A pixel that sees nothing, where its mask has the object, differs by 1, which is known.
  std::vector<Agreement> Agree(std::span<const Pixel> pixels, const Workers& workers) const;

 private:
  struct View {
    Camera camera;
    std::span<const float> color, alpha;  // [3,H,W], [H,W]
    std::vector<float> depth;             // [H,W]
    glm::vec3 eye;
  };

  glm::vec3 Along(const View& view, std::uint32_t at) const;
  float March(const View& view, std::uint32_t at, float from, const ScalarGrid& solid) const;
  bool Sees(const View& view, glm::vec3 point, glm::vec3* color) const;
  Agreement AgreeOn(Pixel pixel) const;

  TargetImages images_;
  std::vector<View> views_;
  float slack_;  // of depths, world units
};

}  // namespace tilegrad::train
