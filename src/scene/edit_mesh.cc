// SPDX-License-Identifier: Apache-2.0
#include "scene/edit_mesh.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "base/error.h"

namespace tilegrad {
namespace {

glm::vec3 Normal(glm::vec3 a, glm::vec3 b, glm::vec3 c) { return glm::cross(b - a, c - a); }

// Whether two vectors, which need not be unit, are farther apart than the angle of this cosine.
// One without length is.
bool Apart(glm::vec3 a, glm::vec3 b, float cosine) {
  return !(glm::dot(a, b) > cosine * glm::length(a) * glm::length(b));
}

bool Has(const Face& face, std::int32_t vertex) {
  return face[0] == vertex || face[1] == vertex || face[2] == vertex;
}

std::size_t CornerOf(const Face& face, std::int32_t vertex) {
  return face[0] == vertex ? 0 : face[1] == vertex ? 1 : 2;
}

}  // namespace

Result<EditMesh> EditMesh::Make(std::vector<glm::vec3> positions, std::vector<Face> faces) {
  EditMesh mesh;
  mesh.positions_ = std::move(positions);
  mesh.faces_ = std::move(faces);
  mesh.around_.resize(mesh.positions_.size());
  for (std::size_t f = 0; f < mesh.faces_.size(); ++f) {
    for (const std::int32_t v : mesh.faces_[f]) {
      if (v < 0 || Index(v) >= mesh.around_.size())
        return InvalidArgument("face {} names vertex {} of {}", f, v, mesh.around_.size());
      mesh.around_[Index(v)].push_back(static_cast<std::int32_t>(f));
    }
  }
  for (std::int32_t v = 0; Index(v) < mesh.around_.size(); ++v) {
    const auto& fan = mesh.around_[Index(v)];
    if (fan.empty()) continue;
    // Round the vertex from face to face: the way must come back after all of them.
    std::int32_t face = fan[0];
    std::size_t seen = 0;
    do {
      const Face& f = mesh.faces_[Index(face)];
      const std::int32_t next = f[(CornerOf(f, v) + 2) % 3];
      face = mesh.FaceRunning(v, next);
      ++seen;
    } while (face >= 0 && face != fan[0] && seen <= fan.size());
    if (face != fan[0] || seen != fan.size())
      return InvalidArgument("the mesh is not a closed manifold at vertex {}", v);
  }
  return mesh;
}

std::int32_t EditMesh::FaceRunning(std::int32_t a, std::int32_t b) const {
  std::int32_t found = -1;
  for (const std::int32_t f : around_[Index(a)]) {
    const Face& face = faces_[Index(f)];
    if (face[(CornerOf(face, a) + 1) % 3] != b) continue;
    if (found >= 0) return -1;  // two: no manifold
    found = f;
  }
  return found;
}

std::int32_t EditMesh::ThirdCorner(std::int32_t face, std::int32_t a, std::int32_t b) const {
  const Face& f = faces_[Index(face)];
  return f[0] != a && f[0] != b ? f[0] : f[1] != a && f[1] != b ? f[1] : f[2];
}

std::vector<std::array<std::int32_t, 2>> EditMesh::Edges() const {
  std::vector<std::array<std::int32_t, 2>> out;
  for (std::int32_t a = 0; Index(a) < around_.size(); ++a) {
    for (const std::int32_t f : around_[Index(a)]) {
      const Face& face = faces_[Index(f)];
      const std::int32_t b = face[(CornerOf(face, a) + 1) % 3];
      if (a < b) out.push_back({a, b});
    }
    // Edges that run from b to a in a's faces run from a to b in another.
  }
  return out;
}

bool EditMesh::HasEdge(std::int32_t a, std::int32_t b) const {
  const auto& fan = around_[Index(a)];
  return std::any_of(fan.begin(), fan.end(),
                     [&](std::int32_t f) { return Has(faces_[Index(f)], b); });
}

std::array<std::int32_t, 2> EditMesh::Across(std::int32_t a, std::int32_t b) const {
  return {ThirdCorner(FaceRunning(a, b), a, b), ThirdCorner(FaceRunning(b, a), a, b)};
}

bool EditMesh::CanCollapse(std::int32_t a, std::int32_t b) const {
  const auto [c, d] = Across(a, b);
  if (Valence(c) <= 3 || Valence(d) <= 3) return false;
  std::size_t shared = 0;
  for (const std::int32_t f : around_[Index(a)]) {
    const Face& face = faces_[Index(f)];
    // Each neighbour once: as the one that follows a.
    const std::int32_t n = face[(CornerOf(face, a) + 1) % 3];
    if (n != b && HasEdge(b, n)) ++shared;
  }
  return shared == 2;
}

bool EditMesh::CollapseTurnsFaces(std::int32_t a, std::int32_t b, glm::vec3 place,
                                  float cosine) const {
  for (const std::int32_t moved : {a, b}) {
    for (const std::int32_t f : around_[Index(moved)]) {
      const Face& face = faces_[Index(f)];
      if (Has(face, a) && Has(face, b)) continue;
      const std::size_t k = CornerOf(face, moved);
      const glm::vec3 p = Position(face[(k + 1) % 3]), q = Position(face[(k + 2) % 3]);
      if (Apart(Normal(Position(moved), p, q), Normal(place, p, q), cosine)) return true;
    }
  }
  return false;
}

void EditMesh::Forget(std::int32_t vertex, std::int32_t face) {
  auto& fan = around_[Index(vertex)];
  fan.erase(std::find(fan.begin(), fan.end(), face));
}

void EditMesh::RemoveFace(std::int32_t face) {
  for (const std::int32_t v : faces_[Index(face)]) Forget(v, face);
  faces_[Index(face)] = {-1, -1, -1};
}

void EditMesh::ReplaceCorner(std::int32_t face, std::int32_t from, std::int32_t to) {
  Face& f = faces_[Index(face)];
  f[CornerOf(f, from)] = to;
  Forget(from, face);
  around_[Index(to)].push_back(face);
}

void EditMesh::Collapse(std::int32_t a, std::int32_t b, glm::vec3 place) {
  for (const std::int32_t face : {FaceRunning(a, b), FaceRunning(b, a)}) RemoveFace(face);
  while (!around_[Index(b)].empty()) ReplaceCorner(around_[Index(b)].back(), b, a);
  positions_[Index(a)] = place;
}

Mesh EditMesh::Pack() const {
  Mesh out;
  std::vector<std::int32_t> number(around_.size(), -1);
  for (std::size_t v = 0; v < around_.size(); ++v) {
    if (around_[v].empty()) continue;
    number[v] = static_cast<std::int32_t>(out.positions.size());
    out.positions.push_back(positions_[v]);
  }
  for (const Face& f : faces_) {
    if (f[0] >= 0)
      out.faces.push_back({number[Index(f[0])], number[Index(f[1])], number[Index(f[2])]});
  }
  return out;
}

}  // namespace tilegrad
