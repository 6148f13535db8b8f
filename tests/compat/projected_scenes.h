// SPDX-License-Identifier: Apache-2.0
// Batches of projected faces for tests.
#pragma once

#include <cstdint>
#include <vector>

#include "base/rng.h"
#include "compat/projected_batch.h"

namespace tilegrad::compat::test {

template <class T>
struct ProjectedFacesOwner {
  std::size_t images = 0, faces = 0, channels = 0;
  std::vector<T> xy, z, features;
  std::vector<std::uint8_t> valid;

  ProjectedBatchT<T> View() const { return {images, faces, xy, z, valid}; }
};

template <class T, class U>
ProjectedFacesOwner<T> Cast(const ProjectedFacesOwner<U>& from) {
  return {from.images,
          from.faces,
          from.channels,
          {from.xy.begin(), from.xy.end()},
          {from.z.begin(), from.z.end()},
          {from.features.begin(), from.features.end()},
          from.valid};
}

// Independent triangles of about `size` around the image; one in five is not valid.
inline ProjectedFacesOwner<float> RandomFaces(std::size_t images, std::size_t faces,
                                              std::size_t channels, double size, Rng* rng) {
  ProjectedFacesOwner<float> out;
  out.images = images;
  out.faces = faces;
  out.channels = channels;
  for (std::size_t f = 0; f < images * faces; ++f) {
    const double x = rng->Uniform(-1.2, 1.2), y = rng->Uniform(-1.2, 1.2);
    for (int k = 0; k < 3; ++k) {
      out.xy.push_back(static_cast<float>(x + rng->Uniform(-size, size)));
      out.xy.push_back(static_cast<float>(y + rng->Uniform(-size, size)));
      out.z.push_back(static_cast<float>(rng->Uniform(-3, -1)));
      for (std::size_t c = 0; c < channels; ++c) {
        out.features.push_back(static_cast<float>(rng->Uniform(-1, 1)));
      }
    }
    out.valid.push_back(rng->Uniform() < 0.8 ? 1 : 0);
  }
  return out;
}

}  // namespace tilegrad::compat::test
