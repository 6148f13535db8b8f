// SPDX-License-Identifier: Apache-2.0
// Mesh simplification by edge collapses.
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

// A closed triangle mesh that stays a closed manifold while its edges are collapsed one by one.

class EditMesh {
 public:
  // An error unless each edge has exactly two faces, which traverse it in opposite directions, and
  // the faces of each vertex form one fan.
  static Result<EditMesh> Make(std::vector<glm::vec3> positions, std::vector<Face> faces);

  std::size_t vertices() const { return positions_.size(); }
  glm::vec3 Position(std::int32_t vertex) const { return positions_[Index(vertex)]; }
  const std::vector<Face>& faces() const { return faces_; }
  // Vertices and faces keep their indices until Pack; removed ones are not alive.
  bool IsFaceAlive(std::int32_t face) const { return faces_[Index(face)][0] >= 0; }
  std::span<const std::int32_t> FacesAt(std::int32_t vertex) const {
    return around_[Index(vertex)];
  }
  std::size_t Valence(std::int32_t vertex) const { return around_[Index(vertex)].size(); }
  // Each edge once, (a, b) with a < b, sorted by a and then by the order of a's faces.
  std::vector<std::array<std::int32_t, 2>> Edges() const;
  bool HasEdge(std::int32_t a, std::int32_t b) const;
  // The corners opposite an existing edge: of the face that traverses it from a to b, and of the
  // other.
  std::array<std::int32_t, 2> Across(std::int32_t a, std::int32_t b) const;

  // Whether collapsing b into a preserves the topology: the common neighbours of a and b are
  // exactly the corners opposite the edge, and no face collapses (the link condition of Dey,
  // Edelsbrunner, Guha, Nekhayev 1999).
  bool CanCollapse(std::int32_t a, std::int32_t b) const;
  // Whether moving a and b to `place` would turn a face by more than the angle of this cosine.
  bool CollapseTurnsFaces(std::int32_t a, std::int32_t b, glm::vec3 place, float cosine) const;
  // Removes b and moves a to `place`.
  void Collapse(std::int32_t a, std::int32_t b, glm::vec3 place);

  // The live vertices and faces, renumbered.
  Mesh Pack() const;

 private:
  static std::size_t Index(std::int32_t i) { return static_cast<std::size_t>(i); }
  EditMesh() = default;
  std::int32_t FaceRunning(std::int32_t a, std::int32_t b) const;  // -1 if none
  std::int32_t ThirdCorner(std::int32_t face, std::int32_t a, std::int32_t b) const;
  void RemoveFace(std::int32_t face);
  void ReplaceCorner(std::int32_t face, std::int32_t from, std::int32_t to);
  void Forget(std::int32_t vertex, std::int32_t face);

  std::vector<glm::vec3> positions_;
  std::vector<Face> faces_;
  std::vector<std::vector<std::int32_t>> around_;  // faces of each vertex
};

struct SimplifyLimits {
  // How far a piece of surface with the area `patch` may move, world units; larger pieces may move
  // less, smaller ones more, by volume.
  float error = 0, patch = 1;
  float longest = 1e30f;  // longest edge that a collapse may create; world units
  std::size_t most_faces =
      0;  // `error` does not stop collapses above this many faces; 0: it always does
  // Called now and then with the number of faces left; an error stops the work.
  std::function<Status(std::size_t faces)> told = nullptr;
};

// Collapses edges in order of quadric error, least first (Garland, Heckbert 1997), and keeps the
// surface a closed manifold of the same topology; no face flips. Positions and faces only. An error
// if `mesh` is not a closed manifold (scene/simplify.h).
Result<Mesh> Simplified(const Mesh& mesh, const SimplifyLimits& limits);

}  // namespace tilegrad
