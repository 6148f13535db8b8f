// SPDX-License-Identifier: Apache-2.0
// A rough object, and cameras around it: what a search for cameras improves.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "base/progress.h"
#include "fit/fitter.h"
#include "fit/poses/crop.h"

namespace tilegrad::train {

struct RefitOptions {
  int steps = 40;
  bool shape = true, cameras = true;
  double shape_rate = 1;  // times the usual rates
  // Of these steps, as the watch is told: the first of them among `told` of "refining cameras"; 0:
  // it is not told.
  int first = 0, told = 0;
};

class PoseEstimate {
 public:
  // A sphere of `level` (scene/shapes.h). All references must outlive this.
  PoseEstimate(const PosePictures& pictures, int level, const Workers& workers, const Watch& watch);

  // A sphere of the pictures' mean colour again; cameras stay.
  void ForgetShape();
  // The pose of `camera` for a picture, whose lens stays.
  void Place(std::size_t picture, const Camera& camera);

  const std::vector<Camera>& cameras() const { return scene_.cameras; }
  const FitScene& scene() const { return scene_; }
  // Cameras that are held upright have their x axes across it.
  std::array<double, 3> Up() const;

  // Descends on some of the pictures, from soft outlines to narrow ones; the mean loss of the last
  // quarter of the steps. kCancelled between steps.
  Result<double> Refit(const RefitOptions& options, std::span<const int> pictures);

  // The object's middle to the origin and its longest side to 1, cameras with it: what pictures
  // leave open.
  void Normalize();

 private:
  FitStep StepAt(double t) const;
  Status Tell(const RefitOptions& o, int step) const;

  const PosePictures& pictures_;
  const int level_;
  const Workers& workers_;
  const Watch& watch_;
  FitScene scene_;
  std::uint64_t refits_ = 0;  // each chooses its pictures anew
};

}  // namespace tilegrad::train
