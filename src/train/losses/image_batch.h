// SPDX-License-Identifier: Apache-2.0
// What the image losses share: a batch of images as the network's tensors hold them.
#pragma once

#include <cstddef>
#include <span>

namespace tilegrad::train {

// N images of `pixels` numbers each (all channels together), contiguous.
template <class T>
struct ImagePair {
  std::span<const T> truth, predicted;  // [N * pixels] each
  std::size_t images = 0;

  std::size_t pixels() const { return images == 0 ? 0 : truth.size() / images; }
  std::span<const T> Truth(std::size_t i) const { return truth.subspan(i * pixels(), pixels()); }
  std::span<const T> Predicted(std::size_t i) const {
    return predicted.subspan(i * pixels(), pixels());
  }
};

}  // namespace tilegrad::train
