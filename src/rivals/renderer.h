// SPDX-License-Identifier: Apache-2.0
// Batches of images by the rivals of the paper's section 5.1, for training: meshes and cameras in,
// alpha and colours out, and their gradients back.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "rivals/batch.h"
#include "tilegrad/status.h"

namespace tilegrad::rivals {

template <class T>
class ImageStateT;

// float: the fast code. double: SoftRas by its scalar reference, for proofs. One call at a time;
// memory grows to the largest batch and is reused. The same bits for any number of workers.
template <class T>
class RendererT {
 public:
  explicit RendererT(const Workers& workers);
  ~RendererT();

  // Errors: arrays that do not fit together, an index out of range, options out of range.
  Status Render(const BatchT<T>& batch, const Options& options, const ImagesT<T>& out);
  // Of the last Render, with the same batch and options, whose arrays are unchanged. Overwrites
  // `out`, each the sum over the mesh's views in their order.
  Status Backward(const BatchT<T>& batch, const Options& options, const ImagesT<const T>& d_images,
                  const GradientsT<T>& out);

 private:
  const Workers& workers_;
  std::vector<ImageStateT<T>> images_;
};
using Renderer = RendererT<float>;

extern template class RendererT<float>;
extern template class RendererT<double>;

}  // namespace tilegrad::rivals
