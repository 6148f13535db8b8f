// SPDX-License-Identifier: Apache-2.0
#include "scene/level_set.h"

#include <algorithm>
#include <cstdint>
#include <unordered_map>

namespace tilegrad {
namespace {

constexpr float kNearest = 0.05f;  // of an edge, from its ends

using Corner = std::array<int, 3>;

// The orders in which a tetrahedron's path follows the axes from a cell's low corner to its high
// one; the first three are even permutations.
constexpr std::array<std::array<std::size_t, 3>, 6> kPaths = {
    {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}}};

class Extraction {
 public:
  explicit Extraction(const ScalarGrid& grid) : grid_(grid) {}

  Mesh Run() {
    for (int i = 0; i + 1 < grid_.size[0]; ++i) {
      for (int j = 0; j + 1 < grid_.size[1]; ++j) {
        for (int k = 0; k + 1 < grid_.size[2]; ++k) {
          if (IsMixed(i, j, k)) AddCell({i, j, k});
        }
      }
    }
    return std::move(mesh_);
  }

 private:
  bool IsInside(const Corner& at) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (at[a] == 0 || at[a] + 1 == grid_.size[a]) return false;
    return grid_.values[grid_.At(at[0], at[1], at[2])] > 0;
  }

  bool IsMixed(int i, int j, int k) const {
    const bool first = IsInside({i, j, k});
    for (int c = 1; c < 8; ++c)
      if (IsInside({i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)}) != first) return true;
    return false;
  }

  void AddCell(const Corner& low) {
    for (std::size_t p = 0; p < kPaths.size(); ++p) {
      std::array<Corner, 4> corners;
      corners.fill(low);
      for (std::size_t step = 0; step < 3; ++step)
        for (std::size_t c = step + 1; c < 4; ++c) ++corners[c][kPaths[p][step]];
      if (p >= 3) std::swap(corners[2], corners[3]);  // so that all have the same orientation
      AddTetrahedron(corners);
    }
  }

  // Corners are right-handed. An even permutation puts those inside first.
  void AddTetrahedron(std::array<Corner, 4> c) {
    std::array<bool, 4> inside;
    for (std::size_t i = 0; i < 4; ++i) inside[i] = IsInside(c[i]);
    const auto count = std::count(inside.begin(), inside.end(), true);
    bool odd = false;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      std::size_t from = i;
      while (!inside[from]) ++from;
      if (from == i) continue;
      std::swap(c[i], c[from]);
      std::swap(inside[i], inside[from]);
      odd = !odd;
    }
    if (odd && count == 1) std::swap(c[2], c[3]);
    if (odd && count != 1) std::swap(c[0], c[1]);
    if (count == 1) AddFace(Between(c[0], c[1]), Between(c[0], c[2]), Between(c[0], c[3]));
    if (count == 3) AddFace(Between(c[0], c[3]), Between(c[1], c[3]), Between(c[2], c[3]));
    if (count != 2) return;
    const std::int32_t a = Between(c[0], c[2]), b = Between(c[0], c[3]), d = Between(c[1], c[3]);
    AddFace(a, b, d);
    AddFace(a, d, Between(c[1], c[2]));
  }

  void AddFace(std::int32_t a, std::int32_t b, std::int32_t c) { mesh_.faces.push_back({a, b, c}); }

  // The vertex on an edge, created once: keyed by the lower end and the direction.
  std::int32_t Between(const Corner& in, const Corner& out) {
    std::uint64_t direction = 0;
    Corner low;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(in[a], out[a]);
      direction |= static_cast<std::uint64_t>(in[a] != out[a]) << a;
    }
    const std::uint64_t key = grid_.At(low[0], low[1], low[2]) * 8 + direction;
    const auto [at, added] =
        vertices_.try_emplace(key, static_cast<std::int32_t>(mesh_.positions.size()));
    if (added) mesh_.positions.push_back(Crossing(in, out));
    return at->second;
  }

  glm::vec3 Crossing(const Corner& in, const Corner& out) const {
    const float a = grid_.values[grid_.At(in[0], in[1], in[2])];
    // Values on the border may be inside, which is not allowed.
    const float b = std::min(0.0f, grid_.values[grid_.At(out[0], out[1], out[2])]);
    const float t = std::clamp(a / (a - b), kNearest, 1 - kNearest);
    const glm::vec3 from(in[0], in[1], in[2]), to(out[0], out[1], out[2]);
    return grid_.low + grid_.cell * (from + t * (to - from));
  }

  const ScalarGrid& grid_;
  Mesh mesh_;
  std::unordered_map<std::uint64_t, std::int32_t> vertices_;
};

}  // namespace

Mesh LevelSet(const ScalarGrid& grid) { return Extraction(grid).Run(); }

}  // namespace tilegrad
