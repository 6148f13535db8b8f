// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/edge_rings.h"

#include <algorithm>

namespace tilegrad::compat::nvdiffrast {
namespace {

// Vertices of an edge, the lower one first, and one of its sides. Sorting brings those of one edge
// together.
struct Side {
  std::uint64_t edge;
  std::int32_t side;
  bool operator<(const Side& other) const {
    return edge != other.edge ? edge < other.edge : side < other.side;
  }
};

std::vector<Side> SortedSides(FaceList faces) {
  std::vector<Side> sides(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const std::size_t next = i % 3 == 2 ? i - 2 : i + 1;
    const auto [a, b] = std::minmax(faces[i], faces[next]);
    sides[i] = {static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint64_t>(b),
                static_cast<std::int32_t>(i)};
  }
  std::sort(sides.begin(), sides.end());
  return sides;
}

}  // namespace

EdgeRings BuildEdgeRings(FaceList faces) {
  const std::vector<Side> sides = SortedSides(faces);
  EdgeRings out;
  out.next.resize(sides.size());
  for (std::size_t begin = 0, end; begin < sides.size(); begin = end) {
    for (end = begin + 1; end < sides.size() && sides[end].edge == sides[begin].edge;) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      const Side& next = sides[i + 1 < end ? i + 1 : begin];
      out.next[static_cast<std::size_t>(sides[i].side)] = next.side;
    }
  }
  return out;
}

}  // namespace tilegrad::compat::nvdiffrast
