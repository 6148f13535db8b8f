// SPDX-License-Identifier: Apache-2.0
#include "fit/sphere.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "base/error.h"

namespace tilegrad::train {
namespace {

// Degrees: in a narrower cone axes say little about where they meet, and rays nothing.
constexpr double kAxesCone = 30, kLeastCone = 1;
// Half of a narrow cone of views of something small, as a tangent. What is seen under an angle
// needs as much more: masks of cameras that are less apart than it is wide meet up to infinity.
constexpr double kNarrowSlope = 0.268;
constexpr double kUsualRadius = 0.5;  // where nothing is known
constexpr double kFloatStep = 6e-8;   // of numbers, relative

struct Ray {
  glm::dvec3 from, along;
};

// A training view whose mask is not empty.
struct SeenView {
  const Camera& camera;
  const std::string& name;
  double area = 0, x = 0, y = 0;  // of the mask, pixels; its middle

  double focal() const { return std::sqrt(static_cast<double>(camera.fx) * camera.fy); }
  glm::dvec3 Row(int i) const {
    const float* r = camera.rotation + 3 * i;
    return {r[0], r[1], r[2]};
  }
  glm::dvec3 Place() const {
    glm::dvec3 c(0);
    for (int k = 0; k < 3; ++k) c -= static_cast<double>(camera.translation[k]) * Row(k);
    return c;
  }
  double DepthOf(const glm::dvec3& p) const {
    const float* r = camera.rotation + 6;
    return -(r[0] * p.x + r[1] * p.y + r[2] * p.z + static_cast<double>(camera.translation[2]));
  }
  Ray Axis() const { return {Place(), -Row(2)}; }
  Ray ThroughMask() const {
    const double right = (x - static_cast<double>(camera.cx)) / static_cast<double>(camera.fx),
                 down = (y - static_cast<double>(camera.cy)) / static_cast<double>(camera.fy);
    return {Place(), glm::normalize(right * Row(0) - down * Row(1) - Row(2))};
  }
};

SeenView ViewOf(const FitInput& input, std::size_t n) {
  SeenView view{input.cameras[n], input.names[n]};
  const std::size_t plane = input.images.pixels();
  const auto width = static_cast<std::size_t>(input.images.width);
  for (std::size_t p = 0; p < plane; ++p) {
    const double alpha = input.images.alpha[n * plane + p];
    view.area += alpha;
    view.x += alpha * (static_cast<double>(p % width) + 0.5);
    view.y += alpha * (static_cast<double>(p / width) + 0.5);
  }
  view.x /= view.area;
  view.y /= view.area;
  return view;
}

// sum over rays (c, d) of (1 - d d^T) (p - c) = 0
glm::dvec3 PointClosestTo(const std::vector<Ray>& rays) {
  glm::dmat3 sum(0);
  glm::dvec3 right(0);
  for (const auto& [c, d] : rays) {
    const glm::dmat3 across = glm::dmat3(1) - glm::outerProduct(d, d);
    sum += across;
    right += across * c;
  }
  sum += glm::dmat3(1e-9);
  return glm::inverse(sum) * right;
}

// The direction that lines have in common: which way along each is no matter.
glm::dvec3 CommonLine(const std::vector<Ray>& rays) {
  glm::dvec3 sum(0);
  for (const Ray& ray : rays)
    sum += glm::dot(ray.along, rays[0].along) < 0 ? -ray.along : ray.along;
  return glm::normalize(sum);
}

// Degrees across the cone that holds all lines.
double ConeOf(const std::vector<Ray>& rays) {
  const glm::dvec3 line = CommonLine(rays);
  double most = 0;
  for (const Ray& ray : rays)
    most = std::max(most, glm::length(glm::cross(ray.along, line)));  // sines
  return 2 * std::asin(std::min(most, 1.0)) * 180 / std::numbers::pi;
}

class Guess {
 public:
  explicit Guess(const FitInput& input) {
    for (const int i : input.training) {
      SeenView view = ViewOf(input, static_cast<std::size_t>(i));
      if (!(view.area > 0)) continue;
      axes_.push_back(view.Axis());
      rays_.push_back(view.ThroughMask());
      views_.push_back(std::move(view));
    }
  }

  Result<Sphere> Run() {
    if (views_.empty()) return InvalidArgument("all masks are empty: there is nothing to fit");
    FindCentre();
    TILEGRAD_TRY(CheckInFront());
    TILEGRAD_TRY(CheckPrecision());
    sphere_.centre = centre_;
    sphere_.radius = static_cast<float>(Radius());
    DoubtNarrowViews();
    return sphere_;
  }

 private:
  // Of the mean area, at the depth that depth(view) says.
  template <class Depth>
  double RadiusAt(const Depth& depth) const {
    double radius = 0;
    for (const SeenView& v : views_)
      radius += depth(v) / v.focal() * std::sqrt(v.area / std::numbers::pi);
    return radius / static_cast<double>(views_.size());
  }

  double Radius() const {
    return RadiusAt([&](const SeenView& v) { return v.DepthOf(centre_); });
  }

  bool IsInFront(const SeenView& v, const glm::dvec3& point) const {
    return v.DepthOf(point) > static_cast<double>(v.camera.near_plane);
  }
  bool InFrontOfAll(const glm::dvec3& point) const {
    return std::ranges::all_of(views_, [&](const SeenView& v) { return IsInFront(v, point); });
  }

  void FindCentre() {
    if (ConeOf(axes_) >= kAxesCone) {
      centre_ = PointClosestTo(axes_);
      if (InFrontOfAll(centre_)) return;
    }
    if (ConeOf(rays_) >= kLeastCone) {
      centre_ = PointClosestTo(rays_);
    } else {
      PlaceAlongRay();
    }
  }

  // Nearest to the world's origin if the views look there, else where the object has a usual size.
  void PlaceAlongRay() {
    glm::dvec3 from(0);
    for (const Ray& ray : rays_) from += ray.from / static_cast<double>(rays_.size());
    const glm::dvec3 along = CommonLine(rays_);
    centre_ = from + glm::dot(-from, along) * along;
    const auto looks_there = [&](const SeenView& v) {
      return IsInFront(v, centre_) && v.DepthOf(centre_) >= glm::length(centre_);
    };
    if (!std::ranges::all_of(views_, looks_there)) {
      double depth = kUsualRadius / RadiusAt([](const SeenView&) { return 1.0; });
      for (const SeenView& v : views_)
        depth = std::max(depth, 10 * static_cast<double>(v.camera.near_plane));
      centre_ = from + depth * along;
      if (!InFrontOfAll(centre_)) centre_ = from;  // they look at each other
    }
    sphere_.doubt = fmt::format(
        "all views see the object from one direction, so its distance is not known; assuming "
        "({:.3g}, {:.3g}, {:.3g}) and a radius of {:.3g}",
        centre_.x, centre_.y, centre_.z, Radius());
  }

  Status CheckInFront() const {
    const auto behind = [&](const SeenView& v) { return !IsInFront(v, centre_); };
    const auto first = std::ranges::find_if(views_, behind);
    if (first == views_.end()) return {};
    const double depth = first->DepthOf(centre_);
    if (depth > 0) {
      return InvalidArgument(
          "{}: this camera is only {:.3g} from the object, nearer than its near plane of {:.3g}: "
          "scale the cameras up",
          first->name, depth, first->camera.near_plane);
    }
    return InvalidArgument(
        "{}: this camera faces away from the object, as do {} of {}; are the axes OpenCV's, "
        "looking along +z? If not, the cameras do not match the masks: the rays through the masks' "
        "centres miss each other by {:.3g}",
        first->name, std::ranges::count_if(views_, behind), views_.size(), Miss());
  }

  // The mean distance of rays from the centre.
  double Miss() const {
    double sum = 0;
    for (const auto& [from, along] : rays_) sum += glm::length(glm::cross(centre_ - from, along));
    return sum / static_cast<double>(rays_.size());
  }

  // Positions, and what cameras make of them, are floats.
  Status CheckPrecision() const {
    const double far = std::max({std::abs(centre_.x), std::abs(centre_.y), std::abs(centre_.z)});
    for (const SeenView& v : views_) {
      const double size = std::max({far, std::abs(static_cast<double>(v.camera.translation[0])),
                                    std::abs(static_cast<double>(v.camera.translation[1]))});
      const double step = kFloatStep * size, pixel = v.DepthOf(centre_) / v.focal();
      if (step <= pixel) continue;
      return InvalidArgument(
          "{}: a pixel of this camera covers {:.3g} at the object, less than the float spacing of "
          "{:.3g} that far from the origin; move the cameras by ({:.6g}, {:.6g}, {:.6g})",
          v.name, pixel, step, -centre_.x, -centre_.y, -centre_.z);
    }
    return {};
  }

  // What all masks have in common is long where all views look one way.
  void DoubtNarrowViews() {
    std::vector<Ray> lines;
    for (const Ray& ray : rays_) lines.push_back({ray.from, glm::normalize(centre_ - ray.from)});
    const double spread = ConeOf(lines);
    const double half = kNarrowSlope + RadiusAt([](const SeenView&) { return 1.0; });
    if (!sphere_.doubt.empty() || spread >= 2 * std::atan(half) * 180 / std::numbers::pi) return;
    sphere_.doubt = fmt::format(
        "all views look at the object from within {:.0f} degrees, which says little about its "
        "depth",
        spread);
  }

  std::vector<SeenView> views_;
  std::vector<Ray> axes_, rays_;  // along: forward
  glm::dvec3 centre_{0};
  Sphere sphere_;
};

}  // namespace

Result<Sphere> GuessSphere(const FitInput& input) { return Guess(input).Run(); }

}  // namespace tilegrad::train
