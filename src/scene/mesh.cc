// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <numeric>

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

// turn(row) of each row of the rotation.
template <class Turn>
Camera WithRows(Camera camera, Turn turn) {
  for (float* row : {camera.rotation, camera.rotation + 3, camera.rotation + 6}) {
    const glm::vec3 turned = turn(glm::vec3(row[0], row[1], row[2]));
    std::copy_n(&turned[0], 3, row);
  }
  return camera;
}

constexpr std::size_t kMaxEarCorners = 256;

// Newell's method: the sum over all sides, which is robust for polygons that are not quite planar.
glm::dvec3 PolygonNormal(std::span<const glm::vec3> corners) {
  glm::dvec3 sum(0);
  const glm::dvec3 origin(corners[0]);
  for (std::size_t i = 0; i + 1 < corners.size(); ++i)
    sum += glm::cross(glm::dvec3(corners[i]) - origin, glm::dvec3(corners[i + 1]) - origin);
  return sum;
}

// Projects along the normal's largest component, so that the polygon is counter-clockwise.
std::vector<glm::dvec2> Flatten(std::span<const glm::vec3> corners) {
  const glm::dvec3 n = PolygonNormal(corners), a = glm::abs(n);
  const int drop = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
  const int u = (drop + 1) % 3, v = (drop + 2) % 3;
  const double sign = n[drop] < 0 ? -1 : 1;
  std::vector<glm::dvec2> flat;
  for (const glm::vec3& p : corners) flat.emplace_back(sign * p[u], p[v]);
  return flat;
}

double Cross(glm::dvec2 a, glm::dvec2 b, glm::dvec2 c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

class EarClipper {
 public:
  explicit EarClipper(std::span<const glm::vec3> corners)
      : points_(Flatten(corners)), left_(corners.size()) {
    std::iota(left_.begin(), left_.end(), 0);
  }

  void Run(std::vector<Face>& triangles) {
    while (left_.size() >= 3) {
      const std::size_t tip = FindEar();
      triangles.push_back({At(tip - 1), At(tip), At(tip + 1)});
      left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(tip % left_.size()));
    }
  }

 private:
  std::int32_t At(std::size_t i) const { return left_[i % left_.size()]; }

  // From 1 on, so that a convex polygon becomes the fan about corner 0. 1 where there is no ear.
  std::size_t FindEar() const {
    for (std::size_t tip = 1; tip <= left_.size(); ++tip) {
      if (IsEar(tip)) return tip;
    }
    return 1;
  }

  bool IsEar(std::size_t tip) const {
    const glm::dvec2 a = points_[At(tip - 1)], b = points_[At(tip)], c = points_[At(tip + 1)];
    if (Cross(a, b, c) <= 0) return false;
    return std::none_of(left_.begin(), left_.end(), [&](std::int32_t i) {
      const glm::dvec2 p = points_[i];
      if (p == a || p == b || p == c) return false;
      return Cross(a, b, p) >= 0 && Cross(b, c, p) >= 0 && Cross(c, a, p) >= 0;
    });
  }

  std::vector<glm::dvec2> points_;
  std::vector<std::int32_t> left_;  // corners not yet clipped, in order
};

// The distance that the eye needs along one view, and how far the mesh extends towards it.
struct Reach {
  double distance = 0, towards_eye = -1e300;
};

// A vertex at (x, y, z) in the camera's axes, relative to the centre, seen from distance d, is fx
// |x| / (d - z) pixels from the image centre.
Reach ReachOf(const Mesh& mesh, const Camera& camera, glm::dvec3 middle, const Framing& framing) {
  const double half_x = 0.5 * framing.lens.width * (1 - framing.margin) / camera.fx;
  const double half_y = 0.5 * framing.lens.height * (1 - framing.margin) / camera.fy;
  const float* r = camera.rotation;
  Reach reach;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) {
      const glm::dvec3 p = glm::dvec3(mesh.positions[v]) - middle;
      const double x = glm::dot(p, glm::dvec3(r[0], r[1], r[2]));
      const double y = glm::dot(p, glm::dvec3(r[3], r[4], r[5]));
      const double z = glm::dot(p, glm::dvec3(r[6], r[7], r[8]));
      reach.distance =
          std::max(reach.distance, z + std::max(std::abs(x) / half_x, std::abs(y) / half_y));
      reach.towards_eye = std::max(reach.towards_eye, z);
    }
  }
  return reach;
}

Camera MovedTo(Camera camera, glm::dvec3 middle, double distance) {
  const float* r = camera.rotation;
  const glm::dvec3 eye = middle + distance * glm::dvec3(r[6], r[7], r[8]);
  for (int i = 0; i < 3; ++i) {
    camera.translation[i] =
        static_cast<float>(-glm::dot(glm::dvec3(r[3 * i], r[3 * i + 1], r[3 * i + 2]), eye));
  }
  return camera;
}

Status Check(const Framing& framing, double extent) {
  const Lens& lens = framing.lens;
  if (!(lens.fov_y > 0 && lens.fov_y < 180))
    return InvalidArgument("a field of view of {} degrees; it must be between 0 and 180",
                           lens.fov_y);
  if (lens.width < 1 || lens.height < 1)
    return InvalidArgument("an image of {} x {} pixels", lens.width, lens.height);
  if (!(framing.margin >= 0 && framing.margin < 1))
    return InvalidArgument("a margin of {}; it must be in [0, 1)", framing.margin);
  if (!(framing.distance >= 0) || !std::isfinite(framing.distance))
    return InvalidArgument("a camera distance of {}; it must be 0 or above", framing.distance);
  if (!(extent > 0)) return InvalidArgument("the mesh has no extent, so no camera can frame it");
  return {};
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
  const auto left_out = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), 0));
  if (left_out == keep.size()) return false;
  if (left_out == 0) return true;
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

glm::vec3 Upright(UpAxis up, glm::vec3 v) {
  if (up == UpAxis::kZ) return {v.x, v.z, -v.y};
  if (up == UpAxis::kX) return {-v.y, v.x, v.z};
  return v;
}

std::optional<UpAxis> UpAxisNamed(std::string_view name) {
  if (name == "y" || name == "Y") return UpAxis::kY;
  if (name == "z" || name == "Z") return UpAxis::kZ;
  if (name == "x" || name == "X") return UpAxis::kX;
  return std::nullopt;
}

void TurnUpright(UpAxis up, Mesh* mesh) {
  if (up == UpAxis::kY) return;
  for (auto* vectors : {&mesh->positions, &mesh->normals, &mesh->corner_normals})
    for (glm::vec3& v : *vectors) v = Upright(up, v);
}

// The rows of a rotation are directions in the world.
Camera UprightCamera(UpAxis up, Camera camera) {
  return WithRows(camera, [&](glm::vec3 row) { return Upright(up, row); });
}

// A row r of the rotation meets Upright(v) as the row R^T r meets v.
Camera CameraOfFile(UpAxis up, Camera camera) {
  return WithRows(camera, [&](glm::vec3 r) {
    if (up == UpAxis::kZ) return glm::vec3(r.x, -r.z, r.y);
    return up == UpAxis::kX ? glm::vec3(r.y, -r.x, r.z) : r;
  });
}

void TriangulatePolygon(std::span<const glm::vec3> corners, std::vector<Face>& triangles) {
  triangles.clear();
  const std::size_t n = corners.size();
  if (n > 3 && n <= kMaxEarCorners) return EarClipper(corners).Run(triangles);
  for (std::int32_t k = 2; k < static_cast<std::int32_t>(n); ++k)
    triangles.push_back({0, k - 1, k});
}

Result<std::vector<Camera>> FrameMesh(const Mesh& mesh, const Framing& framing,
                                      std::span<const ViewAngle> views) {
  const Bounds bounds = MeshBounds(mesh);
  const glm::dvec3 low(bounds.low), high(bounds.high), middle = 0.5 * (low + high);
  const double extent = glm::length(high - low);
  TILEGRAD_TRY(Check(framing, extent));
  std::vector<Camera> cameras;
  Reach all;
  for (const ViewAngle& view : views) {
    cameras.push_back(OrbitCamera(framing.lens, view.azimuth, view.elevation, 1));
    const Reach reach = ReachOf(mesh, cameras.back(), middle, framing);
    all.distance = std::max(all.distance, reach.distance);
    all.towards_eye = std::max(all.towards_eye, reach.towards_eye);
  }
  // Otherwise the eye would touch a line that points towards it.
  const double distance = framing.distance > 0
                              ? framing.distance
                              : std::max(all.distance, all.towards_eye + 0.1 * extent);
  for (Camera& camera : cameras) {
    camera = MovedTo(camera, middle, distance);
    camera.near_plane =
        static_cast<float>(std::max(1e-4 * distance, 0.5 * (distance - all.towards_eye)));
  }
  return cameras;
}

}  // namespace tilegrad
