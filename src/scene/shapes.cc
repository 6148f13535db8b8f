// SPDX-License-Identifier: Apache-2.0
#include "scene/shapes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

namespace tilegrad {
namespace {

// Twelve vertices (0, +-1, +-phi) and cyclic, and the twenty faces over them.
const double kPhi = std::numbers::phi;
const glm::dvec3 kIcosahedron[12] = {{-1, kPhi, 0}, {1, kPhi, 0}, {-1, -kPhi, 0}, {1, -kPhi, 0},
                                     {0, -1, kPhi}, {0, 1, kPhi}, {0, -1, -kPhi}, {0, 1, -kPhi},
                                     {kPhi, 0, -1}, {kPhi, 0, 1}, {-kPhi, 0, -1}, {-kPhi, 0, 1}};
const Face kIcosahedronFaces[20] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                    {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                    {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                    {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};

glm::vec3 OnCircle(float radius, float y, int i, int segments) {
  const double angle = 2 * std::numbers::pi * i / segments;
  return {radius * std::cos(angle), y,
          -radius * std::sin(angle)};  // counter-clockwise seen from above
}

// Faces between two rings of `segments` vertices; `lower` and `upper` are the first indices.
void BridgeRings(Mesh& mesh, std::int32_t lower, std::int32_t upper, int segments) {
  for (int i = 0; i < segments; ++i) {
    const int j = (i + 1) % segments;
    mesh.faces.push_back({lower + i, lower + j, upper + j});
    mesh.faces.push_back({lower + i, upper + j, upper + i});
  }
}

// A fan from `apex` over a ring; `up`: the outside is above.
void FanRing(Mesh& mesh, std::int32_t apex, std::int32_t ring, int segments, bool up) {
  for (int i = 0; i < segments; ++i) {
    const int j = (i + 1) % segments;
    if (up)
      mesh.faces.push_back({apex, ring + i, ring + j});
    else
      mesh.faces.push_back({apex, ring + j, ring + i});
  }
}

template <class T>
void AppendFilled(std::vector<T>& to, std::size_t to_size, const std::vector<T>& from,
                  std::size_t from_size, T fill) {
  if (to.empty() && from.empty()) return;
  to.resize(to_size, fill);
  to.insert(to.end(), from.begin(), from.end());
  to.resize(to_size + from_size, fill);
}

// Twice the area, along the normal; in double, where no float coordinates overflow or underflow.
glm::dvec3 FaceNormal(const Mesh& mesh, const Face& face) {
  const glm::dvec3 a(mesh.positions[face[0]]);
  return glm::cross(glm::dvec3(mesh.positions[face[1]]) - a,
                    glm::dvec3(mesh.positions[face[2]]) - a);
}

glm::vec3 UnitOrZ(const glm::dvec3& n) {
  const double length = glm::length(n);
  return length > 0 ? glm::vec3(n / length) : glm::vec3(0, 0, 1);
}

std::vector<glm::vec3> FlatCornerNormals(const Mesh& mesh) {
  std::vector<glm::vec3> out;
  for (const Face& face : mesh.faces) out.insert(out.end(), 3, UnitOrZ(FaceNormal(mesh, face)));
  return out;
}

void AppendMaterials(Mesh& mesh, const Mesh& other, std::size_t faces_before) {
  const auto textures = static_cast<int>(mesh.textures.size());
  if (mesh.materials.empty() && other.materials.empty()) return;
  if (mesh.materials.empty()) mesh.materials.emplace_back();
  const auto first = static_cast<std::int32_t>(mesh.materials.size());
  mesh.face_materials.resize(faces_before, 0);
  for (std::size_t f = 0; f < other.faces.size(); ++f) {
    mesh.face_materials.push_back(first +
                                  (other.face_materials.empty() ? 0 : other.face_materials[f]));
  }
  mesh.materials.insert(mesh.materials.end(), other.materials.begin(), other.materials.end());
  if (other.materials.empty()) mesh.materials.emplace_back();
  for (auto m = static_cast<std::size_t>(first); m < mesh.materials.size(); ++m) {
    if (mesh.materials[m].base_color_texture >= 0) mesh.materials[m].base_color_texture += textures;
  }
  mesh.textures.insert(mesh.textures.end(), other.textures.begin(), other.textures.end());
}

// Colours of vertices as corner_colors; white where there are none.
void ColorsToCorners(Mesh& mesh) {
  if (!mesh.corner_colors.empty()) return;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face)
      mesh.corner_colors.push_back(mesh.colors.empty() ? glm::vec4(1) : mesh.colors[v]);
  }
  mesh.colors.clear();
}

// In the order of SplitFaces.
std::vector<glm::vec2> SplitCorners(const std::vector<glm::vec2>& uvs) {
  std::vector<glm::vec2> out;
  out.reserve(uvs.size() * 4);
  for (std::size_t i = 0; i < uvs.size(); i += 3) {
    const glm::vec2 a = uvs[i], b = uvs[i + 1], c = uvs[i + 2];
    const glm::vec2 ab = 0.5f * (a + b), bc = 0.5f * (b + c), ca = 0.5f * (c + a);
    out.insert(out.end(), {a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca});
  }
  return out;
}

struct CornerUv {
  float u, v;
  bool pole;
};

CornerUv UvOf(glm::vec3 p) {
  const double radius = std::sqrt(static_cast<double>(p.x) * p.x + static_cast<double>(p.y) * p.y +
                                  static_cast<double>(p.z) * p.z);
  const double u = 0.5 + std::atan2(-static_cast<double>(p.z), static_cast<double>(p.x)) /
                             (2 * std::numbers::pi);
  const double v = 0.5 + std::asin(std::clamp(p.y / radius, -1.0, 1.0)) / std::numbers::pi;
  return {static_cast<float>(u), static_cast<float>(v),
          std::hypot(p.x, p.z) < 1e-6f * static_cast<float>(radius)};
}

// Corners of one face, all on one side of the seam.
void Unwrap(std::array<CornerUv, 3>* corners) {
  float largest = 0, sum = 0;
  int others = 0;
  for (const CornerUv& c : *corners) {
    if (!c.pole) largest = std::max(largest, c.u);
  }
  for (CornerUv& c : *corners) {
    if (c.pole) continue;
    if (largest - c.u > 0.5f) c.u += 1;
    sum += c.u;
    ++others;
  }
  for (CornerUv& c : *corners) {
    if (c.pole && others > 0) c.u = sum / static_cast<float>(others);
  }
}

glm::dvec3 DirectionAt(double u, double v) {
  const double turn = 2 * std::numbers::pi * (u - 0.5), up = std::numbers::pi * (v - 0.5);
  return {std::cos(turn) * std::cos(up), std::sin(up), -std::sin(turn) * std::cos(up)};
}

// The normals of the planes through the origin and each edge of a face.
struct FaceCone {
  std::array<glm::dvec3, 3> sides;
  glm::dvec3 WeightsAt(const glm::dvec3& d) const {
    return {glm::dot(d, sides[0]), glm::dot(d, sides[1]), glm::dot(d, sides[2])};
  }
};

FaceCone ConeOf(const Mesh& sphere, const Face& face) {
  const auto corner = [&](std::size_t k) {
    return glm::dvec3(sphere.positions[static_cast<std::size_t>(face[k])]);
  };
  const glm::dvec3 a = corner(0), b = corner(1), c = corner(2);
  return {{glm::cross(b, c), glm::cross(c, a), glm::cross(a, b)}};
}

// The point on the face that the ray hits; on an edge rounding may put the ray slightly outside of
// every face.
SurfacePoint PointAt(const Mesh& sphere, const std::vector<FaceCone>& cones, const glm::dvec3& d) {
  std::size_t best = 0;
  double inside = -std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < cones.size(); ++f) {
    const glm::dvec3 w = cones[f].WeightsAt(d);
    const double least =
        std::min({w.x, w.y, w.z}) / (std::abs(w.x) + std::abs(w.y) + std::abs(w.z));
    if (least > inside) {
      inside = least;
      best = f;
    }
  }
  const glm::dvec3 w = glm::max(cones[best].WeightsAt(d), glm::dvec3(0));
  const double sum = w.x + w.y + w.z;
  return {static_cast<std::int32_t>(best),
          sphere.faces[best],
          {static_cast<float>(w.x / sum), static_cast<float>(w.y / sum),
           static_cast<float>(w.z / sum)}};
}

}  // namespace

Mesh Icosphere(int level, float radius) {
  std::vector<glm::dvec3> points;
  for (const glm::dvec3& p : kIcosahedron) points.push_back(glm::normalize(p));
  std::vector<Face> faces(std::begin(kIcosahedronFaces), std::end(kIcosahedronFaces));
  const auto middle = [&points](std::int32_t a, std::int32_t b) {
    points.push_back(
        glm::normalize(points[static_cast<std::size_t>(a)] + points[static_cast<std::size_t>(b)]));
    return static_cast<std::int32_t>(points.size() - 1);
  };
  for (int i = 0; i < level; ++i) faces = SplitFaces(faces, middle);
  Mesh mesh;
  for (const glm::dvec3& p : points) mesh.positions.emplace_back(p * static_cast<double>(radius));
  mesh.faces = std::move(faces);
  return mesh;
}

Mesh Box(glm::vec3 centre, glm::vec3 size) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    const glm::vec3 sign(i & 1 ? 0.5f : -0.5f, i & 2 ? 0.5f : -0.5f, i & 4 ? 0.5f : -0.5f);
    mesh.positions.push_back(centre + sign * size);
  }
  mesh.faces = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return mesh;
}

Mesh Frustum(glm::vec3 centre, float radius_bottom, float radius_top, float height, int segments) {
  Mesh mesh;
  const float low = -0.5f * height, high = 0.5f * height;
  for (int i = 0; i < segments; ++i)
    mesh.positions.push_back(OnCircle(radius_bottom, low, i, segments));
  const bool cone = radius_top <= 0;
  if (!cone) {
    for (int i = 0; i < segments; ++i)
      mesh.positions.push_back(OnCircle(radius_top, high, i, segments));
    BridgeRings(mesh, 0, segments, segments);
  }
  const auto bottom = static_cast<std::int32_t>(mesh.positions.size());
  mesh.positions.emplace_back(0, low, 0);
  mesh.positions.emplace_back(0, high, 0);
  FanRing(mesh, bottom, 0, segments, false);
  FanRing(mesh, bottom + 1, cone ? 0 : segments, segments, true);
  for (glm::vec3& p : mesh.positions) p += centre;
  return mesh;
}

Mesh Torus(float major, float minor, int major_segments, int minor_segments) {
  Mesh mesh;
  for (int i = 0; i < minor_segments; ++i) {
    const double angle = 2 * std::numbers::pi * i / minor_segments;
    const auto radius = static_cast<float>(major + minor * std::cos(angle));
    const auto y = static_cast<float>(minor * std::sin(angle));
    for (int j = 0; j < major_segments; ++j)
      mesh.positions.push_back(OnCircle(radius, y, j, major_segments));
  }
  for (int i = 0; i < minor_segments; ++i) {
    BridgeRings(mesh, i * major_segments, (i + 1) % minor_segments * major_segments,
                major_segments);
  }
  return mesh;
}

Mesh UvSphere(float radius, int rings, int segments) {
  Mesh mesh;
  for (int i = 1; i < rings; ++i) {
    const double angle = std::numbers::pi * i / rings;
    const auto ring = static_cast<float>(radius * std::sin(angle));
    const auto y = static_cast<float>(-radius * std::cos(angle));
    for (int j = 0; j < segments; ++j) mesh.positions.push_back(OnCircle(ring, y, j, segments));
  }
  for (int i = 0; i + 2 < rings; ++i) BridgeRings(mesh, i * segments, (i + 1) * segments, segments);
  const auto pole = static_cast<std::int32_t>(mesh.positions.size());
  mesh.positions.emplace_back(0, -radius, 0);
  mesh.positions.emplace_back(0, radius, 0);
  FanRing(mesh, pole, 0, segments, false);
  FanRing(mesh, pole + 1, (rings - 2) * segments, segments, true);
  return mesh;
}

void SetColor(Mesh& mesh, glm::vec4 color) { mesh.colors.assign(mesh.positions.size(), color); }

void Append(Mesh& mesh, const Mesh& other) {
  const std::size_t v0 = mesh.positions.size(), v1 = other.positions.size();
  const std::size_t f0 = mesh.faces.size(), f1 = other.faces.size();
  if (v0 == 0 && f0 == 0) {
    mesh = other;
    return;
  }
  if (mesh.corner_colors.empty() != other.corner_colors.empty()) {
    ColorsToCorners(mesh);
    if (other.corner_colors.empty()) {
      Mesh copy = other;
      ColorsToCorners(copy);
      return Append(mesh, copy);
    }
  }
  AppendFilled(mesh.corner_colors, 3 * f0, other.corner_colors, 3 * f1, glm::vec4(1));
  AppendFilled(mesh.colors, v0, other.colors, v1, glm::vec4(1));
  AppendFilled(mesh.corner_uvs, 3 * f0, other.corner_uvs, 3 * f1, glm::vec2(0));
  const bool vertex_normals = !mesh.normals.empty() || !other.normals.empty();
  const bool corner_normals = !mesh.corner_normals.empty() || !other.corner_normals.empty();
  if (vertex_normals) {
    if (mesh.normals.empty()) mesh.normals = SmoothNormals(mesh);
    const auto more = other.normals.empty() ? SmoothNormals(other) : other.normals;
    mesh.normals.insert(mesh.normals.end(), more.begin(), more.end());
  }
  if (corner_normals) {
    if (mesh.corner_normals.empty()) mesh.corner_normals = FlatCornerNormals(mesh);
    const auto more =
        other.corner_normals.empty() ? FlatCornerNormals(other) : other.corner_normals;
    mesh.corner_normals.insert(mesh.corner_normals.end(), more.begin(), more.end());
  }
  AppendMaterials(mesh, other, f0);
  const auto offset = static_cast<std::int32_t>(v0);
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& [a, b, c] : other.faces)
    mesh.faces.push_back({a + offset, b + offset, c + offset});
}

void Transform(Mesh& mesh, const std::array<glm::vec3, 3>& linear, glm::vec3 offset) {
  const glm::dmat3 m(linear[0], linear[1], linear[2]);
  // The cofactor matrix: the inverse transpose up to a positive or negative factor, defined for
  // singular m too.
  const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  const bool mirrored = glm::determinant(m) < 0;
  const auto turn = [&](glm::vec3& n) {
    const glm::dvec3 turned = (mirrored ? -1.0 : 1.0) * (cofactor * glm::dvec3(n));
    const double length = glm::length(turned);
    if (length > 0) n = glm::vec3(turned / length);
  };
  for (glm::vec3& p : mesh.positions) p = glm::vec3(m * glm::dvec3(p) + glm::dvec3(offset));
  for (glm::vec3& n : mesh.normals) turn(n);
  for (glm::vec3& n : mesh.corner_normals) turn(n);
  if (!mirrored) return;
  // A mirror turns faces inside out: restore counter-clockwise order, with the corners' attributes.
  for (Face& face : mesh.faces) std::swap(face[1], face[2]);
  const auto turn_corners = [](auto& values) {
    for (std::size_t i = 0; i < values.size(); i += 3) std::swap(values[i + 1], values[i + 2]);
  };
  turn_corners(mesh.corner_uvs);
  turn_corners(mesh.corner_colors);
  turn_corners(mesh.corner_normals);
}

std::vector<glm::vec3> SmoothNormals(const Mesh& mesh) {
  std::vector<glm::dvec3> sums(mesh.positions.size(), glm::dvec3(0));
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) sums[v] += FaceNormal(mesh, face);
  }
  std::vector<glm::vec3> out;
  out.reserve(sums.size());
  for (const glm::dvec3& n : sums) out.push_back(UnitOrZ(n));
  return out;
}

std::vector<Face> SplitFaces(const std::vector<Face>& faces,
                             FunctionRef<std::int32_t(std::int32_t a, std::int32_t b)> middle) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> known;
  const auto between = [&](std::int32_t a, std::int32_t b) {
    const std::pair<std::int32_t, std::int32_t> edge = std::minmax(a, b);
    const auto at = known.find(edge);
    if (at != known.end()) return at->second;
    return known[edge] = middle(edge.first, edge.second);
  };
  std::vector<Face> out;
  out.reserve(faces.size() * 4);
  for (const auto& [a, b, c] : faces) {
    const std::int32_t ab = between(a, b), bc = between(b, c), ca = between(c, a);
    out.insert(out.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
  }
  return out;
}

Mesh Subdivided(const Mesh& mesh) {
  Mesh out;
  out.positions = mesh.positions;
  out.colors = mesh.colors;
  if (mesh.materials.size() == 1) {
    out.corner_uvs = SplitCorners(mesh.corner_uvs);
    out.materials = mesh.materials;
    out.textures = mesh.textures;
  }
  out.faces = SplitFaces(mesh.faces, [&](std::int32_t a, std::int32_t b) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
    out.positions.push_back(0.5f * (out.positions[i] + out.positions[j]));
    if (!out.colors.empty()) out.colors.push_back(0.5f * (out.colors[i] + out.colors[j]));
    return static_cast<std::int32_t>(out.positions.size() - 1);
  });
  return out;
}

std::vector<SurfacePoint> SphereTexels(const Mesh& sphere, int width, int height) {
  std::vector<FaceCone> cones;
  cones.reserve(sphere.faces.size());
  for (const Face& face : sphere.faces) cones.push_back(ConeOf(sphere, face));
  std::vector<SurfacePoint> points;
  points.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j)
      points.push_back(
          PointAt(sphere, cones, DirectionAt((j + 0.5) / width, 1 - (i + 0.5) / height)));
  }
  return points;
}

std::vector<glm::vec2> SphereUvs(const Mesh& sphere) {
  std::vector<glm::vec2> uvs;
  uvs.reserve(3 * sphere.faces.size());
  for (const Face& face : sphere.faces) {
    std::array<CornerUv, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = UvOf(sphere.positions[static_cast<std::size_t>(face[k])]);
    }
    Unwrap(&corners);
    for (const CornerUv& c : corners) uvs.emplace_back(c.u, c.v);
  }
  return uvs;
}

}  // namespace tilegrad
