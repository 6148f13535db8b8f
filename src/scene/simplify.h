// SPDX-License-Identifier: Apache-2.0
// Fewer faces for the same surface.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

// A closed triangle mesh whose edges are collapsed one by one, and that stays a closed manifold.

class EditMesh {
 public:
  // An error unless each edge has exactly two faces, which run along it in opposite directions, and
  // the faces of each vertex are one fan.
  static Result<EditMesh> Make(std::vector<glm::vec3> positions, std::vector<Face> faces);

  std::size_t vertices() const { return positions_.size(); }
  glm::vec3 Position(std::int32_t vertex) const { return positions_[Index(vertex)]; }
  const std::vector<Face>& faces() const { return faces_; }
  // Vertices and faces keep their numbers until Pack; those that were taken out are not alive.
  bool IsFaceAlive(std::int32_t face) const { return faces_[Index(face)][0] >= 0; }
  std::span<const std::int32_t> FacesAt(std::int32_t vertex) const {
    return around_[Index(vertex)];
  }
  std::size_t Valence(std::int32_t vertex) const { return around_[Index(vertex)].size(); }
  // Each edge once, (a, b) with a < b, by a and then by the order of a's faces.
  std::vector<std::array<std::int32_t, 2>> Edges() const;
  bool HasEdge(std::int32_t a, std::int32_t b) const;
  // The corners across from an edge that is there: of the face that runs a to b, and of the other.
  std::array<std::int32_t, 2> Across(std::int32_t a, std::int32_t b) const;

  // Whether b can be drawn into a without changing what the surface is topologically: the
  // vertices that both are joined to are those across from the edge, and no face collapses (the
  // link condition of Dey, Edelsbrunner, Guha, Nekhayev 1999).
  bool CanCollapse(std::int32_t a, std::int32_t b) const;
  // Whether faces would turn by more than the angle of this cosine if a and b stood at `place`.
  bool CollapseTurnsFaces(std::int32_t a, std::int32_t b, glm::vec3 place, float cosine) const;
  // b goes; a stands at `place`.
  void Collapse(std::int32_t a, std::int32_t b, glm::vec3 place);

  // What is alive, renumbered.
  Mesh Pack() const;

 private:
  static std::size_t Index(std::int32_t i) { return static_cast<std::size_t>(i); }
  EditMesh() = default;
  std::int32_t FaceRunning(std::int32_t a, std::int32_t b) const;  // -1: none
  std::int32_t ThirdCorner(std::int32_t face, std::int32_t a, std::int32_t b) const;
  void RemoveFace(std::int32_t face);
  void ReplaceCorner(std::int32_t face, std::int32_t from, std::int32_t to);
  void Forget(std::int32_t vertex, std::int32_t face);

  std::vector<glm::vec3> positions_;
  std::vector<Face> faces_;
  std::vector<std::vector<std::int32_t>> around_;  // faces of each vertex
};

struct SimplifyLimits {
  // How far a patch of the surface of `patch` may move, world units; larger ones less, smaller ones
  // more, as volume goes.
  float error = 0, patch = 1;
  float longest = 1e30f;  // edge that a collapse may make; world units
  std::size_t most_faces =
      0;  // as long as there are more, `error` does not stop; 0: it always does
  // Now and then asked how it goes, by the faces that are left; an error ends the work.
  std::function<Status(std::size_t faces)> told = nullptr;
};

// Collapses edges, the one of the least quadric error first (Garland, Heckbert 1997), and keeps the
// surface a closed manifold of the same topology; no face turns over. Positions and faces only. An
// error if `mesh` is not a closed manifold (scene/simplify.h).
Result<Mesh> Simplified(const Mesh& mesh, const SimplifyLimits& limits);

}  // namespace tilegrad
