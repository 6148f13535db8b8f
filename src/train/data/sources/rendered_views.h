// SPDX-License-Identifier: Apache-2.0
// Published sets of rendered views: a folder SYNSET/MODEL with pictures, and a camera of each. A
// set is a file that says where these are (choy.cc, dvr.cc, dibr.cc); all else is here.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "scene/camera.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {

inline constexpr int kRenderedViews = 24;  // of a model, in every one of these sets

struct RenderedView {
  Path image;
  Path mask;        // not 0 is inside; empty: the image's alpha says it
  Camera64 camera;  // of a picture with sides of 1, in the frame of RenderedSet::half_extent
};

struct RenderedModel {
  std::vector<RenderedView> views;
  ModelData truth;  // without images and cameras
};

struct RenderedSet {
  std::string name, credit;
  std::string expected;  // files of a model, for an error where there is none
  Path models;           // the folder of SYNSET/MODEL
  CameraRule like;       // what its cameras are like, and how large its objects
  double train_portion =
      0;  // of each class, in the order of names; the rest tests. 0: our own rule
  std::function<Result<RenderedModel>(const Path& model)> read;  // thread-safe
};

// Options of all sets. Pictures are brought to image_size by averaging areas.
Result<std::unique_ptr<ModelSource>> OpenRenderedSet(RenderedSet set, const SplitList& list,
                                                     int image_size);

// The camera of a world in which the object that lies around `centre` lies around the origin,
// `scale` times smaller.
Camera64 CameraOfObject(Camera64 camera, const double centre[3], double scale);

}  // namespace tilegrad::train
