// SPDX-License-Identifier: Apache-2.0
// How good a fit is.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "fit/input.h"
#include "fit/scene.h"
#include "render/picture/picture.h"
#include "train/similarity.h"

namespace tilegrad::train {

struct ViewScore {
  int view = 0;
  double psnr = 0;  // dB over the whole image, both over white; 3 x 3 samples a pixel
  double iou = 0;   // of the silhouettes: pixels that mask and render cover by a half or more
  ImageU8 truth, rendered;
};

// A view of the scene as a picture of `size`, 3 x 3 samples a pixel.
Result<Picture> DrawView(FitRenderer& renderer, const FitScene& scene, int view, ImageSize size);

// Views of the input rendered from `cameras` (one for each of `views`), with their gains.
Result<std::vector<ViewScore>> ScoreViews(const FitScene& scene, const FitInput& input,
                                          std::span<const int> views,
                                          std::span<const Camera> cameras, const Workers& workers,
                                          const Watch& watch = {});

// Means over views; 0 for none.
double MeanPsnr(std::span<const ViewScore> scores);
double MeanIou(std::span<const ViewScore> scores);

// What the scores of masked views say against a mask, a camera or all of them, in words for people;
// empty where nothing does.
std::string DoubtOf(std::span<const ViewScore> scores, const FitInput& input);

// Brings cameras `from` to stand and look like `to` as well as possible: rotation from their axes,
// the rest from their centres. Refined cameras fix a scene only up to it.
Similarity AlignCameras(std::span<const Camera> from, std::span<const Camera> to);
// The camera that sees a world moved by `a` as `camera` sees the world.
Camera Moved(const Camera& camera, const Similarity& a);
void Move(const Similarity& a, std::vector<float>* positions);
// Degrees between the two cameras' orientations.
double AngleBetween(const Camera& a, const Camera& b);

}  // namespace tilegrad::train
