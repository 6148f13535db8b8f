// SPDX-License-Identifier: Apache-2.0
// Scalar reference of batch_norm.h. T: float, double or std::complex<double>.
#pragma once

#include <cmath>

#include "nn/kernels/batch_norm.h"
#include "nn/kernels/pointwise_ref.h"

namespace tilegrad::nn {

// Calls visit(index) for the elements of channel c, in memory order.
template <class Visit>
void ForEachOfChannel(const BatchNormShape& s, std::size_t c, const Visit& visit) {
  for (std::size_t n = 0; n < s.batch; ++n) {
    const std::size_t begin = (n * s.channels + c) * s.pixels;
    for (std::size_t i = begin; i < begin + s.pixels; ++i) visit(i);
  }
}

// y = scale x + shift of one channel.
template <class T>
struct ChannelMap {
  T scale, shift, inverse_deviation;
};
template <class T>
ChannelMap<T> MapOfChannel(const BatchNormParameters<T>& p, std::size_t c, T mean, T variance) {
  const T inverse = T(1) / std::sqrt(variance + static_cast<T>(p.epsilon));
  const T scale = p.gamma[c] * inverse;
  return {scale, p.beta[c] - mean * scale, inverse};
}

template <class T>
void BatchNormForwardRef(const BatchNormForwardProblem<T>& problem, std::size_t c) {
  const BatchNormShape& s = problem.shape;
  const T count = static_cast<T>(static_cast<double>(s.count()));
  T sum{}, squares{};
  ForEachOfChannel(s, c, [&](std::size_t i) { sum += problem.x[i]; });
  const T mean = sum / count;
  ForEachOfChannel(
      s, c, [&](std::size_t i) { squares += (problem.x[i] - mean) * (problem.x[i] - mean); });
  problem.mean[c] = mean;
  problem.variance[c] = squares / count;
  const auto map = MapOfChannel(problem.parameters, c, mean, problem.variance[c]);
  ForEachOfChannel(s, c, [&](std::size_t i) {
    const T y = map.scale * problem.x[i] + map.shift;
    problem.y[i] = problem.parameters.relu && RealPart(y) <= 0 ? T{} : y;
  });
}

template <class T>
void BatchNormBackwardRef(const BatchNormBackwardProblem<T>& problem, std::size_t c) {
  const BatchNormShape& s = problem.shape;
  const T mean = problem.mean[c], count = static_cast<T>(static_cast<double>(s.count()));
  const auto map = MapOfChannel(problem.parameters, c, mean, problem.variance[c]);
  const auto masked = [&](std::size_t i) {
    const bool passes =
        !problem.parameters.relu || RealPart(map.scale * problem.x[i] + map.shift) > 0;
    return passes ? problem.d_y[i] : T{};
  };
  T d_gamma{}, d_beta{};
  ForEachOfChannel(s, c, [&](std::size_t i) {
    d_gamma += masked(i) * ((problem.x[i] - mean) * map.inverse_deviation);
    d_beta += masked(i);
  });
  ForEachOfChannel(s, c, [&](std::size_t i) {
    const T h = (problem.x[i] - mean) * map.inverse_deviation;
    problem.d_x[i] = map.scale * (masked(i) - d_beta / count - h * (d_gamma / count));
  });
  problem.d_gamma[c] = d_gamma;
  problem.d_beta[c] = d_beta;
}

}  // namespace tilegrad::nn
