// SPDX-License-Identifier: Apache-2.0
// Random scenes for the soft mask, its truth in double, and the rounding that docs/numerics.md
// allows.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "base/rng.h"
#include "raster/soft_mask/plan.h"
#include "raster/soft_mask/soft_mask.h"
#include "raster/soft_mask/soft_mask_ref.h"

namespace tilegrad::raster::test {

struct SoftScene {
  ScreenMeshBuffers mesh;
  std::vector<std::int32_t> face_ids;
  std::vector<float> d_alpha;
  SoftMaskOptions options;

  std::size_t pixels() const { return face_ids.size(); }
  void AddFace(const float (&x)[3], const float (&y)[3]) {
    for (int k = 0; k < 3; ++k) {
      auto& index = k == 0 ? mesh.v0 : k == 1 ? mesh.v1 : mesh.v2;
      index.push_back(static_cast<std::int32_t>(mesh.x.size()));
      mesh.x.push_back(x[k]);
      mesh.y.push_back(y[k]);
      mesh.packed.push_back({x[k], y[k], 1, 1});
    }
    mesh.source_face.push_back(static_cast<std::int32_t>(mesh.reject.size()));
    mesh.reject.push_back(kFaceDrawn);
    options.faces = mesh.reject.size();
  }
  void Resize(int width, int height) {
    mesh.width = options.width = width;
    mesh.height = options.height = height;
    face_ids.assign(static_cast<std::size_t>(width * height), -1);
    d_alpha.assign(face_ids.size(), 0.0f);
  }
};

// Kinds of faces that kernels tend to get wrong.
enum class FaceKind { kSmall, kLarge, kSliver, kPoint, kSegment, kOnCentres, kFarAway, kCount };

inline void RandomFace(FaceKind kind, Rng* rng, SoftScene* scene) {
  const double w = scene->options.width, h = scene->options.height;
  const double reach = kind == FaceKind::kLarge ? 2 * w : kind == FaceKind::kFarAway ? 1e5 : 2;
  const double cx = rng->Uniform(-2, w + 2), cy = rng->Uniform(-2, h + 2);
  float x[3], y[3];
  for (int k = 0; k < 3; ++k) {
    x[k] = static_cast<float>(cx + rng->Uniform(-reach, reach));
    y[k] = static_cast<float>(cy + rng->Uniform(-reach, reach));
    if (kind == FaceKind::kOnCentres) {
      x[k] = std::floor(x[k]) + 0.5f;
      y[k] = std::floor(y[k]) + 0.5f;
    }
  }
  if (kind == FaceKind::kSliver) {
    x[2] = x[1] + 1e-5f;
    y[2] = y[1] - 1e-5f;
  }
  if (kind == FaceKind::kSegment || kind == FaceKind::kPoint) {
    x[2] = x[1];
    y[2] = y[1];
  }
  if (kind == FaceKind::kPoint) {
    x[1] = x[2] = x[0];
    y[1] = y[2] = y[0];
  }
  scene->AddFace(x, y);
}

inline SoftScene RandomScene(std::uint64_t seed, std::size_t most_faces) {
  Rng rng(seed, 77);
  SoftScene scene;
  scene.Resize(1 + static_cast<int>(rng.Below(20)), 1 + static_cast<int>(rng.Below(20)));
  const double errors[] = {0, 1e-6, 1e-4, 1e-2};
  scene.options.max_alpha_error = errors[rng.Below(4)];
  scene.options.delta = std::pow(10.0, rng.Uniform(-6, 0));
  const std::size_t faces = rng.Below(most_faces + 1);
  const bool mixed = rng.Below(2) == 0;
  auto kind = static_cast<FaceKind>(rng.Below(static_cast<std::uint64_t>(FaceKind::kCount)));
  for (std::size_t f = 0; f < faces; ++f) {
    RandomFace(kind, &rng, &scene);
    if (mixed)
      kind = static_cast<FaceKind>(rng.Below(static_cast<std::uint64_t>(FaceKind::kCount)));
  }
  for (std::size_t i = 0; i < scene.pixels(); ++i) {
    scene.face_ids[i] = faces > 0 && rng.Below(5) == 0 ? 0 : -1;
    scene.d_alpha[i] = static_cast<float>(rng.Uniform(-1, 1));
  }
  return scene;
}

// The scene's mesh in double, and everything per (pixel, face) that bounds need.
class SoftTruth {
 public:
  explicit SoftTruth(const SoftScene& scene) : scene_(scene), faces_(scene.options.faces) {
    x_.assign(scene.mesh.x.begin(), scene.mesh.x.end());
    y_.assign(scene.mesh.y.begin(), scene.mesh.y.end());
    mesh_.x = x_;
    mesh_.y = y_;
    mesh_.v0 = scene.mesh.v0;
    mesh_.v1 = scene.mesh.v1;
    mesh_.v2 = scene.mesh.v2;
    mesh_.reject = scene.mesh.reject;
    std::iota(faces_.begin(), faces_.end(), 0);
    const SoftMaskOptions& o = scene.options;
    scale_ = {2.0 / o.width, 2.0 / o.height, 1 / o.delta};
    const double unit = 1 / std::sqrt(o.delta);
    radius_ = 3.5 * std::hypot(scale_.x * unit, scale_.y * unit);
    largest_unit_ = std::max(scale_.x, scale_.y) * unit;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      cancelled_.push_back(CancelledIn(f));
      edges_.push_back(LongestEdge(f));
    }
  }
  double X(std::size_t i) const {
    return static_cast<double>(i % static_cast<std::size_t>(scene_.options.width)) + 0.5;
  }
  double Y(std::size_t i) const {
    return static_cast<double>(i / static_cast<std::size_t>(scene_.options.width)) + 0.5;
  }
  double Alpha(std::size_t i) const {
    return SoftAlphaRef<double>(mesh_, faces_, X(i), Y(i), scale_);
  }
  double Z(std::size_t i, std::size_t face) const {
    return NearestOnFace(mesh_, face, X(i), Y(i), scale_).squared_distance * scale_.inverse_delta;
  }
  // Error of a computed z of `face` ("Rounding": Delta z).
  double ErrorOfZ(double z, std::size_t face) const {
    const double d = std::sqrt(z), fixed = FixedErrorOfD(face);
    return kU * 34 * z + 2 * std::sqrt(2.0) * d * fixed + 2 * fixed * fixed;
  }
  // Error of a side or beyond that does not shrink with the distance.
  double FixedErrorOfD(std::size_t face) const {
    return kU * (14 * radius_ + 11 * edges_[face]) + cancelled_[face];
  }
  // Error of a computed A.
  double ErrorOfA(double z, std::size_t face) const {
    const double error = ErrorOfZ(z, face);
    const bool both_end = z - error > 87;  // and so the computed one is 0
    return both_end ? std::exp(-z) : std::min(1.0, std::exp(-z) * std::expm1(error + 3 * kU));
  }
  struct AlphaBound {
    double alpha, rounding;
  };
  // Alpha of pixel i, and its rounding: the running bound of docs/numerics.md.
  AlphaBound Bound(std::size_t i) const {
    std::vector<double> most, errors;  // of 1 - A
    double outside = 1;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const double z = Z(i, f), factor = -std::expm1(-z);
      errors.push_back(ErrorOfA(z, f));
      most.push_back(std::min(1.0, errors.back() + factor));
      outside *= factor;
    }
    const auto others = ProductsOfOthers(most);
    double sum = 42 * kU * (1 - outside);
    for (std::size_t f = 0; f < errors.size(); ++f) sum += others[f] * errors[f];
    return {1 - outside, sum + 1e-16 * static_cast<double>(errors.size())};
  }
  double Rounding(std::size_t i) const { return Bound(i).rounding; }
  // The product over all faces, and the largest over all but one.
  std::array<double, 2> Products(std::size_t i) const {
    std::vector<double> factors;
    for (const double z : AllZ(i)) factors.push_back(-std::expm1(-z));
    double product = 1, most = 0;
    for (const double factor : factors) product *= factor;
    for (const double others : ProductsOfOthers(factors)) most = std::max(most, others);
    return {product, most};
  }
  // Whether coordinates are small enough for double to tell how far the pixel is from each face
  // that may matter. Far beyond 1e8 pixels neither this truth nor a kernel knows.
  bool Resolved(std::size_t i) const {
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const double z = Z(i, f), c = cancelled_[f], lost = 2 * std::sqrt(z) * c + c * c;
      if (z - ErrorOfZ(z, f) <= 87 && !(lost <= 1e-6)) return false;
    }
    return true;
  }
  // Two features of a face are equally near within rounding and move differently with its corners
  // (of which those at one place count as one, or if `by_vertex` only those that are one vertex):
  // its gradient is not defined.
  bool Ambiguous(std::size_t i, bool by_vertex = false) const {
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const auto best = NearestOnFace(mesh_, f, X(i), Y(i), scale_);
      const double z = best.squared_distance * scale_.inverse_delta, error = ErrorOfZ(z, f);
      if (z - error > 100) continue;  // no gradient either way
      for (int k = 0; k < 3; ++k) {
        const auto other = NearestOnEdge(mesh_, f, k, X(i), Y(i), scale_);
        const double gap = (other.squared_distance - best.squared_distance) * scale_.inverse_delta;
        if (gap > 4 * error) continue;
        const auto a = WeightsOf(f, best, by_vertex), b = WeightsOf(f, other, by_vertex);
        for (std::size_t c = 0; c < 3; ++c) {
          if (std::abs(a[c] - b[c]) > 1e-9) return true;
        }
      }
    }
    return false;
  }
  // d_corners [faces][3][2] for d_alpha, and how far a float kernel may be from it.
  void Gradient(const std::vector<float>& d_alpha, std::vector<double>* d_corners,
                std::vector<double>* tolerance) const {
    d_corners->assign(6 * faces_.size(), 0);
    tolerance->assign(6 * faces_.size(), 0);
    for (std::size_t i = 0; i < scene_.pixels(); ++i) {
      if (scene_.face_ids[i] >= 0 || d_alpha[i] == 0) continue;
      const auto d = static_cast<double>(d_alpha[i]);
      SoftAlphaRefBackward<double>(mesh_, faces_, X(i), Y(i), scale_, d,
                                   [&](std::size_t n, int corner, double dx, double dy) {
                                     double* at = d_corners->data() + 6 * n + 2 * corner;
                                     at[0] += dx;
                                     at[1] += dy;
                                   });
      AddTolerance(i, std::abs(d), tolerance);
    }
  }

 private:
  static constexpr double kU = 0x1p-24;

  std::vector<double> AllZ(std::size_t i) const {
    std::vector<double> zs;
    for (std::size_t f = 0; f < faces_.size(); ++f) zs.push_back(Z(i, f));
    return zs;
  }
  // How the nearest point moves with the corners; coinciding corners share their weight.
  std::array<double, 3> WeightsOf(std::size_t f, const NearestFeature<double>& at,
                                  bool by_vertex) const {
    const double weight[2] = {1 - at.tau, at.tau};
    std::array<double, 3> out{};
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(mesh_.vertex(f, k));
      for (int end = 0; end < 2; ++end) {
        const auto w = static_cast<std::size_t>(mesh_.vertex(f, (at.edge + end) % 3));
        const bool same = by_vertex ? v == w : x_[v] == x_[w] && y_[v] == y_[w];
        if (same) out[static_cast<std::size_t>(k)] += weight[end];
      }
    }
    return out;
  }
  // Kernel units: what the differences of a face's coordinates, taken in double, lose of the
  // distance to a pixel.
  double CancelledIn(std::size_t f) const {
    double reach = std::max(scene_.options.width, scene_.options.height);
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(mesh_.vertex(f, k));
      reach = std::max({reach, std::abs(x_[v]), std::abs(y_[v])});
    }
    return 0x1p-50 * reach * largest_unit_;
  }
  static std::vector<double> ProductsOfOthers(const std::vector<double>& factors) {
    std::vector<double> out(factors.size(), 1.0);
    double product = 1;
    for (std::size_t f = 0; f < factors.size(); ++f) {
      out[f] *= product;
      product *= factors[f];
    }
    product = 1;
    for (std::size_t f = factors.size(); f-- > 0;) {
      out[f] *= product;
      product *= factors[f];
    }
    return out;
  }
  // Of faces that are set up in float; 0 of those with long edges.
  double LongestEdge(std::size_t f) const {
    double longest = 0;
    for (int k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(mesh_.vertex(f, k));
      const auto b = static_cast<std::size_t>(mesh_.vertex(f, (k + 1) % 3));
      const double x = std::abs(x_[a] - x_[b]), y = std::abs(y_[a] - y_[b]);
      if (std::max(x, y) > static_cast<double>(kLongEdge)) return 0;
      longest = std::max(longest, largest_unit_ * std::hypot(x, y));
    }
    return longest;
  }
  double ShortestEdge(std::size_t f) const {
    double shortest = 1e300;
    for (int k = 0; k < 3; ++k) {
      const auto a = static_cast<std::size_t>(mesh_.vertex(f, k));
      const auto b = static_cast<std::size_t>(mesh_.vertex(f, (k + 1) % 3));
      const double length = std::hypot((x_[a] - x_[b]) * scale_.x, (y_[a] - y_[b]) * scale_.y) /
                            std::sqrt(scene_.options.delta);
      if (length > 0) shortest = std::min(shortest, length);
    }
    return shortest;
  }
  // "Gradients": what culling and rounding may do to each corner of each face.
  void AddTolerance(std::size_t i, double d_alpha, std::vector<double>* tolerance) const {
    const auto zs = AllZ(i);
    std::vector<double> factors;
    for (const double z : zs) factors.push_back(-std::expm1(-z));
    const auto others = ProductsOfOthers(factors);
    const double dropped = scene_.options.max_alpha_error + 1e-30;
    double d_product = dropped + 64 * kU;
    for (std::size_t f = 0; f < zs.size(); ++f) d_product += 4 * kU + ErrorOfA(zs[f], f);
    for (std::size_t f = 0; f < zs.size(); ++f) {
      const double d = std::sqrt(zs[f]), a = std::exp(-zs[f]);
      const double d_r = kU * 12 * d + FixedErrorOfD(f);
      const double d_weight =
          std::min(1.0, (kU * 12 * d + FixedErrorOfD(f)) / ShortestEdge(f) + 4 * kU);
      const double error =
          others[f] * (d * ErrorOfA(zs[f], f) + a * (80 * kU * d + d_r + d * d_weight)) +
          a * (d + d_r) * d_product + dropped * (1 + d);
      for (std::size_t k = 0; k < 6; ++k) {
        (*tolerance)[6 * f + k] += 2 * largest_unit_ * d_alpha * error;
      }
    }
  }

  const SoftScene& scene_;
  std::vector<double> x_, y_, cancelled_, edges_;
  ScreenMeshT<double> mesh_;
  std::vector<std::int32_t> faces_;
  SoftScale<double> scale_{};
  double radius_ = 0, largest_unit_ = 0;
};

// The kernel over all tiles, merged in tile order.
struct SoftResult {
  std::vector<float> alpha, transmittance;
  double spent = 0;
  std::vector<float> d_corners;  // [faces][3][2]
};

struct SoftRun {
  int region_bits = kBinBits;      // regions of 1 << region_bits pixels
  bool with_transmittance = true;  // on the way back
};

inline SoftResult RunSoftMask(const SoftScene& scene, const std::vector<float>& d_alpha,
                              SoftMaskScratch* scratch, const SoftRun& run = {}) {
  const ScreenMesh mesh = scene.mesh.View();
  SoftTree tree;
  std::vector<std::uint8_t> reject(mesh.reject.begin(), mesh.reject.end());
  SetUpFaces(mesh, /*cull_back=*/false, reject, {.corners = &tree.corners});
  BuildSoftTree(&tree);
  const SoftMaskPlan plan = PlanSoftMask(scene.options);
  const SquareGrid grid(scene.options.width, scene.options.height, run.region_bits);
  SoftResult out;
  out.alpha.assign(scene.pixels(), -1.0f);
  out.transmittance.assign(scene.pixels(), -2.0f);
  out.d_corners.assign(6 * mesh.faces(), 0.0f);
  AlignedVector<SoftFaceGradient> gradients;
  std::span<const float> known(out.transmittance);
  if (!run.with_transmittance) known = {};
  for (std::size_t t = 0; t < grid.cells(); ++t) {
    const SoftMaskRegion region{grid.rect(t), scene.face_ids};
    out.spent = std::max(
        out.spent, SoftMaskForward(tree, plan, region, {out.alpha, out.transmittance}, scratch));
    SoftMaskBackward(tree, plan, region, {out.alpha, known, d_alpha}, &gradients, scratch);
  }
  for (const SoftFaceGradient& g : gradients) {
    float* to = out.d_corners.data() + 6 * static_cast<std::size_t>(g.face);
    for (std::size_t k = 0; k < 3; ++k) {
      to[2 * k] += g.d_corner[k][0];
      to[2 * k + 1] += g.d_corner[k][1];
    }
  }
  return out;
}

}  // namespace tilegrad::raster::test
