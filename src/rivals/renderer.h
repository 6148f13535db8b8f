// SPDX-License-Identifier: Apache-2.0
// Batches of silhouettes by the rivals of the paper's section 5.1, for training: meshes and cameras
// in, alpha out, and its gradient to positions back.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "rivals/n3mr_options.h"
#include "rivals/softras.h"
#include "tilegrad/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::rivals {

enum class Rule { kSoftRas, kN3mr };

struct Options {
  Rule rule = Rule::kSoftRas;
  SoftRasOptions softras = {};
  N3mrOptions n3mr = {};
};

// InvalidArgument names the first number out of its range.
Status Validate(const Options& options);

// Images of meshes that have the same faces; mesh b is seen by cameras [b * views, (b + 1) *
// views).
template <class T>
struct BatchT {
  std::span<const T> positions;         // [B,V,3] world
  std::span<const std::int32_t> faces;  // [F,3] indices in [0, V)
  std::span<const CameraT<T>> cameras;  // [N], N = B * views
  std::size_t meshes = 0;               // B
  int size = 0;                         // pixels a side of the images, which are square

  std::size_t vertices() const { return meshes == 0 ? 0 : positions.size() / (3 * meshes); }
  std::size_t views() const { return meshes == 0 ? 0 : cameras.size() / meshes; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  }
};

// float: the fast code. double: SoftRas by its scalar reference, for proofs. One call at a time;
// memory grows to the largest batch and is reused. The same bits for any number of workers.
template <class T>
class RendererT {
 public:
  explicit RendererT(const Workers& workers);
  ~RendererT();

  // alpha: [N,size,size]. Errors: arrays that do not fit together, an index out of range, options
  // out of range.
  Status Render(const BatchT<T>& batch, const Options& options, std::span<T> alpha);
  // Of the last Render, with the same batch and options, whose arrays are unchanged. Overwrites
  // d_positions [B,V,3], each the sum over the mesh's views in their order.
  Status Backward(const BatchT<T>& batch, const Options& options, std::span<const T> d_alpha,
                  std::span<T> d_positions);

 private:
  struct Image;
  const Workers& workers_;
  std::vector<Image> images_;
};
using Renderer = RendererT<float>;

extern template class RendererT<float>;
extern template class RendererT<double>;

}  // namespace tilegrad::rivals
