// SPDX-License-Identifier: Apache-2.0
// The keys of `task.kind = "photographs"`: section 5.4. What each does: config.cc.
#pragma once

#include "train/data/photographs/photo_store.h"
#include "train/models/photograph_network.h"
#include "train/tasks/adversary.h"
#include "train/tasks/common_config.h"

namespace tilegrad::train {

// The defaults are CMR's for the terms that it has.
struct PhotographLosses {
  double keypoint = 30;        // mean square of visible keypoints, in [-1, 1] of the crop
  double mask = 2;             // mean square of silhouettes
  double iou = 0;              // equation 12 of silhouettes
  double camera = 2;           // 1 - |q q'|, and the mean square of scale and shift
  double azimuth = 2;          // of the camera hypothesis (cross-entropy)
  double deformation = 10;     // mean length of movements
  double laplacian = 30;       // losses/laplacian.h
  double entropy = 0.16;       // of each keypoint's weights
  double color = 1;            // equation 13 where the object is
  double flow_distance = 0.5;  // of the flow from the object (data/photographs/distance_barrier.h)
  bool color_moves = true;     // colour gradients reach the shape, too; CMR's do not
};

struct PhotographsConfig {
  PhotographNetworkConfig network;
  PhotographLosses loss;
  AdversaryConfig adversary;
  std::string start;  // a run, or checkpoint, whose network this one starts as; empty: as new
  RenderConfig render;
  OptimizerConfig optimizer;
  CropRule crop;
  std::int64_t size = 64;        // pixels a side
  double cutouts = 0.25;         // share of the inputs whose background is black
  std::string camera = "given";  // that renders the prediction: or "predicted"
  std::int64_t batch = 16;
  Schedule schedule;  // of the run; no keys of the task
};

ConfigFields FieldsOf(PhotographsConfig* config);
Status CheckConfig(const PhotographsConfig& config);

}  // namespace tilegrad::train
