// SPDX-License-Identifier: Apache-2.0
// What the fitting examples have in common: a coloured box, Adam, and a way out for errors.
#pragma once

#include <tilegrad/tilegrad.h>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <vector>

namespace fit {

inline void Check(const tilegrad::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.message().c_str());
  std::exit(1);
}

template <class T>
T Check(tilegrad::Result<T> result) {
  Check(result.status());
  return *result;
}

// A box of 1 x 0.8 x 0.6 around the origin; every corner has a colour of its own.
struct Box {
  std::vector<float> positions, colors;
  std::vector<int> faces = {0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                            2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6};

  Box() {
    for (int v = 0; v < 8; ++v) {
      const bool x = (v & 4) != 0, y = (v & 2) != 0, z = (v & 1) != 0;
      positions.insert(positions.end(), {x ? 0.5f : -0.5f, y ? 0.4f : -0.4f, z ? 0.3f : -0.3f});
      colors.insert(colors.end(), {x ? 0.9f : 0.1f, y ? 0.8f : 0.2f, z ? 0.7f : 0.1f});
    }
  }
};

// Half the mean square difference; d_image is its gradient.
inline float Difference(std::span<const float> image, std::span<const float> target,
                        std::vector<float>* d_image) {
  const float scale = 1.0f / static_cast<float>(image.size());
  d_image->resize(image.size());
  double loss = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const float difference = image[i] - target[i];
    loss += 0.5 * static_cast<double>(scale * difference * difference);
    (*d_image)[i] = scale * difference;
  }
  return static_cast<float>(loss);
}

// D. Kingma, J. Ba: Adam, 2015.
class Adam {
 public:
  explicit Adam(float rate) : rate_(rate) {}

  void Step(std::span<float> x, std::span<const float> d_x) {
    m_.resize(x.size());
    v_.resize(x.size());
    ++steps_;
    const float m_scale = 1 / (1 - std::pow(0.9f, steps_));
    const float v_scale = 1 / (1 - std::pow(0.99f, steps_));
    for (std::size_t i = 0; i < x.size(); ++i) {
      m_[i] = 0.9f * m_[i] + 0.1f * d_x[i];
      v_[i] = 0.99f * v_[i] + 0.01f * d_x[i] * d_x[i];
      x[i] -= rate_ * m_[i] * m_scale / (std::sqrt(v_[i] * v_scale) + 1e-12f);
    }
  }
  void SetRate(float rate) { rate_ = rate; }

 private:
  float rate_, steps_ = 0;
  std::vector<float> m_, v_;
};

}  // namespace fit
