// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/truth_mesh.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <utility>

#include "base/rng.h"
#include "render/picture/mesh_scene.h"

namespace tilegrad::train {
namespace {

using ColorList = std::vector<glm::vec3>;  // [3F], of corners

struct VertexSum {
  glm::vec3 position = glm::vec3(0), color = glm::vec3(0);
  float count = 0;
};

std::uint64_t MaterialOf(const Mesh& mesh, std::size_t face) {
  return mesh.face_materials.empty() ? 0 : static_cast<std::uint64_t>(mesh.face_materials[face]);
}

bool Collapsed(const Face& face) {
  return face[0] == face[1] || face[1] == face[2] || face[0] == face[2];
}

// The same three corners in the same winding are one face, wherever it begins.
Face FromItsLeast(Face face) {
  std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
  return face;
}

// Joins the corners that `key_of(face, k)` gives the same key.
template <class KeyOf>
Mesh JoinCorners(const Mesh& mesh, const ColorList& colors, KeyOf key_of) {
  Mesh out;
  std::vector<VertexSum> sums;
  std::unordered_map<std::uint64_t, std::int32_t> index;
  std::set<Face> seen;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    Face face;
    for (int k = 0; k < 3; ++k) {
      const auto [at, fresh] =
          index.try_emplace(key_of(f, k), static_cast<std::int32_t>(sums.size()));
      if (fresh) sums.emplace_back();
      VertexSum& sum = sums[static_cast<std::size_t>(at->second)];
      const auto corner = static_cast<std::size_t>(k);
      sum.position += mesh.positions[static_cast<std::size_t>(mesh.faces[f][corner])];
      sum.color += colors[3 * f + corner];
      sum.count += 1;
      face[corner] = at->second;
    }
    if (Collapsed(face)) continue;
    face = FromItsLeast(face);
    if (seen.insert(face).second) out.faces.push_back(face);
  }
  for (const VertexSum& sum : sums) {
    out.positions.push_back(sum.position / sum.count);
    out.colors.emplace_back(sum.color / sum.count, 1.0f);
  }
  return out;
}

// Moves the value of vertex v to vertex to[v] of `kept`; negative: dropped.
template <class T>
void Renumber(const std::vector<std::int32_t>& to, std::int32_t kept, std::vector<T>* values) {
  if (values->empty()) return;
  std::vector<T> out(static_cast<std::size_t>(kept));
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (to[v] >= 0) out[static_cast<std::size_t>(to[v])] = (*values)[v];
  }
  *values = std::move(out);
}

// Drops vertices that no face uses any more.
void DropUnused(Mesh* mesh) {
  std::vector<std::int32_t> to(mesh->positions.size(), -1);
  std::int32_t kept = 0;
  for (Face& face : mesh->faces) {
    for (std::int32_t& v : face) {
      auto& target = to[static_cast<std::size_t>(v)];
      if (target < 0) target = kept++;
      v = target;
    }
  }
  Renumber(to, kept, &mesh->positions);
  Renumber(to, kept, &mesh->normals);
  Renumber(to, kept, &mesh->colors);
}

std::uint64_t Cell(glm::vec3 p, const Bounds& bounds, float cell) {
  std::uint64_t key = 0;
  for (int i = 0; i < 3; ++i)
    key = key << 12 | static_cast<std::uint64_t>((p[i] - bounds.low[i]) / cell);
  return key;
}

float CellSide(const Bounds& bounds, int cells) {
  const glm::vec3 size = bounds.high - bounds.low;
  return std::max({size.x, size.y, size.z}) / static_cast<float>(cells);
}

Mesh Cluster(const Mesh& mesh, const ColorList& colors, const Bounds& bounds, int cells) {
  const float cell = CellSide(bounds, cells);
  return JoinCorners(mesh, colors, [&](std::size_t f, int k) {
    const auto v = static_cast<std::size_t>(mesh.faces[f][static_cast<std::size_t>(k)]);
    return Cell(mesh.positions[v], bounds, cell) << 24 | MaterialOf(mesh, f);
  });
}

// The vertices of a cell become the first of them, at the mean of their corners.
void JoinVertices(const Bounds& bounds, int cells, Mesh* mesh) {
  const float cell = CellSide(bounds, cells);
  std::unordered_map<std::uint64_t, std::int32_t> first;
  std::vector<VertexSum> sums(mesh->positions.size());
  for (Face& face : mesh->faces) {
    for (std::int32_t& v : face) {
      const glm::vec3 p = mesh->positions[static_cast<std::size_t>(v)];
      v = first.try_emplace(Cell(p, bounds, cell), v).first->second;
      VertexSum& sum = sums[static_cast<std::size_t>(v)];
      sum.position += p;
      sum.count += 1;
    }
  }
  for (std::size_t v = 0; v < sums.size(); ++v) {
    if (sums[v].count > 0) mesh->positions[v] = sums[v].position / sums[v].count;
  }
}

// Drops faces that have no area or duplicate another; false if no others are left.
bool DropSpentFaces(Mesh* mesh) {
  std::set<Face> seen;
  std::vector<char> keep;
  for (const Face& face : mesh->faces)
    keep.push_back(!Collapsed(face) && seen.insert(FromItsLeast(face)).second);
  return KeepFaces(keep, mesh);
}

}  // namespace

Mesh MakeTruthMesh(const Mesh& mesh, std::size_t max_faces) {
  const ColorList colors = CornerColors(mesh);
  Mesh out;
  if (mesh.faces.size() <= max_faces) {
    out = JoinCorners(mesh, colors, [&](std::size_t f, int k) {
      return static_cast<std::uint64_t>(mesh.faces[f][static_cast<std::size_t>(k)]) << 24 |
             MaterialOf(mesh, f);
    });
  } else {
    const Bounds bounds = MeshBounds(mesh);
    int cells = 160;
    do {
      out = Cluster(mesh, colors, bounds, cells);
      cells = std::max(1, cells * 4 / 5);
    } while (out.faces.size() > max_faces);
  }
  DropUnused(&out);
  return out;
}

void ClusterFaces(std::size_t max_faces, Mesh* mesh) {
  if (mesh->faces.size() <= max_faces) return;
  const Bounds bounds = MeshBounds(*mesh);
  auto textures = std::exchange(mesh->textures, {});  // not to be copied each time
  for (int cells = 160; mesh->faces.size() > max_faces && cells > 1; cells = cells * 4 / 5) {
    Mesh joined = *mesh;
    JoinVertices(bounds, cells, &joined);
    if (!DropSpentFaces(&joined)) break;
    *mesh = std::move(joined);
  }
  mesh->textures = std::move(textures);
  DropUnused(mesh);
}

std::uint64_t GeometryFingerprint(const Mesh& mesh) {
  std::vector<std::uint64_t> hashes(mesh.positions.size());
  for (std::size_t v = 0; v < hashes.size(); ++v) {
    for (int i = 0; i < 3; ++i) {
      const auto coordinate = std::lround(mesh.positions[v][i] * 1e4f);
      hashes[v] = Mix64(hashes[v] ^ static_cast<std::uint64_t>(coordinate));
    }
  }
  std::uint64_t sum = 0;
  for (const Face& face : mesh.faces) {
    // A sum over corners, then over faces: no order matters.
    std::uint64_t corners = 0;
    for (std::int32_t v : face) corners += hashes[static_cast<std::size_t>(v)];
    sum += Mix64(corners);
  }
  return sum == 0 ? 1 : sum;
}

}  // namespace tilegrad::train
