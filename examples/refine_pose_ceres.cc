// SPDX-License-Identifier: Apache-2.0
// Pose refinement with an optimiser that is not ours: Ceres asks for a cost and its gradient, which
// are one Render and one Backward. The line search of L-BFGS relies on what tilegrad promises: the
// same input gives the same bits.
#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>

#include <algorithm>

#include "fit.h"

namespace {

constexpr int kSize = 64, kNumbers = 9;  // of rotation and translation
using Numbers = double[kNumbers];

void NumbersOf(const tilegrad::CameraParameters& p, double* out) {
  std::copy_n(p.rotation, 6, out);
  std::copy_n(p.translation, 3, out + 6);
}

class PoseCost : public ceres::FirstOrderFunction {
 public:
  PoseCost(const fit::Box& box, const tilegrad::Camera& truth) : box_(box), lens_(truth) {
    fit::Check(Render(truth));
    color_.assign(frame_.images().color.begin(), frame_.images().color.end());
    alpha_.assign(frame_.images().alpha.begin(), frame_.images().alpha.end());
  }

  int NumParameters() const override { return kNumbers; }

  bool Evaluate(const double* x, double* cost, double* gradient) const override {
    tilegrad::CameraParameters parameters = tilegrad::ParametersOf(lens_);
    std::copy_n(x, 6, parameters.rotation);
    std::copy_n(x + 6, 3, parameters.translation);
    const auto camera = tilegrad::CameraFromParameters(parameters);
    if (!camera.ok() || !Render(*camera).ok()) return false;  // Ceres tries a shorter step
    *cost = static_cast<double>(fit::Difference(frame_.images().color, color_, &d_color_) +
                                fit::Difference(frame_.images().alpha, alpha_, &d_alpha_));
    if (gradient == nullptr) return true;
    tilegrad::Camera d_camera;
    const tilegrad::SceneGradients d_scene{.camera = &d_camera};
    const auto status =
        renderer_.Backward(frame_, {.color = d_color_, .alpha = d_alpha_}, {&d_scene, 1});
    NumbersOf(tilegrad::PullBack(parameters, d_camera), gradient);
    return status.ok();
  }

 private:
  tilegrad::Status Render(const tilegrad::Camera& camera) const {
    const tilegrad::Scene scene{.positions = box_.positions,
                                .faces = box_.faces,
                                .camera = camera,
                                .colors = {box_.colors}};
    return renderer_.Render({&scene, 1}, {.width = kSize, .height = kSize, .delta = 1e-2}, {},
                            &frame_);
  }

  const fit::Box& box_;
  tilegrad::Camera lens_;  // whose focal lengths and principal point hold
  std::vector<float> color_, alpha_;
  mutable std::vector<float> d_color_, d_alpha_;  // scratch: Evaluate is const in Ceres
  mutable tilegrad::Renderer renderer_;
  mutable tilegrad::Frame frame_;
};

}  // namespace

int main() {
  const fit::Box box;
  const tilegrad::Lens lens{.width = kSize, .height = kSize};
  const auto truth =
      fit::Check(tilegrad::MakeCamera(lens, {.azimuth = 40, .elevation = 25, .distance = 2}));
  const auto start =
      fit::Check(tilegrad::MakeCamera(lens, {.azimuth = 48, .elevation = 20, .distance = 2.1}));
  Numbers x;
  NumbersOf(tilegrad::ParametersOf(start), x);

  ceres::GradientProblem problem(new PoseCost(box, truth));
  ceres::GradientProblemSolver::Options options;
  options.max_num_iterations = 100;
  options.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  ceres::Solve(options, problem, x, &summary);
  std::printf("%s\n", summary.BriefReport().c_str());

  Numbers expected;
  NumbersOf(tilegrad::ParametersOf(truth), expected);
  double distance = 0;
  for (int i = 6; i < kNumbers; ++i) distance = std::max(distance, std::abs(x[i] - expected[i]));
  std::printf("translation is at most %.4f off\n", distance);
  return distance < 0.02 && summary.final_cost < 1e-4 ? 0 : 1;
}
