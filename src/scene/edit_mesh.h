// SPDX-License-Identifier: Apache-2.0
// A closed triangle mesh that is changed edge by edge and stays a closed manifold: edges are
// collapsed, split and flipped, and what vertices carry (positions, an optimiser's moments) goes
// along.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad {

// V vertices of `width` numbers each; the first three are the position.
struct VertexRows {
  std::size_t width = 3;
  std::vector<float> values;  // [V, width]

  std::size_t count() const { return values.size() / width; }
  glm::vec3 Position(std::int32_t v) const {
    const float* p = &values[static_cast<std::size_t>(v) * width];
    return {p[0], p[1], p[2]};
  }
};

class EditMesh {
 public:
  // An error unless each edge has exactly two faces, which run along it in opposite directions, and
  // the faces of each vertex are one fan.
  static Result<EditMesh> Make(VertexRows vertices, std::vector<Face> faces);

  const VertexRows& vertices() const { return vertices_; }
  const std::vector<Face>& faces() const { return faces_; }
  // Vertices and faces keep their numbers until Pack; those that were taken out are not alive.
  bool IsAlive(std::int32_t vertex) const { return !around_[Index(vertex)].empty(); }
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
  // b goes; a stands at `place`, and its other numbers are the means of both.
  void Collapse(std::int32_t a, std::int32_t b, glm::vec3 place);

  void Move(std::int32_t vertex, glm::vec3 place);

  // The new vertex, in the middle.
  std::int32_t Split(std::int32_t a, std::int32_t b);

  // Whether the edge can join its opposite corners instead: they are not joined yet, and each end
  // keeps three faces.
  bool CanFlip(std::int32_t a, std::int32_t b) const;
  bool FlipTurnsFaces(std::int32_t a, std::int32_t b, float cosine) const;
  void Flip(std::int32_t a, std::int32_t b);

  // What is alive, in the order it was made, renumbered.
  struct Packed {
    VertexRows vertices;
    std::vector<Face> faces;
  };
  Packed Pack() const;

 private:
  static std::size_t Index(std::int32_t i) { return static_cast<std::size_t>(i); }
  EditMesh() = default;
  std::int32_t FaceRunning(std::int32_t a, std::int32_t b) const;  // -1: none
  std::int32_t ThirdCorner(std::int32_t face, std::int32_t a, std::int32_t b) const;
  void RemoveFace(std::int32_t face);
  void ReplaceCorner(std::int32_t face, std::int32_t from, std::int32_t to);
  void Forget(std::int32_t vertex, std::int32_t face);

  VertexRows vertices_;
  std::vector<Face> faces_;
  std::vector<std::vector<std::int32_t>> around_;  // faces of each vertex
};

}  // namespace tilegrad
