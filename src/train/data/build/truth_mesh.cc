// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/truth_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <unordered_map>

#include "base/rng.h"
#include "render/picture/mesh_pictures.h"

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
    if (face[0] == face[1] || face[1] == face[2] || face[0] == face[2]) continue;
    // The same three corners in the same winding are one face.
    std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
    if (seen.insert(face).second) out.faces.push_back(face);
  }
  for (const VertexSum& sum : sums) {
    out.positions.push_back(sum.position / sum.count);
    out.colors.emplace_back(sum.color / sum.count, 1.0f);
  }
  return out;
}

// Vertices that no face uses any more go.
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
  Mesh out;
  out.positions.resize(static_cast<std::size_t>(kept));
  out.colors.resize(static_cast<std::size_t>(kept));
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (to[v] < 0) continue;
    out.positions[static_cast<std::size_t>(to[v])] = mesh->positions[v];
    out.colors[static_cast<std::size_t>(to[v])] = mesh->colors[v];
  }
  out.faces = std::move(mesh->faces);
  *mesh = std::move(out);
}

std::uint64_t Cell(glm::vec3 p, const Bounds& bounds, float cell) {
  std::uint64_t key = 0;
  for (int i = 0; i < 3; ++i) {
    key = key << 12 | static_cast<std::uint64_t>((p[i] - bounds.low[i]) / cell);
  }
  return key;
}

Mesh Cluster(const Mesh& mesh, const ColorList& colors, const Bounds& bounds, int cells) {
  const glm::vec3 size = bounds.high - bounds.low;
  const float cell = std::max({size.x, size.y, size.z}) / static_cast<float>(cells);
  return JoinCorners(mesh, colors, [&](std::size_t f, int k) {
    const auto v = static_cast<std::size_t>(mesh.faces[f][static_cast<std::size_t>(k)]);
    return Cell(mesh.positions[v], bounds, cell) << 24 | MaterialOf(mesh, f);
  });
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

std::uint64_t GeometryFingerprint(const Mesh& mesh) {
  std::uint64_t sum = 0;
  for (const Face& face : mesh.faces) {
    // A sum over corners, then over faces: no order matters.
    std::uint64_t corners = 0;
    for (std::int32_t v : face) {
      const glm::vec3 p = mesh.positions[static_cast<std::size_t>(v)];
      std::uint64_t hash = 0;
      for (int i = 0; i < 3; ++i) {
        hash = Mix64(hash ^ static_cast<std::uint64_t>(std::lround(p[i] * 1e4f)));
      }
      corners += hash;
    }
    sum += Mix64(corners);
  }
  return sum == 0 ? 1 : sum;
}

}  // namespace tilegrad::train
