// SPDX-License-Identifier: Apache-2.0
// A predicted mesh brought closer to the picture that it was predicted from: its camera is searched
// for, then camera, shape and colours follow the gradient of equations 12 and 13 through the
// renderer. One picture shows one side; the other follows by symmetry at x = 0, which most made
// things have.
#pragma once

#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "fit/image_loss.h"
#include "fit/scene.h"
#include "scene/camera.h"
#include "scene/mesh.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

inline constexpr int kRefineSteps = 800;  // a few seconds on two cores
// Of RefinedMesh::rival: below, the picture may well be taken from another side.
inline constexpr double kDoubtfulRival = 1.1;
inline constexpr int kRefineSize = 128;  // pixels a side of the picture that predict refines on:
                                         // an edge of the divided template is about three

struct RefineOptions {
  int steps = kRefineSteps;  // of gradient descent; 0: only the camera is found
  CameraRule camera = {};    // of the training images: where the search for the camera begins
  Watch watch = {};
};

// How a mesh looks from the picture's camera.
struct PictureMatch {
  double silhouette_iou = 0;  // sum of minima by sum of maxima of both alphas: 1 where they agree
  double color_l1 = 0;  // mean |difference| over channels and the pixels of the picture's object
};

struct RefinedMesh {
  Mesh mesh;             // normalised as predictions are; with the prediction's kind of colours
  Camera camera;         // sees it as the picture shows it; of pixels of the picture
  Camera camera_before;  // the best that was found for the prediction
  PictureMatch before, after;
  // What the best start from another side cost by that of this one, after a tenth of the steps: 1
  // where the two are as good; infinity where there was no other.
  double rival = HUGE_VAL;
};

// `picture`: one square image. `prediction`: a mesh with vertex colours or one texture map,
// normalised as predictions are, y up. Faces of a coarse mesh are divided once, so that the result
// may have more vertices than the prediction. A pure function of its arguments; any number of
// workers gives the same bits. Errors: a picture without an object; those of the renderer;
// kCancelled.
Result<RefinedMesh> RefineMesh(const Mesh& prediction, const TargetImages& picture,
                               const RefineOptions& options, const Workers& workers);

// From where a picture shows a mesh: tried from all around, by silhouette and colour.
struct FoundCamera {
  Camera camera{};
  double azimuth = 0, elevation = 0;  // degrees, of the orbit it began as
  double silhouette_iou = 0, color_l1 = 0;
  double cost() const { return 1 - silhouette_iou + color_l1; }
};

// Cameras of the rule's lens and distance around `scene` at several elevations, each moved and
// brought nearer until the mesh fills the picture's bounding box; best first. `picture`: one image.
// An error where the picture shows no object.
Result<std::vector<FoundCamera>> FindCameras(const FitScene& scene, const TargetImages& picture,
                                             const CameraRule& rule, const Workers& workers);

}  // namespace tilegrad::train
