// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/hull_mesh.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "base/error.h"
#include "base/parallel.h"
#include "base/union_find.h"
#include "base/whole_number.h"
#include "fit/hull/hollows.h"
#include "fit/hull/mask_distance.h"
#include "fit/input.h"
#include "fit/sphere.h"
#include "scene/level_set.h"
#include "scene/simplify.h"
#include "scene/topology.h"

namespace tilegrad::train {
namespace {

constexpr int kBlock = 8;           // points along a side of what is decided as one
constexpr int kCoarseSide = 64;     // points along a side of the cube that is searched first
constexpr float kSlack = 1.5f;      // pixels: of distances, which are not exact, and of lenses
constexpr float kFirstSide = 6.0f;  // of the search, in radii of the sphere that masks suggest
constexpr int kMostDoublings = 3;   // of the side
constexpr float kBorderCells = 3;   // cells between the hull and the grid's border
constexpr float kOutside = -1, kInside = 1;  // where no distance is needed, in cells

struct View {
  Camera camera;
  MaskDistance distance;

  // Depth, and pixels: see tilegrad/camera.h.
  glm::vec3 Project(glm::vec3 p) const {
    const float *r = camera.rotation, *t = camera.translation;
    const float x = r[0] * p.x + r[1] * p.y + r[2] * p.z + t[0];
    const float y = r[3] * p.x + r[4] * p.y + r[5] * p.z + t[1];
    const float depth = -(r[6] * p.x + r[7] * p.y + r[8] * p.z + t[2]);
    return {camera.cx + camera.fx * x / depth, camera.cy - camera.fy * y / depth, depth};
  }
  float focal() const { return std::max(std::abs(camera.fx), std::abs(camera.fy)); }
};

struct Box {
  glm::vec3 low{HUGE_VALF}, high{-HUGE_VALF};
  void Add(glm::vec3 p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  bool empty() const { return !(low.x <= high.x); }
};

enum class Verdict { kOut, kIn, kMixed };

class Carver {
 public:
  Carver(const FitInput& input, const CarveOptions& options, const Workers& workers,
         const Watch& watch)
      : workers_(workers),
        watch_(watch),
        views_(input.training.size()),
        margin_(static_cast<float>(options.margin_pixels)) {
    forgiven_ = static_cast<std::size_t>(options.tolerance * static_cast<double>(views_.size()));
    forgiven_ = std::min(forgiven_, views_.size() - 1);
    workers.For(views_.size(), [&](std::size_t i, std::size_t) {
      if (watch.stopped()) return;
      const auto v = static_cast<std::size_t>(input.training[i]);
      const std::size_t plane = input.images.pixels();
      views_[i] = {input.cameras[v],
                   DistanceOf(std::span(input.images.outline()).subspan(v * plane, plane),
                              input.images.width, input.images.height)};
    });
  }

  // World units of a pixel, the mean over the views, at a point.
  float PixelAt(glm::vec3 point) const {
    float sum = 0;
    for (const View& v : views_) sum += v.Project(point).z / v.focal();
    return sum / static_cast<float>(views_.size());
  }

  ScalarGrid Fill(glm::vec3 low, float cell, std::array<int, 3> size) const {
    ScalarGrid grid{size, low, cell, {}};
    grid.values.assign(grid.At(size[0] - 1, size[1] - 1, size[2] - 1) + 1, kOutside * cell);
    std::array<std::size_t, 3> blocks;
    for (std::size_t a = 0; a < 3; ++a)
      blocks[a] = static_cast<std::size_t>((size[a] + kBlock - 1) / kBlock);
    workers_.For(blocks[0] * blocks[1] * blocks[2], [&](std::size_t i, std::size_t) {
      if (watch_.stopped()) return;
      const std::size_t z = i % blocks[2], y = i / blocks[2] % blocks[1],
                        x = i / blocks[2] / blocks[1];
      FillBlock({static_cast<int>(x) * kBlock, static_cast<int>(y) * kBlock,
                 static_cast<int>(z) * kBlock},
                &grid);
    });
    return grid;
  }

  // What a ball around a point is known to be.
  Verdict Judge(glm::vec3 centre, float radius) const {
    std::size_t outside = 0, not_inside = 0;
    for (const View& v : views_) {
      const glm::vec3 at = v.Project(centre);
      const float near = at.z - radius;
      if (at.z + radius <= v.camera.near_plane) {
        ++outside;
        ++not_inside;
        continue;
      }
      if (near <= v.camera.near_plane) {
        ++not_inside;
        continue;
      }
      // Off the axis a ball's image is longer than its radius; the slant bounds by how much.
      const float slant =
          1 + std::hypot((at.x - v.camera.cx) / v.camera.fx, (at.y - v.camera.cy) / v.camera.fy);
      const float reach = radius * v.focal() * slant / near + kSlack + margin_;
      const float d = v.distance.At(at.x, at.y);
      outside += d < -reach;
      not_inside += d < reach;
    }
    if (outside > forgiven_) return Verdict::kOut;
    return not_inside <= forgiven_ ? Verdict::kIn : Verdict::kMixed;
  }

 private:
  void FillBlock(const std::array<int, 3>& from, ScalarGrid* grid) const {
    std::array<int, 3> to;
    for (std::size_t a = 0; a < 3; ++a) to[a] = std::min(from[a] + kBlock, grid->size[a]);
    const auto point = [&](float i, float j, float k) {
      return grid->low + grid->cell * glm::vec3(i, j, k);
    };
    constexpr float kHalf = 0.5f * (kBlock - 1);
    const glm::vec3 centre =
        point(static_cast<float>(from[0]) + kHalf, static_cast<float>(from[1]) + kHalf,
              static_cast<float>(from[2]) + kHalf);
    const Verdict verdict = Judge(centre, kHalf * std::sqrt(3.0f) * grid->cell);
    if (verdict == Verdict::kOut) return;
    std::vector<float> least;
    for (int i = from[0]; i < to[0]; ++i) {
      for (int j = from[1]; j < to[1]; ++j) {
        for (int k = from[2]; k < to[2]; ++k) {
          grid->values[grid->At(i, j, k)] =
              verdict == Verdict::kIn ? kInside * grid->cell
                                      : Depth(point(static_cast<float>(i), static_cast<float>(j),
                                                    static_cast<float>(k)),
                                              &least);
        }
      }
    }
  }

  // How far inside of the hull, world units.
  float Depth(glm::vec3 p, std::vector<float>* least) const {
    least->clear();  // the forgiven_ + 1 least, ascending
    for (const View& v : views_) {
      const glm::vec3 at = v.Project(p);
      const float d = at.z > v.camera.near_plane
                          ? (v.distance.At(at.x, at.y) + margin_) * at.z / v.focal()
                          : -HUGE_VALF;
      if (least->size() > forgiven_ && !(d < least->back())) continue;
      least->insert(std::upper_bound(least->begin(), least->end(), d), d);
      if (least->size() > forgiven_ + 1) least->pop_back();
    }
    return std::isfinite(least->back()) ? least->back() : kOutside;
  }

  const Workers& workers_;
  const Watch& watch_;
  std::vector<View> views_;
  float margin_;
  std::size_t forgiven_ = 0;
};

// Where the hull may be, on a coarse grid of balls over a cube around `middle`.
Box SearchCells(const Carver& carver, glm::vec3 middle, float side, const Workers& workers) {
  const float step = side / kCoarseSide, radius = 0.5f * std::sqrt(3.0f) * step;
  const auto centre = [&](int i, int j, int k) {
    return middle - 0.5f * side + step * (glm::vec3(i, j, k) + 0.5f);
  };
  std::vector<Box> layers(kCoarseSide);
  workers.For(kCoarseSide, [&](std::size_t x, std::size_t) {
    for (int j = 0; j < kCoarseSide; ++j) {
      for (int k = 0; k < kCoarseSide; ++k) {
        const glm::vec3 c = centre(static_cast<int>(x), j, k);
        if (carver.Judge(c, radius) == Verdict::kOut) continue;
        layers[x].Add(c - 0.5f * step);
        layers[x].Add(c + 0.5f * step);
      }
    }
  });
  Box box;
  for (const Box& b : layers) {
    if (b.empty()) continue;
    box.Add(b.low);
    box.Add(b.high);
  }
  return box;
}

// Twice, so that the second grid is fine where the hull is.
Box FindHull(const Carver& carver, const Sphere& sphere, const Workers& workers) {
  float side = kFirstSide * sphere.radius;
  Box box = SearchCells(carver, sphere.centre, side, workers);
  const auto touches = [&] {
    const glm::vec3 reach =
        glm::max(glm::abs(box.low - sphere.centre), glm::abs(box.high - sphere.centre));
    return std::max({reach.x, reach.y, reach.z}) > 0.499f * side;
  };
  for (int i = 0; i < kMostDoublings && !box.empty() && touches(); ++i) {
    side *= 2;
    box = SearchCells(carver, sphere.centre, side, workers);
  }
  if (box.empty()) return box;
  const glm::vec3 extent = box.high - box.low;
  return SearchCells(carver, 0.5f * (box.low + box.high), std::max({extent.x, extent.y, extent.z}),
                     workers);
}

// Along the longest side. Cameras that differ wildly can ask for cells far below what the images
// resolve, and for minutes of work: no more than two images' width of them.
float MostCells(const FitInput& input, const CarveOptions& options) {
  const float pixels = static_cast<float>(2 * std::max(input.images.width, input.images.height));
  return std::min(static_cast<float>(options.most_cells),
                  pixels / static_cast<float>(options.cell_pixels));
}

Status NothingLeft() {
  return InvalidArgument(
      "no point lies inside of all masks, so there is no visual hull: check cameras and masks, "
      "raise --mask-tolerance, or use --start sphere");
}

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

// Of vertices.
UnionFind PartsOf(const Mesh& mesh) {
  UnionFind parts(mesh.positions.size());
  for (const Face& f : mesh.faces) {
    for (std::size_t k = 1; k < 3; ++k)
      parts.Join(static_cast<std::size_t>(f[0]), static_cast<std::size_t>(f[k]));
  }
  return parts;
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
  UnionFind parts = PartsOf(*mesh);
  std::vector<double> volumes(mesh->positions.size(), 0.0);
  const auto part = [&](const Face& f) { return parts.Of(static_cast<std::size_t>(f[0])); };
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
  UnionFind parts = PartsOf(mesh);
  std::size_t vertices = 0, count = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (!used[v]) continue;
    ++vertices;
    count += parts.Of(v) == v;
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

Result<ScalarGrid> Carve(const FitInput& input, const CarveOptions& options, const Workers& workers,
                         const Watch& watch) {
  const Progress carving = {"carving the visual hull", 0, 0, ""};
  TILEGRAD_TRY(watch.At(carving));
  TILEGRAD_ASSIGN(const Sphere sphere, GuessSphere(input));
  const Carver carver(input, options, workers, watch);
  TILEGRAD_TRY(watch.At(carving));
  const Box box = FindHull(carver, sphere, workers);
  if (box.empty()) return NothingLeft();
  const glm::vec3 extent = box.high - box.low, middle = 0.5f * (box.low + box.high);
  const float longest = std::max({extent.x, extent.y, extent.z});
  const float cell = std::max(static_cast<float>(options.cell_pixels) * carver.PixelAt(middle),
                              longest / MostCells(input, options));
  if (!(cell > 0 && std::isfinite(cell))) {
    return InvalidArgument(
        "the visual hull is {:.3g} across, in cells of {:.3g}: check the cameras", longest, cell);
  }
  std::array<int, 3> size;
  for (int a = 0; a < 3; ++a)
    size[static_cast<std::size_t>(a)] =
        WholeNumber<int>(std::ceil(extent[a] / cell + 2 * kBorderCells)) + 1;
  const glm::vec3 points(size[0] - 1, size[1] - 1, size[2] - 1);
  TILEGRAD_TRY(watch.At(carving));
  ScalarGrid grid = carver.Fill(middle - 0.5f * cell * points, cell, size);
  TILEGRAD_TRY(watch.At(carving));
  if (std::none_of(grid.values.begin(), grid.values.end(), [](float v) { return v > 0; }))
    return NothingLeft();
  return grid;
}

}  // namespace tilegrad::train
