// SPDX-License-Identifier: Apache-2.0
#include "scene/topology.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <tuple>

#include "base/union_find.h"

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

using Index = std::size_t;

// For each vertex the first one at the same position.
std::vector<Index> FirstAtPlace(const std::vector<glm::vec3>& positions) {
  std::map<std::tuple<float, float, float>, Index> first;
  std::vector<Index> out;
  for (Index v = 0; v < positions.size(); ++v) {
    const glm::vec3& p = positions[v];
    out.push_back(first.try_emplace({p.x, p.y, p.z}, v).first->second);
  }
  return out;
}

// Unit; 0 for a face without area.
std::vector<glm::dvec3> FaceNormals(const Mesh& mesh) {
  std::vector<glm::dvec3> out;
  for (const Face& face : mesh.faces) {
    const auto at = [&](int k) { return glm::dvec3(mesh.positions[static_cast<Index>(face[k])]); };
    const glm::dvec3 n = glm::cross(at(1) - at(0), at(2) - at(0));
    const double length = glm::length(n);
    out.push_back(length > 0 ? n / length : glm::dvec3(0));
  }
  return out;
}

// A face's side, by its ends, ordered by the indices of their positions.
struct FaceSide {
  std::array<Index, 2> places, corners;
  bool operator<(const FaceSide& o) const {
    return std::tie(places, corners) < std::tie(o.places, o.corners);
  }
};

std::vector<FaceSide> SortedSides(const Mesh& mesh) {
  const std::vector<Index> place = FirstAtPlace(mesh.positions);
  std::vector<FaceSide> out;
  for (Index f = 0; f < mesh.faces.size(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      FaceSide side;
      side.corners = {3 * f + k, 3 * f + (k + 1) % 3};
      for (Index end = 0; end < 2; ++end) {
        const Index corner = side.corners[end];
        side.places[end] = place[static_cast<Index>(mesh.faces[f][corner - 3 * f])];
      }
      if (side.places[0] == side.places[1]) continue;
      if (side.places[0] > side.places[1]) {
        std::swap(side.places[0], side.places[1]);
        std::swap(side.corners[0], side.corners[1]);
      }
      out.push_back(side);
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

// Groups of corners: tests all pairs of faces at an edge, and joins at both of its ends.
UnionFind JoinSmoothSides(const Mesh& mesh, double degrees) {
  const double least = std::cos(degrees * std::numbers::pi / 180);
  const std::vector<glm::dvec3> normals = FaceNormals(mesh);
  const std::vector<FaceSide> sides = SortedSides(mesh);
  UnionFind groups(3 * mesh.faces.size());
  for (Index i = 0; i < sides.size(); ++i) {
    for (Index j = i + 1; j < sides.size() && sides[j].places == sides[i].places; ++j) {
      const glm::dvec3 &a = normals[sides[i].corners[0] / 3], &b = normals[sides[j].corners[0] / 3];
      if (!(glm::dot(a, b) > least)) continue;
      for (Index end = 0; end < 2; ++end) groups.Join(sides[i].corners[end], sides[j].corners[end]);
    }
  }
  return groups;
}

void ColorsToCorners(Mesh* mesh) {
  if (mesh->colors.empty()) return;
  for (const Face& face : mesh->faces) {
    for (const std::int32_t v : face)
      mesh->corner_colors.push_back(mesh->colors[static_cast<Index>(v)]);
  }
  mesh->colors.clear();
}

}  // namespace

Topology BuildTopology(std::span<const Face> faces, std::size_t vertices) {
  Topology out;
  CollectEdges(SortedSides(faces), out);
  CollectNeighbors(vertices, out);
  return out;
}

void SplitAtCreases(double degrees, Mesh* mesh) {
  UnionFind groups = JoinSmoothSides(*mesh, degrees);
  ColorsToCorners(mesh);
  mesh->normals.clear();
  std::vector<glm::vec3> positions;
  std::vector<std::int32_t> vertex_of(3 * mesh->faces.size());  // of each group's first corner
  for (Index c = 0; c < vertex_of.size(); ++c) {
    std::int32_t& vertex = mesh->faces[c / 3][c % 3];
    const Index leader = groups.Of(c);
    if (leader == c) {
      vertex_of[c] = static_cast<std::int32_t>(positions.size());
      positions.push_back(mesh->positions[static_cast<Index>(vertex)]);
    }
    vertex = vertex_of[leader];
  }
  mesh->positions = std::move(positions);
}

}  // namespace tilegrad
