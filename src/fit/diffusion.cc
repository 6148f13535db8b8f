// SPDX-License-Identifier: Apache-2.0
#include "fit/diffusion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tilegrad::train {
namespace {

constexpr double kTolerance = 1e-5;

double Dot(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  }
  return sum;
}

// y += factor x
void AddScaled(double factor, const std::vector<float>& x, std::vector<float>* y) {
  const auto f = static_cast<float>(factor);
  for (std::size_t i = 0; i < x.size(); ++i) (*y)[i] += f * x[i];
}

}  // namespace

Diffusion::Diffusion(const Topology& topology, double lambda)
    : topology_(&topology), lambda_(static_cast<float>(lambda)) {
  const std::size_t size = 3 * (topology.offsets.size() - 1);
  for (auto* array : {&solution_, &residual_, &direction_, &image_}) array->resize(size);
}

void Diffusion::Multiply(const std::vector<float>& x, std::vector<float>* y) const {
  const Topology& t = *topology_;
  for (std::size_t v = 0; v + 1 < t.offsets.size(); ++v) {
    float sum[3] = {};
    for (std::int32_t n = t.offsets[v]; n < t.offsets[v + 1]; ++n) {
      const float* from =
          &x[3 * static_cast<std::size_t>(t.neighbors[static_cast<std::size_t>(n)])];
      for (std::size_t c = 0; c < 3; ++c) sum[c] += from[c];
    }
    const auto degree = static_cast<float>(t.offsets[v + 1] - t.offsets[v]);
    for (std::size_t c = 0; c < 3; ++c) {
      const float own = x[3 * v + c];
      (*y)[3 * v + c] = own + lambda_ * (degree * own - sum[c]);
    }
  }
}

void Diffusion::Apply(std::span<float> x) {
  if (lambda_ == 0) return;
  std::fill(solution_.begin(), solution_.end(), 0.0f);
  residual_.assign(x.begin(), x.end());
  direction_ = residual_;
  double square = Dot(residual_, residual_);
  const double enough = kTolerance * kTolerance * square;
  for (int i = 0; i < kMostIterations && square > enough; ++i) {
    Multiply(direction_, &image_);
    const double length = square / Dot(direction_, image_);
    AddScaled(length, direction_, &solution_);
    AddScaled(-length, image_, &residual_);
    const double next = Dot(residual_, residual_);
    const auto keep = static_cast<float>(next / square);
    for (std::size_t k = 0; k < direction_.size(); ++k) {
      direction_[k] = residual_[k] + keep * direction_[k];
    }
    square = next;
  }
  std::copy(solution_.begin(), solution_.end(), x.begin());
}

void UniformAdamStep(const UniformAdam& adam, Diffusion* smooth, std::span<float> gradient,
                     std::span<float> m, std::span<float> v, std::span<float> values) {
  smooth->Apply(gradient);
  const auto b1 = static_cast<float>(adam.beta1), b2 = static_cast<float>(adam.beta2);
  float largest = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    m[i] = b1 * m[i] + (1 - b1) * gradient[i];
    v[i] = b2 * v[i] + (1 - b2) * gradient[i] * gradient[i];
    largest = std::max(largest, v[i]);
  }
  const auto t = static_cast<double>(adam.step);
  const double root = std::sqrt(static_cast<double>(largest) / (1 - std::pow(adam.beta2, t)));
  if (!(root > 0)) return;
  const auto factor = static_cast<float>(adam.rate / ((1 - std::pow(adam.beta1, t)) * root));
  for (std::size_t i = 0; i < gradient.size(); ++i) gradient[i] = factor * m[i];
  smooth->Apply(gradient);
  for (std::size_t i = 0; i < gradient.size(); ++i) values[i] -= gradient[i];
}

}  // namespace tilegrad::train
