// SPDX-License-Identifier: Apache-2.0
// What the object stands on: the level plane on which most views see the same colours. A shadow
// lies on it, so that all views see it in one place; of what rises above it they see different
// parts before one place of it.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "fit/image_loss.h"
#include "scene/camera.h"

namespace tilegrad::train {

// What is up for people who hold their cameras level.
glm::vec3 UpOf(std::span<const Camera> cameras);

class Floor {
 public:
  struct Region {
    glm::vec3 middle;
    float reach;   // the floor is below `middle` by up to so much, and looked at so far around it
    glm::vec3 up;  // of length 1
  };
  // Cameras and images must outlive it.
  Floor(const TargetImages& images, std::span<const Camera> cameras, const Region& region,
        const Workers& workers);

  // Learns the floor's colours again, from pixels that are neither `inside` [N,H,W] in [0, 1] nor
  // in `holes` [N,H,W], which is 1 there. A place that fewer than two views see so takes holes,
  // too.
  void Relearn(std::span<const float> inside, std::span<const float> holes, const Workers& workers);

  // Whether one height stands out; else nothing is known of a floor.
  bool found() const { return found_; }
  // Along the region's up, from its middle.
  float height() const { return height_; }
  // [H,W] in [-1, 1]: 1 where a view's pixel has the colour that most views see where it meets the
  // floor; -1 where it has another, so that something stands before it; 0 where nothing is known;
  // `beyond` where it looks past the square whose colours are known.
  std::vector<float> Agreement(std::size_t view, float beyond = 0) const;

 private:
  struct Texel {
    glm::vec3 color{0};
    float support = 0;  // share of the views that see this colour
  };
  void Smooth(const Workers& workers);
  void FindHeight(const Workers& workers);
  // Of a square of side x side texels.
  glm::vec3 PointOf(float height, int side, std::size_t texel) const;
  const Texel* TexelAt(glm::vec3 eye, glm::vec3 ray) const;
  static Texel Agreed(std::span<const glm::vec3> colors);
  Texel Seen(glm::vec3 point) const;
  Texel SeenBeside(glm::vec3 point, const std::vector<std::uint8_t>& hidden) const;
  float ScoreAt(float height) const;
  glm::vec3 ColorAt(std::size_t pixel) const;  // of [N,H,W]
  // Where in [N,H,W] a view sees a point; none beside its image.
  std::optional<std::size_t> PixelOf(std::size_t view, glm::vec3 point) const;

  const TargetImages& images_;
  const std::span<const Camera> cameras_;
  const Region region_;
  glm::vec3 along_, across_;
  std::vector<float> smooth_;  // [N,H,W,3], means over 3 x 3 pixels
  float height_ = 0;
  bool found_ = false;
  std::vector<Texel> texels_;
};

}  // namespace tilegrad::train
