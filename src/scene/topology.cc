// SPDX-License-Identifier: Apache-2.0
#include "scene/topology.h"

#include <algorithm>
#include <tuple>

namespace tilegrad {
namespace {

struct Side {
  std::int32_t a, b, face;
};

std::vector<Side> SortedSides(std::span<const Face> faces) {
  std::vector<Side> sides;
  sides.reserve(3 * faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(faces[f][k], faces[f][(k + 1) % 3]);
      if (a != b) sides.push_back({a, b, static_cast<std::int32_t>(f)});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) {
    return std::tie(x.a, x.b, x.face) < std::tie(y.a, y.b, y.face);
  });
  return sides;
}

void CollectEdges(const std::vector<Side>& sides, Topology& out) {
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end].a == sides[i].a && sides[end].b == sides[i].b) ++end;
    out.edges.push_back(
        {sides[i].a, sides[i].b, sides[i].face, end - i > 1 ? sides[i + 1].face : -1});
    out.boundary_edges += end - i == 1;
    out.nonmanifold_edges += end - i > 2;
    i = end;
  }
}

// Edges are sorted by (a, b): writing both directions in that order leaves every list ascending,
// since a < b.
void CollectNeighbors(std::size_t vertices, Topology& out) {
  out.offsets.assign(vertices + 1, 0);
  for (const Edge& e : out.edges) {
    ++out.offsets[e.a + 1];
    ++out.offsets[e.b + 1];
  }
  for (std::size_t v = 0; v < vertices; ++v) out.offsets[v + 1] += out.offsets[v];
  out.neighbors.resize(2 * out.edges.size());
  std::vector<std::int32_t> next(out.offsets.begin(), out.offsets.end() - 1);
  for (const Edge& e : out.edges) {
    out.neighbors[next[e.b]++] = e.a;
  }
  for (const Edge& e : out.edges) {
    out.neighbors[next[e.a]++] = e.b;
  }
}

}  // namespace

Topology BuildTopology(std::span<const Face> faces, std::size_t vertices) {
  Topology out;
  CollectEdges(SortedSides(faces), out);
  CollectNeighbors(vertices, out);
  return out;
}

}  // namespace tilegrad
