// SPDX-License-Identifier: Apache-2.0
// The meshes of fingerprint_cases.h, made of whole numbers by whole numbers: the same everywhere.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "api/fingerprint_cases.h"

namespace tilegrad::test {

// Whole numbers that look random. Each array has a stream of its own, so that a change of one
// leaves the others.
class Integers {
 public:
  explicit Integers(std::uint64_t stream) : state_(stream * 0x9e3779b97f4a7c15u + 1) { Next(0, 1); }

  int Next(int low, int high) {  // both included
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return low + static_cast<int>((state_ >> 33) % static_cast<std::uint64_t>(high - low + 1));
  }

 private:
  std::uint64_t state_;
};

using Point = std::array<int, 3>;  // 1024ths

struct IntegerMesh {
  std::vector<Point> points;
  std::vector<std::int32_t> faces;

  void AddFace(const Point& a, const Point& b, const Point& c) {
    for (const Point& p : {a, b, c}) {
      faces.push_back(static_cast<std::int32_t>(points.size()));
      points.push_back(p);
    }
  }
};

// An octahedron of size^2 faces a side, swollen to about a sphere of radius 1, and bumpy.
class BallMaker {
 public:
  BallMaker(int size, std::uint64_t stream) : size_(size), integers_(stream) {}

  IntegerMesh Make() {
    for (int octant = 0; octant < 8; ++octant) {
      for (int a = 0; a < size_; ++a) {
        for (int b = 0; a + b < size_; ++b) AddCell(octant, a, b);
      }
    }
    return std::move(mesh_);
  }

 private:
  void AddCell(int octant, int a, int b) {
    AddFace(octant, {Lattice(a + 1, b), Lattice(a, b + 1), Lattice(a, b)});
    if (a + b + 2 > size_) return;
    AddFace(octant, {Lattice(a + 1, b), Lattice(a + 1, b + 1), Lattice(a, b + 1)});
  }
  Point Lattice(int a, int b) const { return {a, b, size_ - a - b}; }

  // Mirrored octants turn their faces, so that all look outwards.
  void AddFace(int octant, std::array<Point, 3> corners) {
    const int signs[] = {octant & 1 ? -1 : 1, octant & 2 ? -1 : 1, octant & 4 ? -1 : 1};
    if (signs[0] * signs[1] * signs[2] < 0) std::swap(corners[1], corners[2]);
    for (Point& p : corners) {
      for (std::size_t i = 0; i < 3; ++i) p[i] *= signs[i];
      mesh_.faces.push_back(Vertex(p));
    }
  }
  std::int32_t Vertex(const Point& lattice) {
    const auto next = static_cast<std::int32_t>(mesh_.points.size());
    const auto [at, is_new] = vertices_.emplace(lattice, next);
    if (is_new) mesh_.points.push_back(Swollen(lattice));
    return at->second;
  }
  // The factor is 1 / length at corners of the octahedron and in the middle of its sides.
  Point Swollen(const Point& p) {
    const std::int64_t n = size_, bump = integers_.Next(975, 1024);
    const std::int64_t square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    Point out;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int64_t scaled = p[i] * (2148 * n * n - 1124 * square) / (n * n * n);
      out[i] = static_cast<int>(scaled * bump / 1024);
    }
    return out;
  }

  int size_;
  Integers integers_;
  IntegerMesh mesh_;
  std::map<Point, std::int32_t> vertices_;
};

inline Point PointNear(const Point& centre, int extent, Integers* integers) {
  Point out;
  for (std::size_t i = 0; i < 3; ++i) out[i] = centre[i] + integers->Next(-extent, extent);
  return out;
}

// Faces of corners that lie within `extent` of a centre that lies within `room` of a middle.
struct Cloud {
  Point middle;
  int room, extent;
};

inline IntegerMesh MakeCloud(int size, const Cloud& cloud, std::uint64_t stream) {
  Integers integers(stream);
  IntegerMesh mesh;
  for (int f = 0; f < size; ++f) {
    const Point centre = PointNear(cloud.middle, cloud.room, &integers);
    const Point a = PointNear(centre, cloud.extent, &integers);
    const Point b = PointNear(centre, cloud.extent, &integers);
    mesh.AddFace(a, b, PointNear(centre, cloud.extent, &integers));
  }
  return mesh;
}

inline constexpr Cloud kSoupCloud{{0, 0, 0}, 700, 450};
inline constexpr Cloud kCloudAroundCamera{{0, 0, -900}, 1500, 1100};

inline void AddBrokenFaces(IntegerMesh* mesh) {
  const int far = 60 * 1024, wide = 1000 * 1024;
  mesh->AddFace({0, 0, 0}, {0, 0, 0}, {0, 0, 0});                        // a point
  mesh->AddFace({-800, -500, 0}, {0, 0, 0}, {800, 500, 0});              // a line
  mesh->AddFace({300, 300, 100}, {301, 300, 100}, {300, 301, 100});      // tiny
  mesh->AddFace({-wide, 100, -300}, {wide, 110, -300}, {wide, 130, 0});  // a long sliver
  mesh->AddFace({far, 0, 0}, {far + 900, 0, 0}, {far, 900, 0});          // beside the image
  mesh->AddFace({0, 0, far}, {900, 0, far}, {0, 900, far});              // behind the camera
  mesh->AddFace({-wide, -wide, -far}, {-far, wide, -far}, {-far, -far, -wide});  // huge
  for (const int i : {0, 1, 2, 5, 4, 3, 0, 0, 1})
    mesh->faces.push_back(i);  // twice, turned, an edge
}

inline IntegerMesh MakeMesh(Shape shape, int size, std::uint64_t stream) {
  switch (shape) {
    case Shape::kBall:
      return BallMaker(size, stream).Make();
    case Shape::kSoup:
      return MakeCloud(size, kSoupCloud, stream);
    case Shape::kAround:
      return MakeCloud(size, kCloudAroundCamera, stream);
    case Shape::kBroken:
      break;
  }
  IntegerMesh mesh = MakeCloud(size, kSoupCloud, stream);
  AddBrokenFaces(&mesh);
  return mesh;
}

}  // namespace tilegrad::test
