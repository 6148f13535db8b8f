// SPDX-License-Identifier: Apache-2.0
#include "raster/extremes/truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "raster/conventions.h"
#include "raster/extremes/bounded.h"
#include "raster/extremes/scenes.h"
#include "raster/mesh_cast.h"
#include "raster/project.h"
#include "raster/visibility_ref.h"
#include "render/mesh_ref.h"

namespace tilegrad::test {
namespace {

// Kernels take the operations of the references in another order and with fused products: at most
// so many times their bound.
constexpr double kOtherOrder = 8;
constexpr double kBits = kUnitRoundoff;
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

class Comparison {
 public:
  explicit Comparison(CheckCounts* counts) : counts_(counts) {}

  // `tolerance` in absolute numbers.
  void Check(const char* array, std::size_t index, float got, double expected, double tolerance) {
    const double error = std::abs(static_cast<double>(got) - expected);
    if (!std::isfinite(got)) return Fail(array, index, got, expected, tolerance);
    if (!std::isfinite(tolerance)) return static_cast<void>(++counts_->left_out);
    ++counts_->compared;
    counts_->sharp += tolerance <= std::max(0.01 * std::abs(expected), 1e-6);
    if (tolerance > 0) counts_->worst = std::max(counts_->worst, error / tolerance);
    if (!(error <= tolerance)) Fail(array, index, got, expected, tolerance);
  }
  void Check(const char* array, std::size_t index, float got, const Bounded& expected) {
    Check(array, index, got, expected.value, kOtherOrder * expected.error);
  }
  void Require(bool what, const std::string& otherwise) {
    if (!what && failure_.empty()) failure_ = otherwise;
  }
  const std::string& failure() const { return failure_; }

 private:
  void Fail(const char* array, std::size_t index, float got, double expected, double tolerance) {
    Require(false, fmt::format("{}[{}] is {}, expected {} within {}", array, index, got, expected,
                               tolerance));
  }

  CheckCounts* counts_;
  std::string failure_;
};

// All pixels, or some if that were too many pairs with faces.
std::vector<std::size_t> PixelsToCheck(const ExtremeScene& e, Rng* rng) {
  constexpr std::size_t kPairs = 2000;
  const std::size_t pixels = e.pixels(), faces = std::max<std::size_t>(e.scene.face_count(), 1);
  std::vector<std::size_t> out;
  if (pixels * faces <= kPairs) {
    for (std::size_t i = 0; i < pixels; ++i) out.push_back(i);
    return out;
  }
  const std::size_t most = std::max<std::size_t>(kPairs / faces, 1);
  while (out.size() < most) out.push_back(rng->Below(pixels));
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

// What interpolation does at one pixel.
struct PixelTruth {
  std::size_t face;  // of the screen mesh
  raster::FacePlane<Bounded> plane;
  raster::PixelWeights<Bounded> weights;
  bool decided;  // it is not a matter of rounding whether the face is flat (rule 8), nor which
                 // piece of a cut face is seen
};

// Sums of the absolute terms of d_w_k and of their mean.
struct PixelAdjoints {
  double weight[3] = {}, mean = 0;
};

struct Gradients {
  std::vector<float> positions, attributes;
  Camera camera;

  explicit Gradients(const TestScene<float>& scene)
      : positions(scene.positions.size()), attributes(scene.attributes.size()) {}
  SceneGradients View() {
    SceneGradients d{.positions = positions, .camera = &camera};
    d.attributes = attributes;
    return d;
  }
};

class Truth {
 public:
  Truth(const ExtremeScene& e, std::uint64_t number)
      : e_(e), rng_(number, 99), scene_(MeshCast<Bounded>(e.scene)), view_(scene_.View()) {
    const Scene view = e.scene.View();
    raster::Project(FaceSourceOf(view, e.options), e.options.width, e.options.height, &buffers_);
    mesh_ = buffers_.View();
    soft_ = SoftSceneOf(buffers_, e.options);
    prepared_.buffers = raster::MeshCast<Bounded>(buffers_);
    prepared_.mesh = prepared_.buffers.View();
    prepared_.scene = &view_;
    prepared_.given = {scene_.attributes, scene_.channels, scene_.rate};
    ClipAttributesRef(&prepared_);
    pixels_ = PixelsToCheck(e, &rng_);
    d_attributes_.resize(e.pixels() * Channels());
    d_alpha_.resize(e.pixels());
    for (const std::size_t i : pixels_) {
      d_alpha_[i] = static_cast<float>(rng_.Uniform(-1, 1));
      for (std::size_t c = 0; c < Channels(); ++c) {
        d_attributes_[c * e.pixels() + i] = static_cast<float>(rng_.Uniform(-1, 1));
      }
    }
  }

  void CheckProjection(Comparison* comparison);
  void CheckForward(const Images& frame, Comparison* comparison);
  void CheckBackward(const Frame& frame, Renderer* renderer, Comparison* comparison,
                     CheckCounts* counts);

 private:
  std::size_t Channels() const { return static_cast<std::size_t>(e_.scene.channels); }
  PixelTruth At(std::size_t pixel, std::int32_t id) const;
  void CheckFaceIds(const Images& frame, Comparison* comparison) const;
  void CheckForeground(const Images& frame, std::size_t pixel, Comparison* comparison) const;
  bool SameVerticesVisible() const;
  PixelAdjoints AdjointSizes(const PixelTruth& at, const std::vector<Bounded>& d_out) const;
  void Mask(const Images& frame, const SoftTruth& soft);
  void AddInterpolated(const Images& frame, PreparedGradients<Bounded>* d) const;
  void AddSoft(const SoftTruth& soft, PreparedGradients<Bounded>* d) const;
  void CompareGradients(const Images& frame, const SoftTruth& soft, const Status& status,
                        const Gradients& got, Comparison* comparison, CheckCounts* counts);

  const ExtremeScene& e_;
  Rng rng_;
  TestScene<Bounded> scene_;
  SceneT<Bounded> view_;  // of it
  raster::ScreenMeshBuffers buffers_;
  raster::ScreenMesh mesh_;
  PreparedScene<Bounded> prepared_;
  SoftScene soft_;
  std::vector<std::size_t> pixels_;
  std::vector<float> d_attributes_, d_alpha_;
};

void Truth::CheckProjection(Comparison* comparison) {
  raster::ScreenMeshBuffersT<Bounded> truth;
  raster::ProjectVerticesRef(FaceSourceOf(view_, e_.options), &truth);
  for (std::size_t v = 0; v < truth.x.size(); ++v) {
    if (!std::isfinite(mesh_.depth[v]) || !std::isfinite(mesh_.x[v]) ||
        !std::isfinite(mesh_.y[v])) {
      const auto p = raster::ToCamera(scene_.camera, &scene_.positions[3 * v]);
      const double u = std::max(std::abs(p.x.value), std::abs(p.y.value)) / p.depth.value;
      const double errors = truth.x[v].error + truth.y[v].error + truth.depth[v].error;
      comparison->Require(!std::isfinite(errors) || u > kMayOverflow,
                          fmt::format("vertex {} overflows and need not", v));
      continue;
    }
    comparison->Check("depth of vertex", v, mesh_.depth[v], truth.depth[v]);
    if (!(mesh_.inverse_depth[v] > 0 && truth.inverse_depth[v] > 0)) continue;
    comparison->Check("x of vertex", v, mesh_.x[v], truth.x[v]);
    comparison->Check("y of vertex", v, mesh_.y[v], truth.y[v]);
    comparison->Check("inverse depth of vertex", v, mesh_.inverse_depth[v], truth.inverse_depth[v]);
  }
}

// The height of a face against kFlatHeight: true if rounding cannot change who is larger.
bool ShapeIsDecided(const raster::ScreenCorners<Bounded>& c) {
  const Bounded x1 = c.x[1] - c.x[0], y1 = c.y[1] - c.y[0];
  const Bounded x2 = c.x[2] - c.x[0], y2 = c.y[2] - c.y[0];
  const Bounded area = x1 * y2 - x2 * y1;
  const Bounded square = area * area;  // overflows like the kernel's
  const double longest = std::max({std::hypot(x1.value, y1.value), std::hypot(x2.value, y2.value),
                                   std::hypot(x2.value - x1.value, y2.value - y1.value)});
  const double limit = raster::kFlatHeight * longest;
  return std::isfinite(square.error) &&
         std::abs(std::abs(area.value) - limit) > kOtherOrder * area.error + 1e-5 * limit;
}

// Whether another piece of the same cut face covers the pixel: where depths differ by more than
// floats resolve, the corners that cutting makes can be anywhere.
bool PiecesOverlap(const raster::ScreenMesh& mesh, std::size_t face, int column, int row) {
  const std::size_t next = face + 1;
  return next < mesh.faces() && mesh.source_face[next] == mesh.source_face[face] &&
         mesh.reject[next] == raster::kFaceDrawn &&
         raster::Covers(raster::SnapFaceClockwise(mesh, next), column, row);
}

PixelTruth Truth::At(std::size_t pixel, std::int32_t id) const {
  const int column = static_cast<int>(pixel) % e_.options.width;
  const int row = static_cast<int>(pixel) / e_.options.width;
  PixelTruth out;
  out.face = static_cast<std::size_t>(raster::PieceAt(mesh_, id, column, row));
  const auto corners = raster::CornersOf(prepared_.mesh, out.face);
  out.decided = ShapeIsDecided(corners) && !PiecesOverlap(mesh_, out.face, column, row);
  out.plane = raster::MakeFacePlane(corners);
  const auto b = out.plane.Weights(column + 0.5, row + 0.5);
  const bool perspective = e_.options.interpolation == Interpolation::kPerspective;
  Bounded q = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    // Kernels step through a tile from its corner: weights are as large there as it is away.
    const Bounded &gx = out.plane.gx[k], &gy = out.plane.gy[k];
    constexpr double kAway = 2 * raster::kTileSize;
    const double steps =
        kAway * (gx.error + gy.error + 4 * kBits * (std::abs(gx.value) + std::abs(gy.value)));
    out.weights.b[k] = {b[k].value, b[k].error + steps};
    out.weights.w[k] = perspective ? out.weights.b[k] * corners.z[k] : out.weights.b[k];
    q += out.weights.w[k];
  }
  const Bounded least = raster::LeastQ(out.plane, corners.z);
  const double q_error = std::max(q.error, least.error);
  out.weights.q = perspective ? Bounded(std::max(q.value, least.value), q_error) : Bounded(1.0);
  const double low = std::max(out.weights.q.value - q_error, least.value - least.error);
  for (Bounded& w : out.weights.w) {
    if (!perspective) continue;
    const double value = w.value / out.weights.q.value;
    const double error = (w.error + std::abs(value) * out.weights.q.error) / low;
    w = Rounded(value, error, std::abs(value));
  }
  return out;
}

void Truth::CheckFaceIds(const Images& frame, Comparison* comparison) const {
  std::vector<std::int32_t> ids(e_.pixels(), raster::kNoFace);
  raster::VisibilityRef<float>(mesh_, 0, e_.options.height, ids);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] >= 0) ids[i] = mesh_.source_face[static_cast<std::size_t>(ids[i])];
    comparison->Require(frame.face_ids[i] == ids[i], fmt::format("face_ids[{}] is {}, expected {}",
                                                                 i, frame.face_ids[i], ids[i]));
  }
}

void Truth::CheckForeground(const Images& frame, std::size_t pixel, Comparison* comparison) const {
  const PixelTruth at = this->At(pixel, frame.face_ids[pixel]);
  const auto check = [&](const char* array, std::size_t index, float got, const Bounded& expected) {
    if (at.decided) return comparison->Check(array, index, got, expected);
    comparison->Check(array, index, got, expected.value, kUnbounded);
  };
  std::vector<Bounded> values(Channels());
  raster::InterpolateRef<Bounded>(prepared_.mesh, prepared_.attributes, at.face, at.weights,
                                  values);
  for (std::size_t c = 0; c < values.size(); ++c) {
    const std::size_t i = c * e_.pixels() + pixel;
    check("attributes", i, frame.attributes[i], values[c]);
  }
  // Kernels keep two weights of a piece, and the first one is what these leave of 1.
  const Bounded *w = at.weights.w, pieces[3] = {Bounded(1.0) - (w[1] + w[2]), w[1], w[2]};
  Bounded source[3];
  raster::SourceWeights<Bounded>(prepared_.mesh, scene_.faces, at.face, pieces, source);
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t i = k * e_.pixels() + pixel;
    check("barycentrics", i, frame.barycentrics[i], source[k + 1]);
  }
  // The plane that visibility compares, kept between the corners' depths.
  const auto plane = raster::MakeDepthPlane(prepared_.mesh, at.face);
  const int column = static_cast<int>(pixel) % e_.options.width;
  const int row = static_cast<int>(pixel) / e_.options.width;
  const Bounded z =
      plane.base + (plane.gx * (column + 0.5 - plane.x0) + plane.gy * (row + 0.5 - plane.y0));
  const double kept = std::clamp(z.value, plane.low.value, plane.high.value);
  // Kernels start in the image or at the leftmost corner of a small face: the plane is as large
  // there as it is away.
  constexpr double kAway = raster::kSmallExtent / static_cast<double>(raster::kSubpixels);
  const double steps = 4 * kBits *
                       (std::abs(plane.gx.value) * (e_.options.width + kAway) +
                        std::abs(plane.gy.value) * (e_.options.height + kAway));
  const auto d = static_cast<double>(frame.depth[pixel]);
  comparison->Require(d > 0 && std::isfinite(d), fmt::format("depth[{}] is {}", pixel, d));
  check("inverse depth", pixel, static_cast<float>(1 / d),
        {kept, z.error + steps + 2 * kBits * kept});
}

void Truth::CheckForward(const Images& frame, Comparison* comparison) {
  CheckFaceIds(frame, comparison);
  soft_.face_ids.assign(frame.face_ids.begin(), frame.face_ids.end());
  const SoftTruth soft(soft_);
  const double spent = frame.alpha_error_bound, e = e_.options.max_alpha_error;
  comparison->Require(
      spent >= 0 && spent <= e * (1 + 1e-12) + 1.7e-38 * static_cast<double>(soft_.options.faces),
      fmt::format("alpha_error_bound is {}, allowed {}", spent, e));
  for (const auto* image : {&frame.attributes, &frame.alpha, &frame.barycentrics}) {
    for (const float v : *image) comparison->Require(std::isfinite(v), "an image is not finite");
  }
  float largest = 0;
  for (const float a : e_.scene.attributes) largest = std::max(largest, std::abs(a));
  for (const float v : frame.attributes) {
    comparison->Require(std::abs(v) <= 3 * largest, "an attribute beyond the corners': LeastQ");
  }
  for (const std::size_t i : pixels_) {
    const bool background = frame.face_ids[i] < 0;
    comparison->Require(std::isinf(frame.depth[i]) == background, "depth of background");
    comparison->Require(frame.alpha[i] >= 0 && frame.alpha[i] <= 1, "alpha outside of [0, 1]");
    comparison->Require(background || frame.alpha[i] == 1, "alpha of foreground");
    if (background) {
      const double rounding = soft.Resolved(i) ? soft.Rounding(i) : kUnbounded;
      comparison->Check("alpha", i, frame.alpha[i], soft.Alpha(i), spent + rounding);
    } else {
      CheckForeground(frame, i, comparison);
    }
  }
}

// Which vertices are behind the near plane can be a matter of rounding; then gradients differ.
bool Truth::SameVerticesVisible() const {
  for (std::size_t v = 0; v < static_cast<std::size_t>(mesh_.source_vertices); ++v) {
    const auto p = raster::ToCamera(scene_.camera, &scene_.positions[3 * v]);
    if (raster::IsVisibleDepth(p.depth, scene_.camera) != (mesh_.inverse_depth[v] > 0))
      return false;
  }
  return true;
}

// Takes the gradient away from pixels where it does not exist, or depends on rounding.
void Truth::Mask(const Images& frame, const SoftTruth& soft) {
  for (const std::size_t i : pixels_) {
    if (frame.face_ids[i] < 0) {
      if (!soft.Resolved(i) || soft.Ambiguous(i, true)) d_alpha_[i] = 0;
    } else if (!this->At(i, frame.face_ids[i]).decided) {
      for (std::size_t c = 0; c < Channels(); ++c) d_attributes_[c * e_.pixels() + i] = 0;
    }
  }
}

PixelAdjoints Truth::AdjointSizes(const PixelTruth& at, const std::vector<Bounded>& d_out) const {
  PixelAdjoints out;
  for (int k = 0; k < 3; ++k) {
    const Bounded* values = prepared_.attributes.corner(prepared_.mesh, at.face, k);
    for (std::size_t c = 0; c < d_out.size(); ++c) {
      out.weight[k] += std::abs(d_out[c].value * values[c].value);
    }
    out.mean += std::abs(at.weights.w[k].value) * out.weight[k];
  }
  return out;
}

// Moving corner m drags the weights along: d_v_m = -b_m sum_k d_b_k grad b_k
// (BarycentricRefBackward). The reference takes the difference d_w - mean in d_b first; kernels
// take it last, so that the error of b_m meets both terms in full.
void AllowLateDifferences(const raster::ScreenMesh& mesh, const PixelTruth& at, bool perspective,
                          const PixelAdjoints& size, PreparedGradients<Bounded>* d) {
  double x = 0, y = 0;
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.vertex(at.face, k));
    const double m = perspective ? static_cast<double>(mesh.inverse_depth[v]) : 1;
    const double d_b = (size.weight[k] + size.mean) * m / at.weights.q.value;
    x += d_b * std::abs(at.plane.gx[k].value);
    y += d_b * std::abs(at.plane.gy[k].value);
  }
  for (int k = 0; k < 3; ++k) {
    const auto v = static_cast<std::size_t>(mesh.vertex(at.face, k));
    const Bounded& b = at.weights.b[k];
    const double error = b.error + 4 * kBits * std::abs(b.value);
    d->screen.d_x[v] += Bounded(0, error * x);
    d->screen.d_y[v] += Bounded(0, error * y);
  }
}

void Truth::AddInterpolated(const Images& frame, PreparedGradients<Bounded>* d) const {
  std::vector<Bounded> d_out(Channels());
  for (const std::size_t i : pixels_) {
    if (frame.face_ids[i] < 0) continue;
    for (std::size_t c = 0; c < d_out.size(); ++c) {
      d_out[c] = static_cast<double>(d_attributes_[c * e_.pixels() + i]);
    }
    const PixelTruth at = this->At(i, frame.face_ids[i]);
    if (!at.decided) continue;  // masked
    AllowLateDifferences(mesh_, at, e_.options.interpolation == Interpolation::kPerspective,
                         AdjointSizes(at, d_out), d);
    raster::InterpolateRefBackward<Bounded>(prepared_.mesh, prepared_.attributes, at.plane, at.face,
                                            e_.options.interpolation, at.weights, d_out, d->screen,
                                            d->attributes);
  }
}

void Truth::AddSoft(const SoftTruth& soft, PreparedGradients<Bounded>* d) const {
  std::vector<double> exact, tolerance;
  soft.Gradient(d_alpha_, &exact, &tolerance);
  const auto view = soft_.mesh.View();
  for (std::size_t f = 0; f < soft_.options.faces; ++f) {
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(view.vertex(f, k));
      const std::size_t at = 6 * f + 2 * static_cast<std::size_t>(k);
      d->screen.d_x[v] += Bounded(exact[at], tolerance[at]);
      d->screen.d_y[v] += Bounded(exact[at + 1], tolerance[at + 1]);
    }
  }
}

bool NamesWhatOverflows(const Status& status) {
  const std::string& m = status.message();
  const auto at = m.find("the gradient overflows: d_scene.");
  return at != std::string::npos && m.find('[', at) != std::string::npos;
}

void Truth::CompareGradients(const Images& frame, const SoftTruth& soft, const Status& status,
                             const Gradients& got, Comparison* comparison, CheckCounts* counts) {
  PreparedGradients<Bounded> d(prepared_);
  AddInterpolated(frame, &d);
  AddSoft(soft, &d);
  const MeshGradients<Bounded> expected = PrepareRefBackward(e_.options, prepared_, d);
  const CameraT<Bounded>& c = expected.camera;
  const Bounded lens[] = {c.fx, c.fy, c.cx, c.cy};
  bool fits = true;
  for (const auto& array :
       {std::span<const Bounded>(expected.positions), std::span<const Bounded>(expected.attributes),
        std::span<const Bounded>(c.rotation), std::span<const Bounded>(c.translation),
        std::span<const Bounded>(lens)}) {
    for (const Bounded& x : array) fits &= std::isfinite(x.error);
  }
  if (!status.ok()) {
    ++counts->overflows;
    comparison->Require(!fits, "refused, but the gradient fits: " + status.message());
    return comparison->Require(NamesWhatOverflows(status), "unclear error: " + status.message());
  }
  counts->gradients += fits;
  const auto check = [&](const char* array, const auto& actual, const auto& truth) {
    for (std::size_t i = 0; i < std::size(actual); ++i) {
      comparison->Check(array, i, actual[i], truth[i]);
    }
  };
  check("d_positions", got.positions, expected.positions);
  check("d_attributes", got.attributes, expected.attributes);
  check("d_rotation", got.camera.rotation, c.rotation);
  check("d_translation", got.camera.translation, c.translation);
  const float got_lens[] = {got.camera.fx, got.camera.fy, got.camera.cx, got.camera.cy};
  check("d_{fx, fy, cx, cy}", got_lens, lens);
}

void Truth::CheckBackward(const Frame& frame, Renderer* renderer, Comparison* comparison,
                          CheckCounts* counts) {
  Gradients got(e_.scene);
  const SceneGradients d = got.View();
  const auto run = [&] {
    return renderer->Backward(frame, {.alpha = d_alpha_, .attributes = d_attributes_}, {&d, 1});
  };
  const Status all = run();
  comparison->Require(all.ok() || NamesWhatOverflows(all), "unclear error: " + all.message());
  if (!SameVerticesVisible()) return;
  const SoftTruth soft(soft_);
  Mask(frame.images(), soft);
  const Status masked = run();
  CompareGradients(frame.images(), soft, masked, got, comparison, counts);
}

}  // namespace

void CheckCounts::Add(const CheckCounts& other) {
  compared += other.compared;
  sharp += other.sharp;
  left_out += other.left_out;
  gradients += other.gradients;
  overflows += other.overflows;
  worst = std::max(worst, other.worst);
}

std::string CheckExtremeScene(const ExtremeScene& scene, std::uint64_t number, Renderer* renderer,
                              CheckCounts* counts) {
  Frame frame;
  const Scene view = scene.scene.View();
  const Outputs outputs{.color = false, .depth = true, .barycentrics = true};
  const Status status = renderer->Render({&view, 1}, scene.options, outputs, &frame);
  if (!status.ok()) return "Render: " + status.message();
  Comparison comparison(counts);
  Truth truth(scene, number);
  truth.CheckProjection(&comparison);
  truth.CheckForward(frame.images(), &comparison);
  truth.CheckBackward(frame, renderer, &comparison, counts);
  return comparison.failure();
}

}  // namespace tilegrad::test
