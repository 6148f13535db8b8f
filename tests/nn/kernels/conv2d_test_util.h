// SPDX-License-Identifier: Apache-2.0
// What the tests of the convolutions share: random operands, all three results, and the
// reference's.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/conv2d/conv2d_ref.h"
#include "nn/kernels/kernel_test_util.h"

namespace tilegrad::nn {

inline std::string Describe(const Conv2dShape& s) {
  const auto pair = [](std::size_t a, std::size_t b) {
    return std::to_string(a) + "x" + std::to_string(b);
  };
  return "batch " + std::to_string(s.batch) + ", channels " + pair(s.in_channels, s.out_channels) +
         ", image " + pair(s.in_height, s.in_width) + ", kernel " +
         pair(s.kernel_height, s.kernel_width) + ", stride " + std::to_string(s.stride) +
         ", padding " + std::to_string(s.padding);
}

struct Operands {
  std::vector<float> x, weight, bias, d_y;
};

inline Operands RandomOperands(const Conv2dShape& s, std::uint64_t seed) {
  Rng rng(seed);
  return {RandomFloats(rng, s.in_size()), RandomFloats(rng, s.weight_size()),
          RandomFloats(rng, s.out_channels), RandomFloats(rng, s.out_size())};
}

struct Results {
  std::vector<float> y, d_x, d_weight;
  bool operator==(const Results&) const = default;
};

struct RunOptions {
  int workers = 1;
  bool bias = true;
  bool winograd = false;
};

inline Results RunConv2d(const Conv2dShape& s, const Operands& o, const RunOptions& options) {
  const Workers workers(options.workers);
  KernelScratch scratch;
  const KernelContext context{workers, scratch, options.winograd};
  const float poison = std::numeric_limits<float>::quiet_NaN();  // all of it must be overwritten
  Results r{std::vector<float>(s.out_size(), poison), std::vector<float>(s.in_size(), poison),
            std::vector<float>(s.weight_size(), poison)};
  Conv2dForward(s, o.x.data(), o.weight.data(), options.bias ? o.bias.data() : nullptr, r.y.data(),
                context);
  Conv2dInputGrad(s, o.d_y.data(), o.weight.data(), r.d_x.data(), context);
  Conv2dWeightGrad(s, o.x.data(), o.d_y.data(), r.d_weight.data(), context);
  return r;
}

struct ReferenceResults {
  std::vector<double> y, d_x, d_weight;
};

inline ReferenceResults RunReference(const Conv2dShape& s, const Operands& o,
                                     std::vector<double> (*convert)(const std::vector<float>&)) {
  const std::vector<double> x = convert(o.x), weight = convert(o.weight), bias = convert(o.bias),
                            d_y = convert(o.d_y);
  ReferenceResults r{std::vector<double>(s.out_size()), std::vector<double>(s.in_size()),
                     std::vector<double>(s.weight_size())};
  Conv2dForwardRef(s, x.data(), weight.data(), bias.data(), r.y.data());
  Conv2dInputGradRef(s, d_y.data(), weight.data(), r.d_x.data());
  Conv2dWeightGradRef(s, x.data(), d_y.data(), r.d_weight.data());
  return r;
}

}  // namespace tilegrad::nn
