// SPDX-License-Identifier: Apache-2.0
#include "scene/simplify.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <queue>
#include <tuple>
#include <utility>

#include "base/error.h"

namespace tilegrad {
namespace {

constexpr std::size_t kTold = 1000;        // candidates between two calls of `told`
constexpr float kMostCollapseTurn = 0.5f;  // cosine: faces turn by less than 60 degrees each time
constexpr double kTowardsMiddle =
    1e-3;                        // of a quadric's weight: holds vertices in planes and lines
constexpr double kShape = 1e-6;  // of an edge's squared length, as error: short ones first

// Weighted sum of squared distances from planes: p.A p - 2 b.p + c.
struct Quadric {
  glm::dmat3 a = glm::dmat3(0);
  glm::dvec3 b = {0, 0, 0};
  double c = 0, weight = 0;

  void AddPlane(const glm::dvec3& unit, const glm::dvec3& on, double w) {
    const double d = glm::dot(unit, on);
    a += w * glm::outerProduct(unit, unit);
    b += w * d * unit;
    c += w * d * d;
    weight += w;
  }
  Quadric& operator+=(const Quadric& q) {
    a += q.a;
    b += q.b;
    c += q.c;
    weight += q.weight;
    return *this;
  }
  double At(const glm::dvec3& p) const {
    return std::max(0.0, glm::dot(p, a * p) - 2 * glm::dot(b, p) + c);
  }
  // The minimum, regularised towards `middle` where planes leave it undetermined.
  glm::dvec3 Best(const glm::dvec3& middle) const {
    const double w = kTowardsMiddle * weight;
    return glm::inverse(a + glm::dmat3(w)) * (b + w * middle);
  }
};

struct Candidate {
  float cost = 0;
  std::int32_t a = 0, b = 0;
  std::uint32_t stamp = 0;  // the sum of both ends', which only grow
};
struct Later {
  bool operator()(const Candidate& x, const Candidate& y) const {
    return std::tie(x.cost, x.a, x.b) > std::tie(y.cost, y.a, y.b);
  }
};

class Simplification {
 public:
  Simplification(const SimplifyLimits& limits, EditMesh* mesh)
      : mesh_(*mesh), limits_(limits), stamps_(mesh_.vertices()), quadrics_(stamps_.size()) {
    // About the first vertex: sums of squares far from the origin lose digits.
    if (!stamps_.empty()) origin_ = mesh_.Position(0);
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh_.faces().size()); ++f) {
      if (!mesh_.IsFaceAlive(f)) continue;
      AddPlaneOf(mesh_.faces()[Index(f)]);
      ++faces_;
    }
    for (const auto& [a, b] : mesh_.Edges()) Push(a, b);
  }

  Status Run() {
    for (std::size_t i = 0; !queue_.empty(); ++i) {
      if (limits_.told && i % kTold == 0) TILEGRAD_TRY(limits_.told(faces_));
      const Candidate next = queue_.top();
      queue_.pop();
      if (next.stamp != stamps_[Index(next.a)] + stamps_[Index(next.b)]) continue;
      if (IsTooFar(next)) break;
      if (!mesh_.CanCollapse(next.a, next.b)) continue;
      const auto place = glm::vec3(BestOf(next.a, next.b).place + glm::dvec3(origin_));
      if (mesh_.CollapseTurnsFaces(next.a, next.b, place, kMostCollapseTurn) ||
          IsTooLong(next, place))
        continue;
      Take(next, place);
    }
    return {};
  }

 private:
  static std::size_t Index(std::int32_t i) { return static_cast<std::size_t>(i); }
  glm::dvec3 At(std::int32_t v) const {
    return glm::dvec3(mesh_.Position(v)) - glm::dvec3(origin_);
  }

  void AddPlaneOf(const Face& f) {
    const glm::dvec3 normal = glm::cross(At(f[1]) - At(f[0]), At(f[2]) - At(f[0]));
    const double length = glm::length(normal);
    if (!(length > 0)) return;
    for (const std::int32_t v : f) quadrics_[Index(v)].AddPlane(normal / length, At(v), length);
  }

  struct Place {
    glm::dvec3 place;
    double cost;
  };
  Place BestOf(std::int32_t a, std::int32_t b) const {
    Quadric sum = quadrics_[Index(a)];
    sum += quadrics_[Index(b)];
    const glm::dvec3 middle = 0.5 * (At(a) + At(b)), edge = At(b) - At(a);
    glm::dvec3 best = sum.weight > 0 ? sum.Best(middle) : middle;
    const double square = glm::dot(edge, edge);
    const glm::dvec3 away = best - middle;
    if (!(glm::dot(away, away) < 4 * square)) best = middle;
    return {best, sum.At(best) + kShape * square * sum.weight};
  }

  void Push(std::int32_t a, std::int32_t b) {
    queue_.push(
        {static_cast<float>(BestOf(a, b).cost), a, b, stamps_[Index(a)] + stamps_[Index(b)]});
  }

  bool IsTooFar(const Candidate& c) const {
    if (faces_ > limits_.most_faces && limits_.most_faces > 0) return false;
    const auto most = static_cast<double>(limits_.error);
    // Each face counts at three vertices, with twice its area.
    return static_cast<double>(c.cost) > most * most * 6 * static_cast<double>(limits_.patch);
  }

  bool IsTooLong(const Candidate& c, glm::vec3 place) const {
    const float most = limits_.longest * limits_.longest;
    for (const std::int32_t moved : {c.a, c.b}) {
      for (const std::int32_t f : mesh_.FacesAt(moved)) {
        for (const std::int32_t v : mesh_.faces()[Index(f)]) {
          const glm::vec3 d = mesh_.Position(v) - place;
          if (v != c.a && v != c.b && glm::dot(d, d) > most) return true;
        }
      }
    }
    return false;
  }

  void Take(const Candidate& c, glm::vec3 place) {
    mesh_.Collapse(c.a, c.b, place);
    quadrics_[Index(c.a)] += quadrics_[Index(c.b)];
    faces_ -= 2;
    ++stamps_[Index(c.a)];
    ++stamps_[Index(c.b)];
    for (const std::int32_t f : mesh_.FacesAt(c.a)) {
      const Face& face = mesh_.faces()[Index(f)];
      for (std::size_t k = 0; k < 3; ++k)
        if (face[k] == c.a) Push(c.a, face[(k + 1) % 3]);
    }
  }

  EditMesh& mesh_;
  SimplifyLimits limits_;
  std::size_t faces_ = 0;
  glm::vec3 origin_ = {0, 0, 0};
  std::vector<std::uint32_t> stamps_;
  std::vector<Quadric> quadrics_;
  std::priority_queue<Candidate, std::vector<Candidate>, Later> queue_;
};

glm::vec3 Normal(glm::vec3 a, glm::vec3 b, glm::vec3 c) { return glm::cross(b - a, c - a); }

// Whether two vectors, of any length, are farther apart than the angle of this cosine.
// True for a zero vector.
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

Result<Mesh> Simplified(const Mesh& mesh, const SimplifyLimits& limits) {
  TILEGRAD_ASSIGN(EditMesh edit, EditMesh::Make(mesh.positions, mesh.faces));
  TILEGRAD_TRY(Simplification(limits, &edit).Run());
  return edit.Pack();
}

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
    // Around the vertex from face to face: the walk must return after all of them.
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
    if (found >= 0) return -1;  // two: not a manifold
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
