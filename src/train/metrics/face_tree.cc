// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/face_tree.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>

namespace tilegrad::train {
namespace {

using glm::dvec3;

constexpr std::size_t kLeafFaces = 4;

void Offer(const Triangle& face, const std::array<double, 3>& weights, const dvec3& query,
           FaceTree::Nearest* best) {
  const dvec3 offset = weights[0] * face[0] + weights[1] * face[1] + weights[2] * face[2] - query;
  const double squared = glm::dot(offset, offset);
  if (squared < best->squared) *best = {-1, weights, squared};
}

// The nearest point of a triangle is the foot of the perpendicular or on an edge. Each offered
// point lies on the triangle, so slivers cost accuracy of the foot at most.
FaceTree::Nearest NearestOn(const Triangle& face, const dvec3& query) {
  FaceTree::Nearest best;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    const dvec3 edge = face[next] - face[k];
    const double length = glm::dot(edge, edge);
    const double t =
        length > 0 ? std::clamp(glm::dot(query - face[k], edge) / length, 0.0, 1.0) : 0.0;
    std::array<double, 3> weights{};
    weights[k] = 1 - t;
    weights[next] = t;
    Offer(face, weights, query, &best);
  }
  const dvec3 normal = glm::cross(face[1] - face[0], face[2] - face[0]);
  const double area = glm::dot(normal, normal);
  if (!(area > 0)) return best;
  const double w1 = glm::dot(glm::cross(query - face[0], face[2] - face[0]), normal) / area;
  const double w2 = glm::dot(glm::cross(face[1] - face[0], query - face[0]), normal) / area;
  if (w1 > 0 && w2 > 0 && 1 - w1 - w2 > 0) Offer(face, {1 - w1 - w2, w1, w2}, query, &best);
  return best;
}

double SquaredDistanceToBox(const dvec3& low, const dvec3& high, const dvec3& query) {
  const dvec3 offset = glm::max(glm::max(low - query, query - high), dvec3(0));
  return glm::dot(offset, offset);
}

// Even-odd rule in the plane of y and z; an edge is walked from its lower end, so that its two
// faces see the same crossing.
bool CoversFromSide(const Triangle& face, const dvec3& query) {
  bool inside = false;
  for (std::size_t k = 0; k < 3; ++k) {
    dvec3 from = face[k], to = face[(k + 1) % 3];
    if ((from.y > query.y) == (to.y > query.y)) continue;
    if (from.y > to.y) std::swap(from, to);
    const double z = from.z + (query.y - from.y) / (to.y - from.y) * (to.z - from.z);
    if (query.z < z) inside = !inside;
  }
  return inside;
}

// Whether the plane of `face` passes the line along x through `query` at a larger x.
bool IsBeyond(const Triangle& face, const dvec3& query) {
  const dvec3 normal = glm::cross(face[1] - face[0], face[2] - face[0]);
  const double side = glm::dot(face[0] - query, normal);
  return normal.x > 0 ? side > 0 : side < 0;
}

}  // namespace

FaceTree::FaceTree(std::span<const Triangle> faces)
    : faces_(faces.begin(), faces.end()), order_(faces.size()) {
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  if (!faces_.empty()) Build(0, faces_.size());
}

std::size_t FaceTree::Build(std::size_t begin, std::size_t end) {
  const std::size_t at = nodes_.size();
  Node node{faces_[order_[begin]][0], faces_[order_[begin]][0], begin, end, 0};
  for (std::size_t i = begin; i < end; ++i) {
    for (const dvec3& p : faces_[order_[i]]) {
      node.low = glm::min(node.low, p);
      node.high = glm::max(node.high, p);
    }
  }
  nodes_.push_back(node);
  if (end - begin <= kLeafFaces) return at;
  const std::size_t middle = begin + (end - begin) / 2;
  SplitAtMedian(begin, middle, end);
  Build(begin, middle);
  nodes_[at].right = Build(middle, end);
  return at;
}

// Along the axis in which the centroids are spread most.
void FaceTree::SplitAtMedian(std::size_t begin, std::size_t middle, std::size_t end) {
  const auto centroid = [this](std::size_t f) {
    return faces_[f][0] + faces_[f][1] + faces_[f][2];
  };
  dvec3 low = centroid(order_[begin]), high = low;
  for (std::size_t i = begin; i < end; ++i) {
    low = glm::min(low, centroid(order_[i]));
    high = glm::max(high, centroid(order_[i]));
  }
  const dvec3 size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const auto place = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(place(begin), place(middle), place(end), [&](std::size_t a, std::size_t b) {
    return centroid(a)[axis] < centroid(b)[axis];
  });
}

FaceTree::Nearest FaceTree::Find(const dvec3& query) const {
  Nearest best;
  if (!nodes_.empty()) Search(0, query, &best);
  return best;
}

void FaceTree::Search(std::size_t at, const dvec3& query, Nearest* best) const {
  const Node& node = nodes_[at];
  if (SquaredDistanceToBox(node.low, node.high, query) > best->squared) return;
  if (node.right == 0) {
    for (std::size_t i = node.begin; i < node.end; ++i) {
      Nearest found = NearestOn(faces_[order_[i]], query);
      found.face = static_cast<std::int32_t>(order_[i]);
      const bool first = found.squared == best->squared && found.face < best->face;
      if (found.squared < best->squared || first) *best = found;
    }
    return;
  }
  const auto distance = [&](std::size_t child) {
    return SquaredDistanceToBox(nodes_[child].low, nodes_[child].high, query);
  };
  std::size_t near = at + 1, far = node.right;
  if (distance(far) < distance(near)) std::swap(near, far);
  Search(near, query, best);
  Search(far, query, best);
}

bool FaceTree::Encloses(const dvec3& query) const {
  bool inside = false;
  std::vector<std::size_t> open;
  if (!nodes_.empty()) open.push_back(0);
  while (!open.empty()) {
    const std::size_t at = open.back();
    const Node& node = nodes_[at];
    open.pop_back();
    const bool misses = query.x > node.high.x || query.y < node.low.y || query.y > node.high.y ||
                        query.z < node.low.z || query.z > node.high.z;
    if (misses) continue;
    if (node.right != 0) {
      open.insert(open.end(), {at + 1, node.right});
      continue;
    }
    for (std::size_t i = node.begin; i < node.end; ++i) {
      const Triangle& face = faces_[order_[i]];
      inside ^= CoversFromSide(face, query) && IsBeyond(face, query);
    }
  }
  return inside;
}

NearestPoint::NearestPoint(std::span<const glm::dvec3> points) {
  nodes_.reserve(points.size());
  for (const glm::dvec3& p : points)
    nodes_.push_back({p, static_cast<std::int32_t>(nodes_.size()), 0});
  Build(0, nodes_.size());
}

NearestPoint::NearestPoint(std::span<const glm::vec3> points)
    : NearestPoint(std::vector<glm::dvec3>(points.begin(), points.end())) {}

void NearestPoint::Build(std::size_t begin, std::size_t end) {
  if (end - begin < 2) return;
  glm::dvec3 low = nodes_[begin].at, high = low;
  for (std::size_t i = begin; i < end; ++i) {
    low = glm::min(low, nodes_[i].at);
    high = glm::max(high, nodes_[i].at);
  }
  const glm::dvec3 size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return nodes_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end),
                   [axis](const Node& a, const Node& b) { return a.at[axis] < b.at[axis]; });
  nodes_[middle].axis = axis;
  Build(begin, middle);
  Build(middle + 1, end);
}

NearestPoint::Found NearestPoint::Find(const glm::dvec3& query) const {
  Found best;
  Search(0, nodes_.size(), query, &best);
  return best;
}

void NearestPoint::Search(std::size_t begin, std::size_t end, const glm::dvec3& query,
                          Found* best) const {
  if (begin == end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const Node& node = nodes_[middle];
  const glm::dvec3 offset = query - node.at;
  const double squared = glm::dot(offset, offset);
  if (squared < best->squared || (squared == best->squared && node.index < best->index))
    *best = {node.index, squared};
  const double across = offset[node.axis];
  const bool left_first = across < 0;
  for (const bool left : {left_first, !left_first}) {
    if (left != left_first && across * across > best->squared) continue;
    left ? Search(begin, middle, query, best) : Search(middle + 1, end, query, best);
  }
}

}  // namespace tilegrad::train
