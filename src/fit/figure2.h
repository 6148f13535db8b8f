// SPDX-License-Identifier: Apache-2.0
// The paper's Figure 2: eight scenes, in each of which one attribute is wrong and is brought back
// by gradient descent on the L1 loss between images.
#pragma once

#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "fit/fitter.h"
#include "scene/image.h"

namespace tilegrad::train {

struct Figure2Options {
  int size = 128;   // pixels a side
  int steps = 400;  // of each optimisation
};

// One of the eight: what is seen, and where the optimisation starts.
struct Figure2Case {
  std::string label;  // "a"
  std::string what;   // "vertex position"
  std::string model;  // "vertex colour"
  Parameter parameter = Parameter::kPositions;
  FitScene target, start;
  double learning_rate = 0;
  double smoothing = 0;
  double delta = 1.0 / 3000;
};
std::vector<Figure2Case> Figure2Cases(int size);

struct Figure2Result {
  std::string label, what, model;
  ImageU8 start, target, result;  // RGB over white
  // L1 of RGBA before each step, and after the last: mean over pixels and channels of colour plus
  // that of alpha.
  std::vector<double> losses;
  double seconds = 0;

  double remaining() const { return losses.back() / losses.front(); }
};

Result<Figure2Result> RunFigure2Case(const Figure2Case& one, const Figure2Options& options,
                                     const Workers& workers);
// All eight. Same bits for any number of workers.
Result<std::vector<Figure2Result>> RunFigure2(const Figure2Options& options, const Workers& workers,
                                              const ProgressSink& progress, const StopFlag& stop);

// start | target | result | error curve of each, as SVG that needs nothing else.
Result<std::string> Figure2Svg(const std::vector<Figure2Result>& results);
// The errors as a Markdown table.
std::string Figure2Table(const std::vector<Figure2Result>& results);

}  // namespace tilegrad::train
