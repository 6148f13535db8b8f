// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/hull_mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "base/error.h"
#include "fit/hull/hollows.h"
#include "scene/simplify.h"
#include "scene/topology.h"

namespace tilegrad::train {
namespace {

constexpr double kSpeckCells = 8;  // cells' volumes: parts of less are left out
// Taubin's two steps (A signal processing approach to fair surface design, 1995), which smooth what
// the grid left without shrinking.
constexpr float kShrink = 0.5f, kGrow = -0.53f;
constexpr int kSmoothings = 3;
// Leaves make hulls of thousands of handles, finer than what pixels show. Collapses remove none and
// end at about so many faces for each (a hedge: 4,552 handles, 56,770 faces).
constexpr std::size_t kFacesPerHandle = 12;
constexpr double kCoarser = 2;  // cells where that is too many, by the side of those asked for

void SmoothOnce(const Topology& topology, float factor, std::vector<glm::vec3>* positions) {
  const std::vector<glm::vec3> before(*positions);
  for (std::size_t v = 0; v < before.size(); ++v) {
    glm::vec3 sum(0);
    for (std::int32_t n = topology.offsets[v]; n < topology.offsets[v + 1]; ++n)
      sum += before[static_cast<std::size_t>(topology.neighbors[static_cast<std::size_t>(n)])];
    const auto count = static_cast<float>(topology.offsets[v + 1] - topology.offsets[v]);
    (*positions)[v] += factor * (sum / count - before[v]);
  }
}

void Smooth(Mesh* mesh) {
  const Topology topology = BuildTopology(mesh->faces, mesh->positions.size());
  for (int i = 0; i < kSmoothings; ++i) {
    SmoothOnce(topology, kShrink, &mesh->positions);
    SmoothOnce(topology, kGrow, &mesh->positions);
  }
}

// The part of each vertex, as the least vertex in it.
std::vector<std::int32_t> PartsOf(const Mesh& mesh) {
  std::vector<std::int32_t> parent(mesh.positions.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](std::int32_t v) {
    while (parent[static_cast<std::size_t>(v)] != v)
      v = parent[static_cast<std::size_t>(v)] =
          parent[static_cast<std::size_t>(parent[static_cast<std::size_t>(v)])];
    return v;
  };
  for (const Face& f : mesh.faces) {
    for (std::size_t k = 1; k < 3; ++k) {
      const auto [low, high] = std::minmax({find(f[0]), find(f[k])});
      parent[static_cast<std::size_t>(high)] = low;
    }
  }
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(parent.size()); ++v)
    parent[static_cast<std::size_t>(v)] = find(v);
  return parent;
}

// A corner, as seen from the first vertex, which keeps differences exact.
glm::dvec3 CornerAt(const Mesh& mesh, std::int32_t v) {
  return glm::dvec3(mesh.positions[static_cast<std::size_t>(v)] - mesh.positions[0]);
}

// Between a face and the first vertex, signed: the sum over a closed surface is what it encloses.
double VolumeBelow(const Mesh& mesh, const Face& f) {
  return glm::dot(CornerAt(mesh, f[0]), glm::cross(CornerAt(mesh, f[1]), CornerAt(mesh, f[2]))) / 6;
}

// World units.
double MeanThickness(const Mesh& mesh) {
  double volume = 0, area = 0;
  for (const Face& f : mesh.faces) {
    const glm::dvec3 a = CornerAt(mesh, f[0]);
    volume += VolumeBelow(mesh, f);
    area += 0.5 * glm::length(glm::cross(CornerAt(mesh, f[1]) - a, CornerAt(mesh, f[2]) - a));
  }
  return area > 0 ? 2 * volume / area : 0;
}

// Faces of parts that enclose more than `volume`, in size; hollows are parts that enclose less than
// nothing. The largest part stays in any case.
void DropSpecks(double volume, Mesh* mesh) {
  const std::vector<std::int32_t> parts = PartsOf(*mesh);
  std::vector<double> volumes(parts.size(), 0.0);
  const auto part = [&](const Face& f) {
    return static_cast<std::size_t>(parts[static_cast<std::size_t>(f[0])]);
  };
  for (const Face& f : mesh->faces) volumes[part(f)] += VolumeBelow(*mesh, f);
  double largest = 0;
  for (const double v : volumes) largest = std::max(largest, std::abs(v));
  std::erase_if(mesh->faces, [&](const Face& f) {
    return std::abs(volumes[part(f)]) < std::min(volume, largest);
  });
}

// Of a closed manifold, its parts' genus: (2 parts - V + E - F) / 2, and E = 3 F / 2. No collapse
// changes it.
std::size_t Handles(const Mesh& mesh) {
  std::vector<bool> used(mesh.positions.size(), false);
  for (const Face& f : mesh.faces) {
    for (const std::int32_t v : f) used[static_cast<std::size_t>(v)] = true;
  }
  const std::vector<std::int32_t> parts = PartsOf(mesh);
  std::size_t vertices = 0, count = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (!used[v]) continue;
    ++vertices;
    count += parts[v] == static_cast<std::int32_t>(v);
  }
  return (2 * count + mesh.faces.size() / 2 - vertices) / 2;
}

struct CarvedMesh {
  Mesh mesh;
  double cell = 0;  // world units
  bool hollow = false;
};

Result<CarvedMesh> CarveMesh(const FitInput& input, const CarveOptions& options,
                             const Workers& workers, const Watch& watch) {
  TILEGRAD_ASSIGN(ScalarGrid grid, Carve(input, options, workers, watch));
  TILEGRAD_ASSIGN(const bool hollow, CarveHollows(input, workers, watch, &grid));
  CarvedMesh out{LevelSet(grid), static_cast<double>(grid.cell), hollow};
  DropSpecks(kSpeckCells * std::pow(out.cell, 3), &out.mesh);
  return out;
}

}  // namespace

Result<Mesh> HullMesh(const FitInput& input, const HullOptions& options, const Workers& workers,
                      const Watch& watch, HullTraits* traits) {
  CarveOptions carve = options.carve;
  TILEGRAD_ASSIGN(CarvedMesh carved, CarveMesh(input, carve, workers, watch));
  if (Handles(carved.mesh) > options.most_faces / kFacesPerHandle) {
    carve.cell_pixels *= kCoarser;
    TILEGRAD_ASSIGN(carved, CarveMesh(input, carve, workers, watch));
  }
  Mesh& mesh = carved.mesh;
  Smooth(&mesh);
  // A cell is as many pixels as asked for, or more where the grid would be too large.
  const double pixel = carved.cell / carve.cell_pixels;
  if (traits != nullptr) *traits = {carved.hollow, MeanThickness(mesh) / pixel};
  const double patch = options.patch_pixels * pixel;
  const auto faces = static_cast<std::uint64_t>(mesh.faces.size());
  const auto told = [&watch, faces](std::size_t left) {
    return watch.At({"simplifying the visual hull", faces - left, faces, ""});
  };
  return Simplified(mesh, {.error = static_cast<float>(options.error_pixels * pixel),
                           .patch = static_cast<float>(patch * patch),
                           .longest = static_cast<float>(options.longest_pixels * pixel),
                           .most_faces = options.most_faces,
                           .told = told});
}

}  // namespace tilegrad::train
