// SPDX-License-Identifier: Apache-2.0
// A file of PASCAL3D+'s own annotations: Annotations/<class>_<imagenet|pascal>/*.mat, release 1.1
// (Y. Xiang, R. Mottaghi, S. Savarese, "Beyond PASCAL", WACV 2014).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "io/mat_file.h"
#include "scene/camera.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

// In degrees; pixels count from (1, 1). The world is that of the set's CAD models: z up, front
// towards -y; from azimuth 0 it is seen from the front.
struct Pascal3dViewpoint {
  double azimuth = 0, elevation = 0, theta = 0, distance = 0;  // theta: in the image plane
  double focal = 1, viewport = 3000;  // focal length in pixels: their product
  double px = 0, py = 0;
};

struct Pascal3dObject {
  int number = 0;                           // place among the record's objects, from 1
  int cad = 0;                              // the CAD model that is most like it, from 1; 0: none
  bool whole = true;                        // neither truncated, occluded nor difficult
  PhotoBox box;                             // in the coordinates of photographs.h
  std::map<std::string, Keypoint> anchors;  // likewise
  Pascal3dViewpoint viewpoint;              // distance 0: only a coarse one
};

struct Pascal3dRecord {
  std::string file;  // of the picture
  std::vector<Pascal3dObject> objects;
};

// The objects of a class. Errors name file and place.
Result<Pascal3dRecord> ReadPascal3dRecord(const io::MatFile& file, const std::string& class_name);

// As a pinhole camera in the project's world: x' = x, y' = z, z' = -y, so that y' is up and z' the
// front.
Camera64 CameraOfViewpoint(const Pascal3dViewpoint& viewpoint);

}  // namespace tilegrad::train
