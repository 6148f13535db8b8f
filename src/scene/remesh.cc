// SPDX-License-Identifier: Apache-2.0
#include "scene/remesh.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <tuple>
#include <vector>

#include "scene/simplify.h"

namespace tilegrad {
namespace {

constexpr float kFolded = -0.7f;   // cosine between normals of two faces at an edge: 135 degrees
constexpr float kFlat = 0.97f;     // the same, where edges may be flipped
constexpr float kMostTurn = 0.5f;  // of a face in a collapse
constexpr int kFlipRounds = 3;

std::size_t Index(std::int32_t i) { return static_cast<std::size_t>(i); }

glm::vec3 At(const EditMesh& mesh, std::int32_t v) { return mesh.vertices().Position(v); }

glm::vec3 NormalOf(const EditMesh& mesh, std::int32_t a, std::int32_t b, std::int32_t c) {
  const glm::vec3 n = glm::cross(At(mesh, b) - At(mesh, a), At(mesh, c) - At(mesh, a));
  const float length = glm::length(n);
  return length > 0 ? n / length : glm::vec3(0);
}

bool IsFolded(const EditMesh& mesh, std::int32_t a, std::int32_t b) {
  const auto [c, d] = mesh.Across(a, b);
  return glm::dot(NormalOf(mesh, a, b, c), NormalOf(mesh, b, a, d)) < kFolded;
}

int Unfold(EditMesh* mesh) {
  std::vector<std::int32_t> folded;
  for (const auto& [a, b] : mesh->Edges()) {
    if (!IsFolded(*mesh, a, b)) continue;
    const auto [c, d] = mesh->Across(a, b);
    folded.insert(folded.end(), {c, d});
  }
  std::sort(folded.begin(), folded.end());
  folded.erase(std::unique(folded.begin(), folded.end()), folded.end());
  for (const std::int32_t v : folded) {
    glm::vec3 sum(0);
    for (const std::int32_t f : mesh->FacesAt(v))
      for (const std::int32_t n : mesh->faces()[Index(f)])
        sum += n == v ? glm::vec3(0) : At(*mesh, n);
    mesh->Move(v, sum / static_cast<float>(2 * mesh->Valence(v)));  // each neighbour twice
  }
  return static_cast<int>(folded.size());
}

struct Sized {
  float length;
  std::int32_t a, b;
};

std::vector<Sized> EdgesByLength(const EditMesh& mesh, bool longest_first) {
  std::vector<Sized> out;
  for (const auto& [a, b] : mesh.Edges())
    out.push_back({glm::distance(At(mesh, a), At(mesh, b)), a, b});
  std::sort(out.begin(), out.end(), [&](const Sized& x, const Sized& y) {
    const float l = longest_first ? -x.length : x.length, m = longest_first ? -y.length : y.length;
    return std::tie(l, x.a, x.b) < std::tie(m, y.a, y.b);
  });
  return out;
}

// Middles of busy edges are busy, too.
int SplitLong(const RemeshLimits& limits, std::vector<char>* busy, EditMesh* mesh) {
  int count = 0;
  std::size_t faces = 0;
  for (std::int32_t f = 0; Index(f) < mesh->faces().size(); ++f) faces += mesh->IsFaceAlive(f);
  for (const Sized& e : EdgesByLength(*mesh, true)) {
    const bool both = (*busy)[Index(e.a)] && (*busy)[Index(e.b)];
    if (!(e.length > (both ? limits.busy : limits.longest))) continue;
    if (faces + 2 > limits.most_faces) break;
    mesh->Split(e.a, e.b);
    busy->push_back(both), faces += 2, ++count;
  }
  return count;
}

int CollapseShort(float shortest, EditMesh* mesh) {
  int count = 0;
  for (const Sized& e : EdgesByLength(*mesh, false)) {
    if (!(e.length < shortest)) break;
    if (!mesh->IsAlive(e.a) || !mesh->IsAlive(e.b) || !mesh->HasEdge(e.a, e.b)) continue;
    const glm::vec3 middle = 0.5f * (At(*mesh, e.a) + At(*mesh, e.b));
    if (glm::distance(At(*mesh, e.a), At(*mesh, e.b)) >= shortest) continue;
    if (!mesh->CanCollapse(e.a, e.b) || mesh->CollapseTurnsFaces(e.a, e.b, middle, kMostTurn))
      continue;
    mesh->Collapse(e.a, e.b, middle), ++count;
  }
  return count;
}

// The cosine of the angle at c in the triangle a b c.
float Cosine(const EditMesh& mesh, std::int32_t a, std::int32_t b, std::int32_t c) {
  const glm::vec3 x = At(mesh, a) - At(mesh, c), y = At(mesh, b) - At(mesh, c);
  const float lengths = glm::length(x) * glm::length(y);
  return lengths > 0 ? glm::dot(x, y) / lengths : 1;
}

// As Delaunay: where the two angles across an edge are more than two right angles together.
int FlipOnce(EditMesh* mesh) {
  int count = 0;
  for (const auto& [a, b] : mesh->Edges()) {
    if (!mesh->HasEdge(a, b)) continue;  // an edge before was flipped at both
    const auto [c, d] = mesh->Across(a, b);
    if (!(Cosine(*mesh, a, b, c) + Cosine(*mesh, a, b, d) < -1e-3f)) continue;
    if (glm::dot(NormalOf(*mesh, a, b, c), NormalOf(*mesh, b, a, d)) < kFlat) continue;
    if (!mesh->CanFlip(a, b) || mesh->FlipTurnsFaces(a, b, kFlat)) continue;
    mesh->Flip(a, b), ++count;
  }
  return count;
}

}  // namespace

RemeshCount Remesh(const RemeshLimits& limits, std::span<const char> busy, EditMesh* mesh) {
  RemeshCount count;
  std::vector<char> keep(busy.begin(), busy.end());
  count.unfolded = Unfold(mesh);
  count.split = SplitLong(limits, &keep, mesh);
  count.collapsed = CollapseShort(limits.shortest, mesh);
  const auto alive = [&] {
    int n = 0;
    for (std::int32_t v = 0; Index(v) < mesh->vertices().count(); ++v) n += mesh->IsAlive(v);
    return n;
  };
  const int before = alive();
  static_cast<void>(  // nobody is asked, so it is done
      Simplify({.error = limits.error, .patch = limits.patch, .longest = limits.longest}, keep,
               mesh));
  count.collapsed += before - alive();
  for (int i = 0; i < kFlipRounds; ++i) count.flipped += FlipOnce(mesh);
  return count;
}

}  // namespace tilegrad
