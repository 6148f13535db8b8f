// SPDX-License-Identifier: Apache-2.0
// Photographs of one class of objects, one view of each, with masks, keypoints and cameras of weak
// perspective, as section 5.4 of the paper learns from. Three forms on disk:
//
//   CUB-200     as CMR's code and downloads lay it out: data/{train,val,test}_cub_cleaned.mat and
//               sfm/anno_{train,val,test}.mat, in the folder, or in cub/ or cachedir/cub/ of it;
//               pictures in images/ or CUB_200_2011/images/
//   PASCAL3D+   as CMR's code lays it out: data/<class>_kps.mat, data/<class>_{train,val}.mat and
//               sfm/<class>_{train,val}.mat, in the folder, p3d/ or cachedir/p3d/; pictures in
//               Images/ or PASCAL3D+_release1.1/Images/. Its val is our test split. For rendered
//               objects (rendered_set.h) sfm_anno also has `points`, 3 x K: Photograph::points
//   a folder    of pictures with alpha, or with masks/<name>.png; cameras of COLMAP,
//               transforms.json, or transforms_train.json and transforms_test.json, which say what
//               is held out; keypoints.json (docs/photographs.md)
//
// Coordinates are pixels of the whole photograph, x right, y down, the first pixel's centre at
// (0.5, 0.5): MATLAB's, which count from (1, 1), less a half.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/image.h"
#include "scene/weak_perspective.h"
#include "train/data/broken_members.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

struct Keypoint {
  double x = 0, y = 0;
  bool visible = false;  // x and y are meaningless where it is not
};

struct PhotoBox {
  double left = 0, top = 0, right = 0, bottom = 0;  // edges
  double longer_side() const;
};

// A bit a pixel, row by row from the top.
struct PhotoMask {
  int width = 0, height = 0;
  std::vector<bool> inside;
  bool at(int x, int y) const {
    return x >= 0 && y >= 0 && x < width && y < height &&
           inside[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

struct Photograph {
  std::string id;  // its path below the pictures' folder
  Path image;
  Split split = Split::kTrain;
  PhotoBox box;                     // of the object
  PhotoMask mask;                   // empty: the picture's alpha
  std::vector<Keypoint> keypoints;  // as many as the set has names
  std::optional<WeakPerspective> camera;
  // True positions of its keypoints in the world of the cameras. Empty: unknown, as for all
  // photographs of real objects.
  std::vector<std::array<double, 3>> points = {};
};

struct PhotographSet {
  std::string source;      // "cub", "pascal3d", "photographs"
  std::string class_name;  // of PASCAL3D+: "car"
  Path folder;
  std::vector<std::string> keypoint_names;
  std::vector<int> mirror;  // the mirror image of keypoint i is keypoint mirror[i]
  // Their mean positions in the world of the cameras, which is symmetric at x = 0; largest distance
  // about 2. Empty: there are no keypoints.
  std::vector<std::array<double, 3>> mean_keypoints;
  std::vector<Photograph> photographs;

  std::vector<int> Select(Split split) const;
};

// Detects the form. Errors name file and place, or the photograph, also of boxes, keypoints and
// cameras that are far from any picture. At least one photograph is of Split::kTrain; if a folder
// has keypoints but no cameras, factorisation finds them (factorization.h).
Result<PhotographSet> OpenPhotographs(const Path& folder);

// Errors: boxes, keypoints and cameras that are far from any picture.
Status CheckPhotograph(const Photograph& photo);

// A single form; nullopt if the folder is not of that form. With `broken`, photographs with invalid
// annotations go there instead of being an error.
Result<std::optional<PhotographSet>> OpenCmrLayout(const Path& folder,
                                                   BrokenMembers* broken = nullptr);
Result<std::optional<PhotographSet>> OpenPhotoFolder(const Path& folder);

// Annotations in CMR's layout, which OpenCmrLayout reads: <folder>/data and <folder>/sfm. `set`: of
// source "cub" (fifteen keypoints) or "pascal3d" with its class, with a mask and a camera for every
// photograph. Photographs are those of their split, in their order; their ids are the paths below
// the folder of pictures. The caller writes the pictures.
Status WriteCmrLayout(const Path& folder, const PhotographSet& set);

// CUB's fifteen keypoints.
extern const std::array<const char*, 15> kCubKeypoints;
std::vector<int> CubMirror();

}  // namespace tilegrad::train
