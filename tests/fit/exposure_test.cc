// SPDX-License-Identifier: Apache-2.0
// Exposures of views and the focal length: gradients against differences, and whole recoveries.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fit/views_fixture.h"

namespace tilegrad::train::exposure_test {

class Exposure : public ViewsTest {
 protected:
  // Starts from the true shape.
  FitJob Job() {
    FitJob job;
    job.input = Views(ColoredBox({0.6f, 0.5f, 0.3f, 1}), {.views = 8, .held_out = 2, .size = 64});
    job.start = Truth();
    job.out = folder_ / "run";
    job.config.timelapse = 0;
    job.config.levels = 1;
    job.config.views_per_step = 8;
    return job;
  }
  // Loss and gradients of a parameter on all views.
  struct Evaluation {
    double total = 0;
    std::vector<float> gradient;  // of its blocks, one after another
  };
  Evaluation Evaluate(const FitScene& scene, const FitJob& job, Parameter p) {
    FitterOptions options;
    options.parameters[p] = true;
    auto fitter = Ok(Fitter::Make(scene, options, workers_));
    FitStep step;
    std::vector<int> views(job.input.training);
    step.views = views;
    step.targets = &job.input.images;
    step.job.options.width = step.job.options.height = 64;
    step.job.options.delta = 1e-3;
    step.job.options.max_alpha_error = 1e-6;
    Evaluation out;
    out.total = Ok((*fitter)->Evaluate(step))->loss;
    for (const FittedBlock& block : (*fitter)->blocks()) {
      const auto gradient = block.gradient.value().span<float>();
      out.gradient.insert(out.gradient.end(), gradient.begin(), gradient.end());
    }
    return out;
  }
  // Images that show the start itself, with these exposures.
  void Photograph(const FitScene& scene, std::span<const double> gains, FitInput* input) {
    FitRenderer renderer(workers_);
    std::vector<int> views(scene.cameras.size());
    std::iota(views.begin(), views.end(), 0);
    FitRenderer::Job job;
    job.views = views;
    job.alpha = false;
    job.options.width = job.options.height = 64;
    ASSERT_TRUE(renderer.Render(scene, job).ok());
    std::ranges::copy(renderer.images().color, input->images.color.begin());
    const std::size_t size = 3 * input->images.pixels();
    for (std::size_t i = 0; i < input->images.color.size(); ++i) {
      input->images.color[i] *= static_cast<float>(gains[i / size]);
    }
  }

  Workers workers_{2};
};

// L1 is linear in a gain between the points where a pixel's difference changes its sign; a gain
// that is off by a third has no such point near.
TEST_F(Exposure, GradientsAreThoseOfDifferences) {
  FitJob job = Job();
  job.config.parameters[Parameter::kExposure] = true;
  const auto start = Ok(PrepareFit(job, workers_));
  FitScene scene = start->scene;
  ASSERT_EQ(scene.gains.size(), 10u);
  for (std::size_t i = 0; i < scene.gains.size(); ++i) scene.gains[i] = i % 2 == 0 ? 1.3f : 0.7f;
  const Evaluation at = Evaluate(scene, job, Parameter::kExposure);
  ASSERT_EQ(at.gradient.size(), 9u);  // that of view 0, the reference, is none
  constexpr float kStep = 2e-2f;
  for (std::size_t v = 1; v < 10; ++v) {
    if (std::ranges::find(job.input.training, static_cast<int>(v)) == job.input.training.end()) {
      EXPECT_EQ(at.gradient[v - 1], 0) << v;
      continue;
    }
    FitScene more = scene, less = scene;
    more.gains[v] *= std::exp(kStep);
    less.gains[v] *= std::exp(-kStep);
    const double difference = (Evaluate(more, job, Parameter::kExposure).total -
                               Evaluate(less, job, Parameter::kExposure).total) /
                              (2 * static_cast<double>(kStep));
    EXPECT_NEAR(at.gradient[v - 1], difference, 0.02 * std::abs(difference) + 1e-6) << v;
  }
}

TEST_F(Exposure, FocalGradientIsThatOfDifferences) {
  const FitJob job = Job();
  const auto start = Ok(PrepareFit(job, workers_));
  FitScene scene = start->scene;
  const auto scaled = [&](double by) {
    FitScene out = scene;
    for (Camera& c : out.cameras) {
      c.fx *= static_cast<float>(std::exp(by));
      c.fy *= static_cast<float>(std::exp(by));
    }
    return out;
  };
  scene = scaled(0.1);  // wrong, so that there is something to gain
  const Evaluation at = Evaluate(scene, job, Parameter::kFocal);
  ASSERT_EQ(at.gradient.size(), 1u);
  const double step = 2e-3;
  const double difference = (Evaluate(scaled(step), job, Parameter::kFocal).total -
                             Evaluate(scaled(-step), job, Parameter::kFocal).total) /
                            (2 * step);
  // Pixels that change hands at inner edges have no gradient: colours are a small part here.
  EXPECT_NEAR(at.gradient[0], difference, 0.05 * std::abs(difference));
  EXPECT_GT(at.gradient[0], 0);  // lenses are too long
}

TEST_F(Exposure, GainsAreRecovered) {
  FitJob job = Job();
  const double gains[10] = {0.9, 1.2, 0.7, 1.0, 1.3, 0.8, 1.1, 0.6, 0.95, 1.15};
  job.config.parameters[Parameter::kColors] = job.config.parameters[Parameter::kExposure] = true;
  const auto start = Ok(PrepareFit(job, workers_));
  Photograph(start->scene, gains, &job.input);
  SetColor(*job.start, {0.5f, 0.5f, 0.5f, 1});  // to be found, too
  job.config.steps = 300;
  Ok(Run(job).status());
  const auto text = Ok(ReadText(job.out / "transforms_fitted.json"));
  // Relative to the reference, whose gain is not written: it is 1.
  std::size_t at = 0, found = 0;
  for (const int view : job.input.training) {
    if (view == job.input.training.front()) continue;
    at = text->find("\"exposure_gain\": ", at);
    ASSERT_NE(at, std::string::npos);
    at += 17;
    const double wanted = gains[view] / gains[job.input.training.front()];
    EXPECT_NEAR(std::stod(text->substr(at)), wanted, 0.03 * wanted) << view;
    ++found;
  }
  EXPECT_EQ(found, 7u);
}

TEST_F(Exposure, TheFocalLengthIsRecovered) {
  FitJob job = Job();
  const float truth = job.input.cameras[0].fx;
  for (Camera& c : job.input.cameras) {
    c.fx *= 1.15f;
    c.fy *= 1.15f;
  }
  job.config.parameters[Parameter::kFocal] = true;
  job.config.steps = 200;
  job.config.rates[Parameter::kFocal] = 0.005;
  Ok(Run(job).status());
  const auto text = Ok(ReadText(job.out / "transforms_fitted.json"));
  const std::size_t at = text->find("\"fl_x\": ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_NEAR(std::stod(text->substr(at + 8)), static_cast<double>(truth),
              0.02 * static_cast<double>(truth));
}

// One image has no other to be brighter than.
TEST_F(Exposure, OneViewHasNone) {
  FitJob job = Job();
  FitScene scene = PrepareFit(job, workers_)->scene;
  scene.gains = {1};
  FitterOptions options;
  options.parameters[Parameter::kExposure] = true;
  EXPECT_FALSE(Fitter::Make(scene, options, workers_).ok());
}

}  // namespace tilegrad::train::exposure_test
