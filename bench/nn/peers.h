// SPDX-License-Identifier: Apache-2.0
// The libraries that the NN kernels are measured beside, one thread each. Both are optional: what
// is not installed says so by available() and is left out of the tables.
#pragma once

#include <memory>

#include "nn/kernels/conv2d/conv2d.h"
#include "nn/kernels/gemm.h"

namespace tilegrad::nn::bench {

// OpenBLAS and oneDNN (dnnl_sgemm); they compute what Gemm() does, without bias.
struct GemmPeer {
  const char* name;
  void (*run)(const GemmProblem<float>& problem);  // null: not installed
};
GemmPeer OpenBlasPeer();
GemmPeer OneDnnPeer();

enum class ConvPass { kForward, kInputGrad, kWeightGrad };

// oneDNN's convolution at its best: tensors in the layouts that it prefers, so that no reordering
// is counted.
class OneDnnConv {
 public:
  OneDnnConv(const Conv2dShape& shape, ConvPass pass);
  ~OneDnnConv();
  static bool available();
  void Run();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad::nn::bench
