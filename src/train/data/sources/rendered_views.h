// SPDX-License-Identifier: Apache-2.0
// Published sets of rendered views: a folder SYNSET/MODEL with pictures and a camera for each. One
// file per set says where these are (choy.cc, dvr.cc, dibr.cc); the rest is here.
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
  Path mask;        // nonzero inside; empty: the image's alpha is the mask
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
  CameraRule like;       // typical cameras, and the size of its objects
  double train_portion =
      0;  // of each class, in the order of names; the rest tests. 0: our own rule
  std::function<Result<RenderedModel>(const Path& model)> read;  // thread-safe
};

// Options of all sets. Resizes pictures to image_size by averaging areas.
Result<std::unique_ptr<ModelSource>> OpenRenderedSet(RenderedSet set, const SplitList& list,
                                                     int image_size);

// The camera after the object is moved from `centre` to the origin and made `scale` times smaller.
Camera64 CameraOfObject(Camera64 camera, const double centre[3], double scale);

}  // namespace tilegrad::train
