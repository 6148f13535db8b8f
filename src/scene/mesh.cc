// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "base/error.h"

namespace tilegrad {
namespace {

Status CheckCount(const char* name, std::size_t got, std::size_t want, const char* of) {
  if (got == 0 || got == want) return {};
  return InvalidArgument("{} must be empty or have one entry per {} ({}), got {}", name, of, want,
                         got);
}

template <class Vec>
Status CheckFinite(const char* name, const std::vector<Vec>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (int c = 0; c < Vec::length(); ++c) {
      if (!std::isfinite(values[i][c])) {
        return InvalidArgument("{}[{}][{}] is {}; every number must be finite", name, i, c,
                               values[i][c]);
      }
    }
  }
  return {};
}

Status CheckFaces(const Mesh& mesh) {
  const auto count = static_cast<std::int64_t>(mesh.positions.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t index = mesh.faces[f][k];
      if (index < 0 || index >= count) {
        return InvalidArgument("faces[{}][{}] is {}, but there are {} vertices", f, k, index,
                               count);
      }
    }
  }
  return {};
}

Status CheckMaterials(const Mesh& mesh) {
  for (std::size_t f = 0; f < mesh.face_materials.size(); ++f) {
    const std::int32_t m = mesh.face_materials[f];
    if (m < 0 || static_cast<std::size_t>(m) >= mesh.materials.size()) {
      return InvalidArgument("face_materials[{}] is {}, but there are {} materials", f, m,
                             mesh.materials.size());
    }
  }
  for (std::size_t m = 0; m < mesh.materials.size(); ++m) {
    for (int c = 0; c < 4; ++c) {
      const float value = mesh.materials[m].base_color[c];
      if (std::isfinite(value)) continue;
      return InvalidArgument(
          "materials[{}] (\"{}\"): base_color[{}] is {}; every number must be finite", m,
          mesh.materials[m].name, c, value);
    }
    if (!std::isfinite(mesh.materials[m].alpha_cutoff)) {
      return InvalidArgument("materials[{}] (\"{}\"): alpha_cutoff is not finite", m,
                             mesh.materials[m].name);
    }
    const int t = mesh.materials[m].base_color_texture;
    if (t < -1 || t >= static_cast<int>(mesh.textures.size())) {
      return InvalidArgument("materials[{}] (\"{}\") names texture {}, but there are {}", m,
                             mesh.materials[m].name, t, mesh.textures.size());
    }
  }
  return {};
}

template <class T>
void Keep(std::vector<T>* values, const std::vector<char>& keep_face, std::size_t per_face) {
  if (values->empty()) return;
  std::size_t to = 0;
  for (std::size_t f = 0; f < keep_face.size(); ++f) {
    if (!keep_face[f]) continue;
    for (std::size_t k = 0; k < per_face; ++k) (*values)[to++] = (*values)[f * per_face + k];
  }
  values->resize(to);
}

}  // namespace

Status Validate(const Mesh& mesh) {
  const std::size_t vertices = mesh.positions.size(), faces = mesh.faces.size();
  TILEGRAD_TRY(CheckCount("normals", mesh.normals.size(), vertices, "vertex"));
  TILEGRAD_TRY(CheckCount("colors", mesh.colors.size(), vertices, "vertex"));
  TILEGRAD_TRY(CheckCount("corner_uvs", mesh.corner_uvs.size(), 3 * faces, "corner"));
  TILEGRAD_TRY(CheckCount("corner_normals", mesh.corner_normals.size(), 3 * faces, "corner"));
  TILEGRAD_TRY(CheckCount("corner_colors", mesh.corner_colors.size(), 3 * faces, "corner"));
  if (!mesh.colors.empty() && !mesh.corner_colors.empty())
    return InvalidArgument("the mesh has both colors and corner_colors; give one of them");
  TILEGRAD_TRY(CheckCount("face_materials", mesh.face_materials.size(), faces, "face"));
  TILEGRAD_TRY(CheckFaces(mesh));
  TILEGRAD_TRY(CheckMaterials(mesh));
  TILEGRAD_TRY(CheckFinite("positions", mesh.positions));
  TILEGRAD_TRY(CheckFinite("normals", mesh.normals));
  TILEGRAD_TRY(CheckFinite("colors", mesh.colors));
  TILEGRAD_TRY(CheckFinite("corner_colors", mesh.corner_colors));
  TILEGRAD_TRY(CheckFinite("corner_uvs", mesh.corner_uvs));
  return CheckFinite("corner_normals", mesh.corner_normals);
}

Bounds MeshBounds(const Mesh& mesh) {
  Bounds b{mesh.positions[mesh.faces[0][0]], mesh.positions[mesh.faces[0][0]]};
  for (const Face& face : mesh.faces) {
    for (std::int32_t v : face) {
      b.low = glm::min(b.low, mesh.positions[v]);
      b.high = glm::max(b.high, mesh.positions[v]);
    }
  }
  return b;
}

Status NormalizeToBox(Mesh& mesh, float half_extent) {
  if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
  const Bounds b = MeshBounds(mesh);
  // In double: the sum of two large coordinates must not overflow or cancel.
  const glm::dvec3 low(b.low), high(b.high), centre = 0.5 * (low + high), half = 0.5 * (high - low);
  const double largest = std::max({half.x, half.y, half.z});
  if (!(largest > 0)) return InvalidArgument("the mesh has no extent: all vertices coincide");
  for (glm::vec3& p : mesh.positions)
    p = glm::vec3((glm::dvec3(p) - centre) * (half_extent / largest));
  return {};
}

bool KeepFaces(const std::vector<char>& keep, Mesh* mesh) {
  if (std::all_of(keep.begin(), keep.end(), [](char k) { return k == 0; })) return false;
  Keep(&mesh->faces, keep, 1);
  Keep(&mesh->face_materials, keep, 1);
  Keep(&mesh->corner_uvs, keep, 3);
  Keep(&mesh->corner_colors, keep, 3);
  Keep(&mesh->corner_normals, keep, 3);
  return true;
}

void SetUnlit(Mesh& mesh, const std::string& name) {
  if (mesh.materials.empty()) mesh.materials = {{.name = name, .base_color = glm::vec4(1)}};
  for (Material& material : mesh.materials) material.unlit = true;
}

}  // namespace tilegrad
