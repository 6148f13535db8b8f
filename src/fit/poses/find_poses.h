// SPDX-License-Identifier: Apache-2.0
// Cameras of pictures that came without: from masks and colours alone, by expectation maximisation
// from random starts, as structures of molecules are found from micrographs (A. Punjani et al.,
// cryoSPARC, Nature Methods 2017).
//
// A start puts the cameras anywhere. In each sweep a random half of the pictures makes a rough
// coloured mesh by gradient descent, every picture of the other half looks for its place among some
// 150 viewpoints around it, then the halves change places, and shape and cameras descend together.
// Pictures that are unlike keep apart in the first sweeps: else all gather at a few viewpoints of a
// mesh that is the mean of everything. Starts end once two agree.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "fit/image_loss.h"
#include "fit/poses/crop.h"
#include "fit/scene.h"
#include "scene/camera.h"

namespace tilegrad::train {

inline constexpr int kLeastPictures = 6;

// What a search from one start has found.
struct PoseStart {
  std::vector<Camera> cameras;
  double loss = HUGE_VAL;
};

struct PoseOptions {
  int starts = 8;  // at most
  int sweeps = 8;  // of each, at most
  std::int64_t seed = 1;
  // Of an earlier call with the same arguments that was stopped: the starts that it came through.
  std::vector<PoseStart> done = {};
  // Told of all starts so far whenever one is through, so that they can be kept.
  std::function<Status(std::span<const PoseStart>)> keep = nullptr;
};

struct FoundPoses {
  std::vector<Camera> cameras;  // of the images, in their pixels; the object is about 1 across and
                                // around the origin, up is +y
  double loss = 0;              // of the best start
  int starts = 0;               // taken
  // Degrees between the cameras of the best start and those of the start nearest to it; 180 if
  // there is none. Where this is large, cameras are in doubt.
  double agreement = 180;
};

// Assumes that masks are right; that the whole object is in every picture, near its middle; that
// cameras were held upright, between 45 degrees below the object and 80 above; that it looks alike
// in no two of them by symmetry. `lenses`: intrinsics of each image; their poses are not looked at.
// A pure function of its arguments for any number of workers. Errors: fewer than kLeastPictures; an
// image whose mask is empty; the loss is not finite; kCancelled.
Result<FoundPoses> FindPoses(const TargetImages& images, std::span<const Camera> lenses,
                             const PoseOptions& options, const Workers& workers,
                             const Watch& watch);

// Cameras that are some degrees off, brought nearer with a rough mesh: silhouettes and vertex
// colours of pictures of about 128 pixels. The object must be about 1 across and around the origin;
// it is so afterwards. Up is made +y.
Result<std::vector<Camera>> RefinePoses(const TargetImages& images, std::span<const Camera> cameras,
                                        const Workers& workers, const Watch& watch = {});

// An object from all around, and where a picture fits in best.

struct Viewpoint {
  Camera camera;  // looks at the origin
  Crop crop;      // what it sees
};

// The object of a scene, which is about 1 across and around the origin, from 12.5 to 15 degrees
// apart: from 45 degrees below the horizon to 80 above, without roll about `up`.
Result<std::vector<Viewpoint>> LookAround(const FitScene& scene, const std::array<double, 3>& up,
                                          FitRenderer* renderer);

// Degrees between the directions in which two cameras look.
double DirectionGap(const Camera& a, const Camera& b);

}  // namespace tilegrad::train
