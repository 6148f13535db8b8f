// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/cell_distance.h"

#include <algorithm>
#include <cmath>

namespace tilegrad::train {
namespace {

// A line of the grid: every `stride`-th number from `first`.
struct Line {
  std::size_t first, stride;
  int count;
};

// The lower envelope of parabolas, each with its vertex at a cell of the line.
class Envelope {
 public:
  explicit Envelope(int most) : heights_(Size(most)), vertices_(Size(most)), from_(Size(most)) {}

  // Squared distances along one more axis. The line's ends have an empty cell beyond them.
  void Lower(const Line& line, std::vector<float>* squares) {
    Build(line, *squares);
    std::size_t k = 0;
    for (int i = 0; i < line.count; ++i) {
      const auto x = static_cast<float>(i + 1);
      while (k + 1 < count_ && from_[k + 1] <= x) ++k;
      const float d = x - vertices_[k];
      (*squares)[line.first + static_cast<std::size_t>(i) * line.stride] = d * d + heights_[k];
    }
  }

 private:
  static std::size_t Size(int most) { return static_cast<std::size_t>(most) + 2; }

  void Build(const Line& line, const std::vector<float>& squares) {
    count_ = 0;
    Push(0, 0);
    for (int i = 0; i < line.count; ++i)
      Push(static_cast<float>(i + 1),
           squares[line.first + static_cast<std::size_t>(i) * line.stride]);
    Push(static_cast<float>(line.count + 1), 0);
  }

  void Push(float vertex, float height) {
    while (count_ > 0 && Crossing(vertex, height) <= from_[count_ - 1]) --count_;
    from_[count_] = count_ > 0 ? Crossing(vertex, height) : -HUGE_VALF;
    vertices_[count_] = vertex;
    heights_[count_] = height;
    ++count_;
  }

  // Where the new parabola goes below the last one.
  float Crossing(float vertex, float height) const {
    const float v = vertices_[count_ - 1], h = heights_[count_ - 1];
    return (height + vertex * vertex - h - v * v) / (2 * (vertex - v));
  }

  std::vector<float> heights_, vertices_, from_;
  std::size_t count_ = 0;
};

std::size_t CountOf(const std::array<int, 3>& size, std::size_t axis) {
  return static_cast<std::size_t>(size[axis]);
}

}  // namespace

std::vector<float> DistanceToEmpty(const std::vector<std::uint8_t>& full,
                                   const std::array<int, 3>& size, const Workers& workers) {
  constexpr float kFar = 1e9f;  // squared; whole numbers above 2^24 lose digits, the far ones only
  std::vector<float> squares(full.size());
  std::ranges::transform(full, squares.begin(), [](std::uint8_t f) { return f ? kFar : 0.0f; });
  const std::array<std::size_t, 3> strides = {CountOf(size, 1) * CountOf(size, 2), CountOf(size, 2),
                                              1};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    workers.For(CountOf(size, u), [&](std::size_t i, std::size_t) {
      Envelope envelope(size[axis]);
      for (std::size_t j = 0; j < CountOf(size, v); ++j)
        envelope.Lower({i * strides[u] + j * strides[v], strides[axis], size[axis]}, &squares);
    });
  }
  for (float& s : squares) s = std::sqrt(s);
  return squares;
}

}  // namespace tilegrad::train
