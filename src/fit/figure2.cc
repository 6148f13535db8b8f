// SPDX-License-Identifier: Apache-2.0
#include "fit/figure2.h"

#include <chrono>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "render/picture/composite.h"

namespace tilegrad::train {
namespace {

constexpr std::array kOneView = {0};
constexpr double kFigure2FinalRate = 0.005;  // of the first

FitRenderer::Job JobOf(const Figure2Case& one, const Figure2Options& options) {
  FitRenderer::Job job;
  job.views = kOneView;
  job.options.width = job.options.height = options.size;
  job.options.delta = one.delta;
  return job;
}

Result<TargetImages> RenderTarget(const Figure2Case& one, const FitRenderer::Job& job,
                                  const Workers& workers, ImageU8* picture) {
  FitRenderer renderer(workers);
  TILEGRAD_TRY(renderer.Render(one.target, job));
  *picture = OverGrey(renderer.images(), 0, kWhite);
  const Images& images = renderer.images();
  return TargetImages{images.width,
                      images.height,
                      {images.color.begin(), images.color.end()},
                      {images.alpha.begin(), images.alpha.end()},
                      {}};
}

// A half cosine from 1 to kFigure2FinalRate.
double RateAt(int step, int steps) {
  const double t = static_cast<double>(step) / steps;
  return kFigure2FinalRate + (1 - kFigure2FinalRate) * 0.5 * (1 + std::cos(std::numbers::pi * t));
}

FitterOptions OptionsOf(const Figure2Case& one) {
  FitterOptions options;
  options.parameters[one.parameter] = true;
  options.rates[one.parameter] = one.learning_rate;
  options.smoothing = one.smoothing;
  options.loss.region = ColorRegion::kEverywhere;
  options.loss.silhouette = SilhouetteLoss::kL1;
  return options;
}

// Steps, and the picture before the first and after the last.
Status Descend(Fitter* fitter, FitStep step, int steps, Figure2Result* result) {
  for (int i = 0; i < steps; ++i) {
    step.rate_factor = RateAt(i, steps);
    TILEGRAD_ASSIGN(const FitValues values, fitter->Step(step));
    result->losses.push_back(values.image.total);
    if (i == 0) result->start = OverGrey(fitter->images(), 0, kWhite);
  }
  TILEGRAD_ASSIGN(const FitValues last, fitter->Evaluate(step));
  result->losses.push_back(last.image.total);
  result->result = OverGrey(fitter->images(), 0, kWhite);
  return {};
}

}  // namespace

Result<Figure2Result> RunFigure2Case(const Figure2Case& one, const Figure2Options& options,
                                     const Workers& workers) {
  const auto began = std::chrono::steady_clock::now();
  Figure2Result result;
  result.label = one.label, result.what = one.what, result.model = one.model;
  FitStep step;
  step.views = kOneView, step.job = JobOf(one, options);
  TILEGRAD_ASSIGN(const TargetImages target, RenderTarget(one, step.job, workers, &result.target));
  step.targets = &target;
  TILEGRAD_ASSIGN(Fitter fitter, Fitter::Make(one.start, OptionsOf(one), workers));
  TILEGRAD_TRY(Descend(&fitter, step, options.steps, &result));
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return result;
}

Result<std::vector<Figure2Result>> RunFigure2(const Figure2Options& options, const Workers& workers,
                                              const ProgressSink& progress, const StopFlag& stop) {
  if (options.size < 8 || options.size > 2048 || options.steps < 1) {
    return InvalidArgument("size is {} (8 to 2048 pixels), steps {} (1 or more)", options.size,
                           options.steps);
  }
  const std::vector<Figure2Case> cases = Figure2Cases(options.size);
  std::vector<Figure2Result> results;
  for (const Figure2Case& one : cases) {
    if (stop) return Cancelled("stopped; nothing was written");
    if (progress) {
      progress({"optimising", results.size(), cases.size(),
                fmt::format("({}) {}, {}", one.label, one.what, one.model)});
    }
    auto result = RunFigure2Case(one, options, workers);
    if (!result.ok()) return result.status().Within(fmt::format("({})", one.label));
    results.push_back(std::move(*result));
  }
  return results;
}

}  // namespace tilegrad::train
