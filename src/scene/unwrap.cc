// SPDX-License-Identifier: Apache-2.0
#include "scene/unwrap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <unordered_map>

#include "base/error.h"
#include "base/whole_number.h"
#include "scene/topology.h"

namespace tilegrad {
namespace {

constexpr int kSmoothings = 4;       // of normals before, and of labels after they are chosen
constexpr double kFirstFill = 0.85;  // fraction of the texture tried first
constexpr double kShrink = 0.94;     // of the scale, until charts fit
constexpr int kMostTries = 60;

// The two directions of a chart's plane; with its axis they make a right-handed system.
struct Plane {
  glm::dvec3 right, up, axis;
};
Plane PlaneOf(int label) {
  glm::dvec3 e[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const int a = label / 2;
  // Up is y if possible, so that people can read the texture.
  static constexpr int kRight[3] = {2, 0, 0}, kUp[3] = {1, 2, 1};
  Plane plane{e[kRight[a]], e[kUp[a]], label % 2 == 0 ? e[a] : -e[a]};
  if (glm::dot(glm::cross(plane.right, plane.up), plane.axis) < 0) plane.right = -plane.right;
  return plane;
}

struct Chart {
  std::vector<std::int32_t> faces;
  int label = 0;
  glm::dvec2 low{HUGE_VAL}, high{-HUGE_VAL};  // world units, in its plane
  int x = 0, y = 0, width = 0, height = 0;    // texels, with the gutter
};

// Neighbours of a face across its edges: -1 if there is none.
std::vector<std::array<std::int32_t, 3>> NeighborsOf(const Mesh& mesh) {
  std::vector<std::array<std::int32_t, 3>> out(mesh.faces.size(), {-1, -1, -1});
  const auto add = [&](std::int32_t face, std::int32_t other) {
    if (face < 0 || other < 0) return;
    for (std::int32_t& n : out[static_cast<std::size_t>(face)]) {
      if (n < 0) return void(n = other);
    }
  };
  for (const Edge& e : BuildTopology(mesh.faces, mesh.positions.size()).edges) {
    add(e.face0, e.face1);
    add(e.face1, e.face0);
  }
  return out;
}

class Unwrapping {
 public:
  Unwrapping(const UnwrapOptions& options, const Mesh& mesh)
      : options_(options), mesh_(mesh), neighbors_(NeighborsOf(mesh)), labels_(mesh.faces.size()) {
    for (const Face& f : mesh.faces) {
      const glm::dvec3 n = glm::cross(At(f[1]) - At(f[0]), At(f[2]) - At(f[0]));
      const double length = glm::length(n);
      for (std::size_t k = 0; k < 3; ++k)
        longest_ = std::max(longest_, glm::distance(At(f[k]), At(f[(k + 1) % 3])));
      areas_.push_back(length / 2);
      normals_.push_back(length > 0 ? n / length : glm::dvec3(0, 1, 0));
    }
    ChooseLabels();
  }

  Status Run(std::vector<glm::vec2>* uvs) {
    double area = 0;
    for (std::size_t f = 0; f < areas_.size(); ++f) area += areas_[f] * Cosine(f, labels_[f]);
    if (!(area > 0)) return InvalidArgument("the mesh has no area to unwrap");
    scale_ = std::min(std::sqrt(kFirstFill * options_.width * options_.height / area),
                      2 * std::max(options_.width, options_.height) / longest_);
    for (int i = 0; i < kMostTries; ++i, scale_ *= kShrink) {
      // Overlaps of faces depend little on the scale, so charts are made only twice.
      if (i % 10 == 0) MakeCharts();
      if (!Place()) continue;
      Write(uvs);
      return {};
    }
    return InvalidArgument("a texture of {} x {} has no room for {} charts: give it more texels",
                           options_.width, options_.height, charts_.size());
  }

 private:
  glm::dvec3 At(std::int32_t v) const { return mesh_.positions[static_cast<std::size_t>(v)]; }
  double Cosine(std::size_t face, int label) const {
    return label % 2 == 0 ? normals_[face][label / 2] : -normals_[face][label / 2];
  }
  static int LabelOf(const glm::dvec3& n) {
    int best = 0;
    for (int a = 1; a < 3; ++a)
      if (std::abs(n[a]) > std::abs(n[best])) best = a;
    return 2 * best + (n[best] < 0);
  }

  // By smoothed normals; then by the majority of the neighbours.
  void ChooseLabels() {
    std::vector<glm::dvec3> smooth(normals_);
    for (std::size_t f = 0; f < smooth.size(); ++f) smooth[f] *= areas_[f];
    for (int i = 0; i < kSmoothings; ++i) {
      const std::vector<glm::dvec3> before(smooth);
      for (std::size_t f = 0; f < smooth.size(); ++f)
        for (const std::int32_t n : neighbors_[f])
          if (n >= 0) smooth[f] += before[static_cast<std::size_t>(n)];
    }
    for (std::size_t f = 0; f < labels_.size(); ++f) {
      labels_[f] = LabelOf(smooth[f]);
      if (Cosine(f, labels_[f]) < kPreferred) labels_[f] = LabelOf(normals_[f]);
    }
    for (int i = 0; i < kSmoothings; ++i) SmoothLabels();
  }
  void SmoothLabels() {
    const std::vector<int> before(labels_);
    for (std::size_t f = 0; f < labels_.size(); ++f) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::int32_t a = neighbors_[f][k], b = neighbors_[f][(k + 1) % 3];
        if (a < 0 || b < 0) continue;
        const int label = before[static_cast<std::size_t>(a)];
        if (label == before[static_cast<std::size_t>(b)] && Cosine(f, label) > kLeastCosine)
          labels_[f] = label;
      }
    }
  }

  void MakeCharts() {
    charts_.clear();
    chart_of_.assign(labels_.size(), -1);
    for (std::size_t f = 0; f < labels_.size(); ++f)
      if (chart_of_[f] < 0) Grow(static_cast<std::int32_t>(f));
  }

  std::array<glm::dvec2, 3> InPlane(std::int32_t face, const Plane& plane) const {
    std::array<glm::dvec2, 3> out;
    const Face& f = mesh_.faces[static_cast<std::size_t>(face)];
    for (std::size_t k = 0; k < 3; ++k)
      out[k] = {glm::dot(At(f[k]), plane.right), glm::dot(At(f[k]), plane.up)};
    return out;
  }

  // Breadth first over faces of the seed's label that overlap no other of the chart.
  void Grow(std::int32_t seed) {
    Chart chart;
    chart.label = labels_[static_cast<std::size_t>(seed)];
    const Plane plane = PlaneOf(chart.label);
    const auto number = static_cast<std::int32_t>(charts_.size());
    std::unordered_map<std::uint64_t, std::int32_t> texels;
    std::deque<std::int32_t> open = {seed};
    chart_of_[static_cast<std::size_t>(seed)] = number;
    while (!open.empty()) {
      const std::int32_t face = open.front();
      open.pop_front();
      const auto corners = InPlane(face, plane);
      if (!Claim(corners, face, &texels)) {
        chart_of_[static_cast<std::size_t>(face)] = -1;  // another chart's
        continue;
      }
      chart.faces.push_back(face);
      for (const glm::dvec2& p : corners) {
        chart.low = glm::min(chart.low, p);
        chart.high = glm::max(chart.high, p);
      }
      for (const std::int32_t n : neighbors_[static_cast<std::size_t>(face)]) {
        const auto i = static_cast<std::size_t>(n);
        if (n < 0 || chart_of_[i] >= 0 || labels_[i] != chart.label) continue;
        chart_of_[i] = number;
        open.push_back(n);
      }
    }
    charts_.push_back(std::move(chart));
  }

  // Claims the texels whose centres are inside of the face; false, and claims none, if one is
  // taken.
  bool Claim(const std::array<glm::dvec2, 3>& corners, std::int32_t face,
             std::unordered_map<std::uint64_t, std::int32_t>* texels) {
    claimed_.clear();
    const std::array p = {corners[0] * scale_, corners[1] * scale_, corners[2] * scale_};
    const glm::dvec2 low = glm::min(glm::min(p[0], p[1]), p[2]),
                     high = glm::max(glm::max(p[0], p[1]), p[2]);
    const auto side = [&](std::size_t k, const glm::dvec2& c) {
      const glm::dvec2 e = p[(k + 1) % 3] - p[k], to = c - p[k];
      return e.x * to.y - e.y * to.x;
    };
    for (double y = std::ceil(low.y); y <= high.y; ++y) {
      for (double x = std::ceil(low.x); x <= high.x; ++x) {
        const glm::dvec2 c(x, y);
        if (!(side(0, c) > kBorder && side(1, c) > kBorder && side(2, c) > kBorder)) continue;
        const auto key = static_cast<std::uint64_t>(static_cast<std::int64_t>(x) + (1 << 30))
                             << 32 |
                         static_cast<std::uint64_t>(static_cast<std::int64_t>(y) + (1 << 30));
        if (texels->count(key)) return false;
        claimed_.push_back(key);
      }
    }
    for (const std::uint64_t key : claimed_) texels->emplace(key, face);
    return true;
  }

  // Fills shelves from the highest chart to the lowest; each chart goes on the first with room.
  bool Place() {
    struct Shelf {
      int y, height, x = 0;
    };
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      Chart& c = charts_[i];
      const glm::dvec2 size = (c.high - c.low) * scale_;
      c.width = WholeNumber<int>(std::ceil(size.x)) + 2 * options_.gutter;
      c.height = WholeNumber<int>(std::ceil(size.y)) + 2 * options_.gutter;
      order.push_back(i);
    }
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return -charts_[i].height; });
    std::vector<Shelf> shelves;
    int top = 0;
    for (const std::size_t i : order) {
      Chart& c = charts_[i];
      auto at = std::find_if(shelves.begin(), shelves.end(),
                             [&](const Shelf& s) { return s.x + c.width <= options_.width; });
      if (at == shelves.end()) {
        if (c.width > options_.width || top + c.height > options_.height) return false;
        shelves.push_back({top, c.height});
        top += c.height;
        at = shelves.end() - 1;
      }
      c.x = at->x;
      c.y = at->y;
      at->x += c.width;
    }
    return true;
  }

  void Write(std::vector<glm::vec2>* uvs) const {
    uvs->assign(3 * labels_.size(), glm::vec2(0));
    for (const Chart& c : charts_) {
      const Plane plane = PlaneOf(c.label);
      const glm::dvec2 origin = glm::dvec2(c.x, c.y) + static_cast<double>(options_.gutter);
      for (const std::int32_t face : c.faces) {
        const auto corners = InPlane(face, plane);
        for (std::size_t k = 0; k < 3; ++k) {
          const glm::dvec2 texel = origin + (corners[k] - c.low) * scale_;
          (*uvs)[3 * static_cast<std::size_t>(face) + k] = {texel.x / options_.width,
                                                            texel.y / options_.height};
        }
      }
    }
  }

  static constexpr double kPreferred = 0.5;  // cosine below which a face keeps its own axis
  static constexpr double kBorder = 1e-9;    // texels^2: a centre on an edge is in no face

  const UnwrapOptions options_;
  const Mesh& mesh_;
  std::vector<std::array<std::int32_t, 3>> neighbors_;
  std::vector<glm::dvec3> normals_;
  std::vector<double> areas_;
  std::vector<int> labels_;
  std::vector<Chart> charts_;
  std::vector<std::int32_t> chart_of_;
  std::vector<std::uint64_t> claimed_;
  double longest_ = 0;  // edge: slivers have no area, and Claim visits all texels around a face
  double scale_ = 1;
};

}  // namespace

Status Unwrap(const UnwrapOptions& options, Mesh* mesh) {
  constexpr int kLeast = 16, kMost = 1 << 14;
  if (options.width < kLeast || options.height < kLeast || options.width > kMost ||
      options.height > kMost || options.gutter < 0 || options.gutter > kLeast) {
    return InvalidArgument("a texture of {} x {} with a gutter of {}: sizes must be {} to {}",
                           options.width, options.height, options.gutter, kLeast, kMost);
  }
  TILEGRAD_TRY(Validate(*mesh));
  if (mesh->faces.empty()) return InvalidArgument("the mesh has no faces");
  return Unwrapping(options, *mesh).Run(&mesh->corner_uvs);
}

}  // namespace tilegrad
