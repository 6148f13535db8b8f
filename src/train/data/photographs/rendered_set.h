// SPDX-License-Identifier: Apache-2.0
// Synthetic photographs that anyone can make: models in front of real backgrounds, one view of each
// object, annotated as noisily as real ones, in the layout of PASCAL3D+ (photographs.h). The
// annotations of the test part come from the true models and are exact, also its cameras: each is
// the one that projects its object's true keypoints best, in the world of the training part's.
#pragma once

#include <array>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "base/rng.h"
#include "scene/mesh.h"
#include "train/data/photographs/photographs.h"
#include "train/data/stream/textured_meshes.h"

namespace tilegrad::train {

struct RenderedSetJob {
  const MeshCache& train;  // models, from each of which many objects are made
  const MeshCache& test;
  std::vector<Path> backgrounds;  // photographs
  int train_count = 600, test_count = 120;
  std::uint64_t seed = 1;
};

// The noise of the training part's annotations.
struct AnnotationNoise {
  double mask = 2.0;           // pixels by which a mask's outline wanders, one standard deviation
  double keypoint = 0.02;      // standard deviation of each coordinate, relative to the box
  double hidden = 0.1;         // share of visible keypoints that are not annotated
  bool exact_cameras = false;  // as the test part's; else found from the keypoints
};

// Writes <folder>/Images and <folder>/{data,sfm}. An object is a model stretched by up to 15 %
// along each axis, seen from all around at elevations from -5 to 30 degrees by a pinhole camera a
// few lengths away, under the light of datasets. Keypoints: FindExtremePoints, visible where
// nothing hides them. Cameras of the training part: factorization.h, from the keypoints alone,
// unless noise.exact_cameras. The same for any number of workers.
Status MakeRenderedSet(const RenderedSetJob& job, const AnnotationNoise& noise, const Path& folder,
                       const Workers& workers, const Watch& watch);

// Keypoints of rendered models, which have no annotations: the vertices that reach farthest in
// fixed directions, in coordinates scaled by the half extents of the bounding box.
struct ExtremePoint {
  const char* name;
  std::array<float, 3> direction;  // x to the left, y up, z to the front
};

// Six pairs, left then right, at about the places of PASCAL3D+'s twelve of cars: bumpers, lights,
// trunk, and the four corners of the roof.
extern const std::array<ExtremePoint, 12> kExtremePoints;
std::vector<int> ExtremeMirror();  // keypoint i is the mirror image of keypoint [i]

// For a mesh with vertices: the mean of the vertices that reach farthest, within a hundredth.
std::vector<glm::vec3> FindExtremePoints(const Mesh& mesh);

// The mask with its outline moved in and out by smooth noise of `deviation` pixels, plus a constant
// shift of half that deviation. Never empty.
PhotoMask DisturbedMask(const PhotoMask& mask, double deviation, Rng& rng);

}  // namespace tilegrad::train
