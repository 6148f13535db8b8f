// SPDX-License-Identifier: Apache-2.0
// A rough object and the cameras of those pictures that are placed around it so far.
#pragma once

#include <span>
#include <vector>

#include "fit/fitter.h"
#include "fit/poses/crop.h"

namespace tilegrad::train {

// What a search knows of its pictures; the same for all starts.
struct PosePictures {
  TargetImages images;         // of few pixels
  std::vector<Camera> lenses;  // intrinsics of such a picture; poses mean nothing
  std::vector<Crop> crops;
  double color_weight = 1;  // of CropCost
  std::array<float, 3> mean_color = {};
};

Result<PosePictures> Prepare(const TargetImages& images, std::span<const Camera> lenses);

// Where an object is looked at from.
struct Viewpoint {
  Camera camera;  // looks at the origin
  Crop crop;      // what it sees
};

struct RefitOptions {
  int steps = 40;
  int views_per_step = 8;
  bool shape = true, cameras = true;
  double delta_start = 2e-3, delta_end = 3e-4;
  double rate = 1, camera_rate = 0.008;
  double silhouette_weight = 1, color_weight = 1;
};

class PoseEstimate {
 public:
  PoseEstimate(const PosePictures& pictures, const Workers& workers);

  // A grey sphere again; cameras stay.
  void ForgetShape();
  void Place(int picture, const Camera& camera);
  void Remove(int picture) { placed_[static_cast<std::size_t>(picture)] = false; }
  bool is_placed(int picture) const { return placed_[static_cast<std::size_t>(picture)]; }
  std::vector<int> Placed() const;
  const Camera& camera(int picture) const {
    return scene_.cameras[static_cast<std::size_t>(picture)];
  }
  const FitScene& scene() const { return scene_; }

  // Descends on `views`. The loss of the last steps, mean.
  Result<double> Refit(const RefitOptions& options, std::span<const int> views);
  // Loss of each picture, as it stands.
  Result<std::vector<double>> Losses(std::span<const int> views);

  // The object from all around: roll 0 about the direction that is up for the placed cameras.
  Result<std::vector<Viewpoint>> LookAround();
  // Crops of the object from the placed cameras.

  // Middle to the origin, size to 1: what pictures leave open.
  void Normalize();

 private:
  std::array<double, 3> Up() const;

  const PosePictures& pictures_;
  const Workers& workers_;
  FitRenderer renderer_;
  FitScene scene_;
  std::vector<bool> placed_;
  int refits_ = 0;
};

}  // namespace tilegrad::train
