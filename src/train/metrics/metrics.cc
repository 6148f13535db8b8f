// SPDX-License-Identifier: Apache-2.0
#include "train/metrics/metrics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "base/rng.h"

namespace tilegrad::train {
namespace {

struct OneWay {
  double mean = 0, share = 0;  // of the distances; within the threshold
};

OneWay Measure(std::span<const glm::vec3> from, const NearestPoint& to, double threshold) {
  OneWay out;
  for (const glm::vec3& point : from) {
    const double distance = std::sqrt(to.Find(glm::dvec3(point)).squared);
    out.mean += distance;
    out.share += distance <= threshold;
  }
  const double n = static_cast<double>(from.size());
  return {out.mean / n, out.share / n};
}

glm::dvec3 Corner(const Mesh& mesh, const Face& face, std::size_t k) {
  return glm::dvec3(mesh.positions[static_cast<std::size_t>(face[k])]);
}

constexpr int kBinomial[3] = {1, 2, 1};

// The response at an inner pixel of one plane.
double Response(const float* plane, int width, int x, int y) {
  double blurred = 0;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i)
      blurred +=
          kBinomial[j] * kBinomial[i] * static_cast<double>(plane[(y + j - 1) * width + x + i - 1]);
  }
  return static_cast<double>(plane[y * width + x]) - blurred / 16;
}

bool Counts(std::span<const std::uint8_t> covered, int width, int x, int y) {
  if (covered.empty()) return true;
  for (int j = y - 1; j <= y + 1; ++j) {
    const auto row = covered.begin() + std::ptrdiff_t{j} * width + x - 1;
    if (std::count(row, row + 3, 0) > 0) return false;
  }
  return true;
}

Status CheckPicture(const PlanarPicture& p, std::span<const std::uint8_t> covered) {
  if (p.channels < 1 || p.height < 0 || p.width < 0)
    return InvalidArgument("high-pass energy: a picture of {} channels, {} x {} pixels", p.channels,
                           p.width, p.height);
  const auto pixels = static_cast<std::size_t>(p.height) * static_cast<std::size_t>(p.width);
  if (p.values.size() != pixels * static_cast<std::size_t>(p.channels) ||
      (!covered.empty() && covered.size() != pixels)) {
    return InvalidArgument(
        "high-pass energy: {} values and {} marks for {} channels of {} x {} pixels",
        p.values.size(), covered.size(), p.channels, p.width, p.height);
  }
  const auto finite = [](float x) { return std::isfinite(x); };
  if (std::all_of(p.values.begin(), p.values.end(), finite)) return {};
  return InvalidArgument("high-pass energy: a value of the picture is not finite");
}

}  // namespace

double VoxelIou(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  assert(a.size() == b.size());
  std::size_t both = 0, either = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    both += a[i] != 0 && b[i] != 0;
    either += a[i] != 0 || b[i] != 0;
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

Result<std::vector<SurfaceSample>> SampleFaces(std::span<const double> areas, int count,
                                               std::uint64_t seed) {
  if (count < 0) return InvalidArgument("the number of points must not be negative");
  std::vector<double> area_up_to;
  double sum = 0;
  for (const double area : areas) area_up_to.push_back(sum += area);
  if (!(sum > 0) || !std::isfinite(sum)) return InvalidArgument("the surface has no area");
  Rng rng(seed);
  std::vector<SurfaceSample> samples;
  samples.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    // Uniform() < 1 and rounding could still give `sum` itself, hence the last face.
    const auto at = std::upper_bound(area_up_to.begin(), area_up_to.end() - 1, rng.Uniform() * sum);
    // Uniform in a triangle: the square root makes the density even (Osada et al.: Shape
    // distributions, 2002).
    const double r1 = rng.Uniform(), r2 = rng.Uniform(), u = std::sqrt(r1);
    samples.push_back(
        {static_cast<std::int32_t>(at - area_up_to.begin()), {1 - u, u * (1 - r2), u * r2}});
  }
  return samples;
}

Result<std::vector<glm::vec3>> SampleSurface(const Mesh& mesh, int count, std::uint64_t seed) {
  TILEGRAD_TRY(Validate(mesh));
  std::vector<double> areas;
  for (const Face& face : mesh.faces) {
    const glm::dvec3 a = Corner(mesh, face, 0);
    areas.push_back(glm::length(glm::cross(Corner(mesh, face, 1) - a, Corner(mesh, face, 2) - a)));
  }
  TILEGRAD_ASSIGN(const auto samples, SampleFaces(areas, count, seed));
  std::vector<glm::vec3> points;
  points.reserve(samples.size());
  for (const SurfaceSample& s : samples) {
    const Face& face = mesh.faces[static_cast<std::size_t>(s.face)];
    points.emplace_back(s.weights[0] * Corner(mesh, face, 0) +
                        s.weights[1] * Corner(mesh, face, 1) +
                        s.weights[2] * Corner(mesh, face, 2));
  }
  return points;
}

SurfaceScore CompareSurfaces(std::span<const glm::vec3> predicted, std::span<const glm::vec3> truth,
                             double threshold) {
  if (predicted.empty() || truth.empty()) return {};
  const OneWay forth = Measure(predicted, NearestPoint(truth), threshold);
  const OneWay back = Measure(truth, NearestPoint(predicted), threshold);
  const double sum = forth.share + back.share;
  return {.chamfer = 0.5 * (forth.mean + back.mean),
          .precision = forth.share,
          .recall = back.share,
          .f_score = sum > 0 ? 2 * forth.share * back.share / sum : 0};
}

Result<double> HighPassEnergy(const PlanarPicture& picture, std::span<const std::uint8_t> covered) {
  TILEGRAD_TRY(CheckPicture(picture, covered));
  const std::ptrdiff_t plane = std::ptrdiff_t{picture.height} * picture.width;
  double sum = 0;
  std::int64_t count = 0;
  for (int y = 1; y + 1 < picture.height; ++y) {
    for (int x = 1; x + 1 < picture.width; ++x) {
      if (!Counts(covered, picture.width, x, y)) continue;
      for (int c = 0; c < picture.channels; ++c) {
        const double r = Response(picture.values.data() + c * plane, picture.width, x, y);
        sum += r * r;
      }
      count += picture.channels;
    }
  }
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

}  // namespace tilegrad::train
