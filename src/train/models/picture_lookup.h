// SPDX-License-Identifier: Apache-2.0
// What the input picture shows of each texel of a predicted surface, if the picture's camera and
// the shape are as predicted. Numbers without gradient: networks take them as input.
#pragma once

#include <array>
#include <vector>

#include "nn/context.h"
#include "scene/sphere_uv.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {

// A camera that looks about at the origin, as numbers that a network can learn: the first two rows
// of its rotation; the principal point's shift from the middle; the size in the image of a unit
// length at the origin; 1 / distance. The last four are shifted and scaled to be about 1 or less.
inline constexpr std::int64_t kPoseNumbers = 10;
using Pose = std::array<double, kPoseNumbers>;
// `size`: pixels a side of the image.
Pose PoseOf(const Camera& camera, int size);
// The camera of predicted numbers; its rotation is orthonormal.
Camera CameraOf(const Pose& pose, int size);

class PictureLookup {
 public:
  // Of maps [side][side] of the sphere, by longitude and latitude.
  PictureLookup(const Mesh& sphere, int side);

  struct Job {
    const nn::Tensor& images;     // [M,4,size,size], RGB over black and cover
    const nn::Tensor& positions;  // [M,V,3]
    const nn::Tensor& pose;       // [M,10]: Pose, whose rows need not be orthonormal
    nn::Tensor light = {};        // [M,3] unit, in the axes of the camera; empty: none
  };
  // For each texel, and then for its mirror image at x = 0: RGB (what is seen, divided by the
  // cover), the cover, n.v towards the camera (< 0: turned away), ln of 1 over the Lambert light
  // there, at most ln 4. Hidden surfaces are not told from others.
  static constexpr std::int64_t kChannels = 6;
  // [M, 2 kChannels, side, side], or the first three of each alone: [M, 6, side, side].
  nn::Tensor Look(nn::Context& context, const Job& job) const;
  nn::Tensor Colors(nn::Context& context, const Job& job) const;

  // [M, kCues]: how brightness goes with the normals that the camera sees, from which a light's
  // direction can be read. Their mean; the mean brightness; the covariance of both, by that mean;
  // the share that is not black; the mean normal of what is not; last the unit direction d that
  // fits the brightness of what is not black best as a multiple of n.d, as if all had one paint.
  static constexpr std::int64_t kCues = 14;
  nn::Tensor Cues(nn::Context& context, const Job& job) const;

 private:
  template <class T>
  class Picture;  // one of a Job
  template <class T>
  void LookAt(const Job& job, std::size_t m, std::size_t channels, T* out) const;
  nn::Tensor Run(nn::Context& context, const Job& job, std::int64_t channels) const;

  std::size_t side_;
  std::vector<Face> faces_;
  std::vector<SurfacePoint> texels_;  // [side][side]
};

}  // namespace tilegrad::train
