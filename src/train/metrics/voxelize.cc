// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "base/error.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train {
namespace {

using glm::dvec3;

constexpr int kMaxResolution = 512;

// One direction of the separating axis test: the triangle's interval, and the half-width of a unit
// voxel's.
struct GridAxis {
  dvec3 direction;
  double low, high, radius;

  bool Separates(dvec3 centre) const {
    const double c = glm::dot(direction, centre);
    return c + radius < low || c - radius > high;
  }
};

// The triangle's normal and the nine products of its edges with the box's edges (Akenine-Moller:
// Fast 3D triangle-box overlap testing). The box's own axes are the loop over the bounding box.
std::array<GridAxis, 10> SeparatingAxes(const Triangle& corners) {
  std::array<GridAxis, 10> axes;
  std::size_t n = 0;
  const auto add = [&](dvec3 d) {
    const double p[3] = {glm::dot(d, corners[0]), glm::dot(d, corners[1]), glm::dot(d, corners[2])};
    axes[n++] = {d, std::min({p[0], p[1], p[2]}), std::max({p[0], p[1], p[2]}),
                 0.5 * (std::abs(d.x) + std::abs(d.y) + std::abs(d.z))};
  };
  add(glm::cross(corners[1] - corners[0], corners[2] - corners[0]));
  for (std::size_t k = 0; k < 3; ++k) {
    const dvec3 e = corners[(k + 1) % 3] - corners[k];
    add({0, -e.z, e.y});
    add({e.z, 0, -e.x});
    add({-e.y, e.x, 0});
  }
  return axes;
}

// A cube of voxels with one empty layer around it, from which carving starts.
class Grid {
 public:
  explicit Grid(int n)
      : n_(n), side_(static_cast<std::size_t>(n) + 2), state_(side_ * side_ * side_, kUnknown) {}

  void MarkSurface(const Triangle& corners) {
    const auto axes = SeparatingAxes(corners);
    const dvec3 low = glm::min(glm::min(corners[0], corners[1]), corners[2]);
    const dvec3 high = glm::max(glm::max(corners[0], corners[1]), corners[2]);
    int first[3], last[3];
    for (int i = 0; i < 3; ++i) {
      if (high[i] < 0 || low[i] >= n_) return;
      first[i] = static_cast<int>(std::clamp(std::floor(low[i]), 0.0, n_ - 1.0));
      last[i] = static_cast<int>(std::clamp(std::floor(high[i]), 0.0, n_ - 1.0));
    }
    for (int x = first[0]; x <= last[0]; ++x) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int z = first[2]; z <= last[2]; ++z) {
          const dvec3 centre(x + 0.5, y + 0.5, z + 0.5);
          const bool apart = std::any_of(axes.begin(), axes.end(), [&](const GridAxis& axis) {
            return axis.Separates(centre);
          });
          if (!apart) state_[Index(x, y, z)] = kSurface;
        }
      }
    }
  }

  void MarkPoint(const dvec3& p) {
    const dvec3 at = glm::floor(p);
    if (glm::any(glm::lessThan(at, dvec3(0))) || glm::any(glm::greaterThanEqual(at, dvec3(n_))))
      return;
    state_[Index(static_cast<int>(at.x), static_cast<int>(at.y), static_cast<int>(at.z))] =
        kSurface;
  }

  // N3MR's: where lines along `axis` through corners of voxels meet the triangle.
  void MarkLines(const Triangle& corners, int axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const dvec3 a = corners[1] - corners[0], b = corners[2] - corners[0];
    const double area = a[u] * b[v] - a[v] * b[u];
    if (area == 0) return;
    const auto [first_u, last_u] = LinesAcross(corners, u);
    const auto [first_v, last_v] = LinesAcross(corners, v);
    for (int i = first_u; i <= last_u; ++i) {
      for (int j = first_v; j <= last_v; ++j) {
        const double du = i - corners[0][u], dv = j - corners[0][v];
        const double s = (du * b[v] - dv * b[u]) / area, t = (dv * a[u] - du * a[v]) / area;
        if (s < 0 || t < 0 || s + t > 1) continue;
        dvec3 met;
        met[axis] = corners[0][axis] + s * a[axis] + t * b[axis];
        MarkAround(met, {u, i}, {v, j});
      }
    }
  }

  // Everything that a path over voxel faces joins to the corner of the empty layer.
  void CarveOutside() {
    std::vector<std::array<int, 3>> open = {{-1, -1, -1}};
    state_[Index(-1, -1, -1)] = kOutside;
    while (!open.empty()) {
      const auto at = open.back();
      open.pop_back();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (int step : {-1, 1}) {
          auto next = at;
          next[axis] += step;
          if (next[axis] < -1 || next[axis] > n_) continue;
          auto& state = state_[Index(next[0], next[1], next[2])];
          if (state != kUnknown) continue;
          state = kOutside;
          open.push_back(next);
        }
      }
    }
  }

  // Everything that rays along the axes see from outside, but for the voxel before the surface.
  void CarveAlongAxes() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (int u = 0; u < n_; ++u) {
        for (int v = 0; v < n_; ++v) {
          std::array<int, 3> at{};
          at[(axis + 1) % 3] = u;
          at[(axis + 2) % 3] = v;
          CarveRay(at, axis, false);
          CarveRay(at, axis, true);
        }
      }
    }
  }

  std::vector<std::uint8_t> Surface() const {
    return Where([](State s) { return s == kSurface; });
  }
  std::vector<std::uint8_t> Solid() const {
    return Where([](State s) { return s != kOutside; });
  }

 private:
  enum State : std::uint8_t { kUnknown, kSurface, kOutside };

  // Numbers of the lines from 0 to n_ that the triangle spans across an axis.
  std::pair<int, int> LinesAcross(const Triangle& corners, int axis) const {
    const double low = std::min({corners[0][axis], corners[1][axis], corners[2][axis]}),
                 high = std::max({corners[0][axis], corners[1][axis], corners[2][axis]});
    return {static_cast<int>(std::ceil(std::clamp(low, 0.0, n_ + 0.5))),
            static_cast<int>(std::floor(std::clamp(high, -0.5, double(n_))))};
  }

  // The four voxels around a line, at the height of `met`.
  struct Line {
    int axis, number;
  };
  void MarkAround(dvec3 met, const Line& first, const Line& second) {
    for (const double i : {-0.5, 0.5}) {
      for (const double j : {-0.5, 0.5}) {
        met[first.axis] = first.number + i;
        met[second.axis] = second.number + j;
        MarkPoint(met);
      }
    }
  }

  // Along `axis` from its low or its high end; `at` says where across it.
  void CarveRay(std::array<int, 3> at, std::size_t axis, bool from_high) {
    const auto state = [&](int i) -> State& {
      at[axis] = from_high ? n_ - 1 - i : i;
      return state_[Index(at[0], at[1], at[2])];
    };
    int met = 0;
    while (met < n_ && state(met) != kSurface) ++met;
    const int end = met == n_ ? n_ : met - 1;
    for (int i = 0; i < end; ++i) state(i) = kOutside;
  }

  template <class Wanted>
  std::vector<std::uint8_t> Where(const Wanted& wanted) const {
    std::vector<std::uint8_t> out;
    out.reserve(state_.size());
    for (int x = 0; x < n_; ++x) {
      for (int y = 0; y < n_; ++y) {
        for (int z = 0; z < n_; ++z) out.push_back(wanted(state_[Index(x, y, z)]));
      }
    }
    return out;
  }

  // -1 and n_ are the empty layer.
  std::size_t Index(int x, int y, int z) const {
    return (static_cast<std::size_t>(x + 1) * side_ + static_cast<std::size_t>(y + 1)) * side_ +
           static_cast<std::size_t>(z + 1);
  }

  int n_;
  std::size_t side_;
  std::vector<State> state_;
};

// A surface exactly on a border of voxels must belong to one side only, or boxes would come out a
// voxel too fat. So all is moved by less than a thousandth of a voxel, in such a way that no
// integer stays one: x -> x (1 - a) + b with b no multiple of a.
dvec3 OffBorders(const dvec3& p, double n) { return p * (1 - 9.6e-4 / n) + 4.75e-4; }

Status CheckResolution(int resolution) {
  if (resolution >= 1 && resolution <= kMaxResolution) return {};
  return InvalidArgument("the resolution must be in [1, {}], got {}", kMaxResolution, resolution);
}

// The surface of a mesh that fills the grid's cube.
Result<Grid> GridOf(const Mesh& mesh, int resolution) {
  TILEGRAD_TRY(CheckResolution(resolution));
  TILEGRAD_TRY(Validate(mesh));
  if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
  const Bounds bounds = MeshBounds(mesh);
  const dvec3 low(bounds.low), size = dvec3(bounds.high) - low;
  const double longest = std::max({size.x, size.y, size.z});
  if (!(longest > 0)) return InvalidArgument("the mesh has no extent");
  const double n = resolution;
  const dvec3 centre = low + 0.5 * size;
  Grid grid(resolution);
  for (const Face& face : mesh.faces) {
    Triangle corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const dvec3 p(mesh.positions[static_cast<std::size_t>(face[k])]);
      corners[k] = OffBorders((p - centre) * (n / longest) + 0.5 * n, n);
    }
    grid.MarkSurface(corners);
  }
  return grid;
}

}  // namespace

Result<std::vector<std::uint8_t>> SurfaceVoxels(std::span<const Triangle> surface, int resolution) {
  TILEGRAD_TRY(CheckResolution(resolution));
  Grid grid(resolution);
  for (Triangle face : surface) {
    for (dvec3& p : face) p = OffBorders(p, resolution);
    grid.MarkSurface(face);
  }
  return grid.Surface();
}

Result<std::vector<std::uint8_t>> Voxelize(const Mesh& mesh, int resolution) {
  TILEGRAD_ASSIGN(Grid grid, GridOf(mesh, resolution));
  grid.CarveOutside();
  return grid.Solid();
}

Result<std::vector<std::uint8_t>> VoxelizeCarved(const Mesh& mesh, int resolution) {
  TILEGRAD_ASSIGN(Grid grid, GridOf(mesh, resolution));
  grid.CarveAlongAxes();
  return grid.Solid();
}

Result<std::vector<std::uint8_t>> VoxelizeNmr(const Mesh& mesh, double half_extent,
                                              int resolution) {
  TILEGRAD_TRY(CheckResolution(resolution));
  TILEGRAD_TRY(Validate(mesh));
  const double scale = (resolution - 1) / (2 * half_extent);
  Grid grid(resolution);
  for (const Face& face : mesh.faces) {
    Triangle corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const dvec3 p(mesh.positions[static_cast<std::size_t>(face[k])]);
      corners[k] = p * scale + 0.5 * resolution;
      grid.MarkPoint(corners[k]);
    }
    for (int axis = 0; axis < 3; ++axis) grid.MarkLines(corners, axis);
  }
  grid.CarveOutside();
  return grid.Solid();
}

Result<std::vector<std::uint8_t>> VoxelizePoints(std::span<const glm::vec3> points,
                                                 double half_extent, int resolution) {
  TILEGRAD_TRY(CheckResolution(resolution));
  Grid grid(resolution);
  for (const glm::vec3& p : points)
    grid.MarkPoint(
        OffBorders((dvec3(p) / (2 * half_extent) + 0.5) * double(resolution), resolution));
  grid.CarveOutside();
  return grid.Solid();
}

}  // namespace tilegrad::train
