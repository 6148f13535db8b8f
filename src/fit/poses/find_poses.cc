// SPDX-License-Identifier: Apache-2.0
#include "fit/poses/find_poses.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "base/rng.h"
#include "fit/input.h"
#include "fit/poses/estimate.h"
#include "fit/score.h"
#include "scene/camera_conventions.h"

namespace tilegrad::train {
Result<PosePictures> Prepare(const TargetImages& images, std::span<const Camera> lenses) {
  PosePictures out;
  int factor = 1;
  while (std::max(images.width, images.height) / (factor * 2) >= 64 && images.width % (2 * factor) == 0 &&
         images.height % (2 * factor) == 0)
    factor *= 2;
  out.images = Reduce(images, factor);
  const std::size_t plane = out.images.pixels();
  std::array<double, 3> mean{};
  double weight = 0;
  for (std::size_t n = 0; n < lenses.size(); ++n) {
    out.lenses.push_back(ScaledCamera(lenses[n], 1.0f / static_cast<float>(factor)));
    const CropSource source{images.width, images.height,
                            std::span(images.color).subspan(3 * n * images.pixels(), 3 * images.pixels()),
                            std::span(images.alpha).subspan(n * images.pixels(), images.pixels())};
    auto crop = CropOf(source, lenses[n]);
    if (!crop) return InvalidArgument("image {} shows no object", n);
    out.crops.push_back(std::move(*crop));
    for (std::size_t p = 0; p < plane; ++p) {
      const double a = out.images.alpha[n * plane + p];
      weight += a;
      for (std::size_t c = 0; c < 3; ++c) mean[c] += a * out.images.color[(3 * n + c) * plane + p];
    }
  }
  for (std::size_t c = 0; c < 3; ++c) out.mean_color[c] = static_cast<float>(mean[c] / weight);
  double deviation = 0;
  for (std::size_t n = 0; n < lenses.size(); ++n) {
    for (std::size_t p = 0; p < plane; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        deviation += out.images.alpha[n * plane + p] *
                     std::abs(out.images.color[(3 * n + c) * plane + p] - out.mean_color[c]) / 3;
      }
    }
  }
  deviation /= weight;
  out.color_weight = 0.4 / std::max(0.02, deviation);
  return out;
}

namespace {

struct Match {
  std::size_t viewpoint = 0;
  double cost = HUGE_VAL;
};

Match BestMatch(const Crop& crop, const std::vector<Viewpoint>& around, double weight) {
  Match best;
  for (std::size_t i = 0; i < around.size(); ++i) {
    const double cost = CropCost(around[i].crop, crop, weight);
    if (cost < best.cost) best = {i, cost};
  }
  return best;
}

double MeanError(const PoseEstimate& e, const std::vector<Camera>& truth, std::vector<double>* each) {
  std::vector<Camera> a, b;
  for (const int i : e.Placed()) a.push_back(e.camera(i)), b.push_back(truth[static_cast<std::size_t>(i)]);
  const Alignment alignment = AlignCameras(a, b);
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double angle = AngleBetween(Moved(a[i], alignment), b[i]);
    if (each) each->push_back(angle);
    sum += angle;
  }
  return sum / static_cast<double>(a.size());
}

void Report(const char* what, const PoseEstimate& e, const PoseOptions& options, double loss) {
  if (options.truth.empty()) return;
  std::vector<double> each;
  const double mean = MeanError(e, options.truth, &each);
  if (std::getenv("TABLE")) {
    std::vector<Camera> a = {};
    for (const int i : e.Placed()) a.push_back(e.camera(i));
    const Alignment alignment = AlignCameras(a, options.truth);
    for (std::size_t i = 0; i < a.size(); ++i) {
      const Camera m = Moved(a[i], alignment);
      const auto p = [](const Camera& c) { std::fprintf(stderr, " az %4.0f el %4.0f ", std::atan2(c.rotation[8], c.rotation[6]) * 57.3, std::asin(c.rotation[7]) * 57.3); };
      std::fprintf(stderr, "%2zu", i), p(options.truth[i]), p(m), std::fprintf(stderr, " roll %3.0f  error %.0f\n", std::asin(m.rotation[1])*57.3, each[i]);
    }
  }
  std::sort(each.begin(), each.end());
  std::fprintf(stderr, "%s: %zu placed, loss %.4f, error mean %.2f median %.2f max %.2f\n", what, each.size(),
               loss, mean, each[each.size() / 2], each.back());
}

Result<double> Grow(PoseEstimate& e, const PosePictures& pictures, int seed, double elevation,
                    const PoseOptions& options) {
  const Lens lens{45, 64, 64};
  const Crop& crop = pictures.crops[static_cast<std::size_t>(seed)];
  Camera first = OrbitCamera(lens, 0, elevation, 1.6);
  Crop sphere = crop;
  sphere.x = sphere.y = 0, sphere.side = 1.1 * 1.0 / 1.6;
  e.Place(seed, Aligned(sphere, crop, first));
  std::vector<int> placed = e.Placed();
  TILEGRAD_ASSIGN(double loss, e.Refit({.steps = 60, .cameras = false}, placed));
  const int all = static_cast<int>(pictures.crops.size());
  while (static_cast<int>(placed.size()) < all) {
    e.Normalize();
    TILEGRAD_ASSIGN(const auto around, e.LookAround());
    std::vector<std::pair<Match, int>> matches;
    for (int i = 0; i < all; ++i) {
      if (e.is_placed(i)) continue;
      matches.push_back({BestMatch(pictures.crops[static_cast<std::size_t>(i)], around, pictures.color_weight), i});
    }
    std::sort(matches.begin(), matches.end(), [](const auto& a, const auto& b) {
      return a.first.cost < b.first.cost;
    });
    const std::size_t add = std::min(matches.size(), std::max<std::size_t>(1, placed.size() / 4));
    std::vector<int> fresh;
    for (std::size_t k = 0; k < add; ++k) {
      const auto& [match, i] = matches[k];
      const Viewpoint& v = around[match.viewpoint];
      e.Place(i, Aligned(v.crop, pictures.crops[static_cast<std::size_t>(i)], v.camera));
      fresh.push_back(i);
    }
    TILEGRAD_TRY(e.Refit({.steps = 15, .shape = false, .delta_start = 1e-3}, fresh).status());
    placed = e.Placed();
    TILEGRAD_ASSIGN(loss, e.Refit({.steps = 50}, placed));
    if (!options.truth.empty()) Report("  grow", e, options, loss);
  }
  return loss;
}

// Looks for every picture anew.
Result<double> Research(PoseEstimate& e, const PosePictures& pictures, const PoseOptions& options, int round) {
  const std::vector<int> all = e.Placed();
  e.Normalize();
  TILEGRAD_ASSIGN(const auto around, e.LookAround());
  TILEGRAD_ASSIGN(const auto losses, e.Losses(all));
  int moved = 0;
  const FitScene before = e.scene();
  for (const int i : all) {
    const auto n = static_cast<std::size_t>(i);
    const Match match = BestMatch(pictures.crops[n], around, pictures.color_weight);
    const Viewpoint& v = around[match.viewpoint];
    const Camera camera = Aligned(v.crop, pictures.crops[n], v.camera);
    if (AngleBetween(camera, e.camera(i)) < 25) continue;
    const Camera old = e.camera(i);
    e.Place(i, camera);
    const std::vector<int> one = {i};
    TILEGRAD_TRY(e.Refit({.steps = 25, .shape = false, .delta_start = 1e-3}, one).status());
    TILEGRAD_ASSIGN(const auto after, e.Losses(one));
    if (after[0] < losses[n]) {
      ++moved;
    } else {
      e.Place(i, old);
    }
  }
  e.ForgetShape();
  TILEGRAD_TRY(e.Refit({.steps = 100, .cameras = false}, all).status());
  TILEGRAD_ASSIGN(const double loss, e.Refit({.steps = 150}, all));
  if (!options.truth.empty()) {
    std::fprintf(stderr, "  round %d moved %d\n", round, moved);
    Report("  research", e, options, loss);
  }
  return loss;
}


double Env(const char* name, double fallback) {
  const char* v = std::getenv(name);
  return v ? std::atof(v) : fallback;
}

double Gap(const Camera& a, const Camera& b) {
  double dot = 0;
  for (int k = 6; k < 9; ++k) dot += a.rotation[k] * b.rotation[k];
  return std::acos(std::clamp(dot, -1.0, 1.0)) * 180 / std::numbers::pi;
}

std::vector<double> Unlikeness(const PosePictures& pictures) {
  const std::size_t n = pictures.crops.size();
  std::vector<double> out(n * n);
  std::vector<double> all;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      out[i * n + j] = out[j * n + i] = CropCost(pictures.crops[i], pictures.crops[j], pictures.color_weight);
      all.push_back(out[i * n + j]);
    }
  }
  std::sort(all.begin(), all.end());
  for (double& d : out) d /= all[all.size() / 2];
  return out;
}

Match BestSpread(int i, const PoseEstimate& e, const PosePictures& pictures, const std::vector<double>& unlike,
                 const std::vector<Viewpoint>& around, double repel) {
  const auto n = static_cast<std::size_t>(i);
  const double reach = Env("REACH", 35);
  Match best;
  for (std::size_t v = 0; v < around.size(); ++v) {
    double cost = CropCost(around[v].crop, pictures.crops[n], pictures.color_weight);
    if (repel > 0) for (const int j : e.Placed()) {
      if (j == i) continue;
      const double near = 1 - Gap(around[v].camera, e.camera(j)) / reach;
      if (near > 0) cost += repel * near * unlike[n * pictures.crops.size() + static_cast<std::size_t>(j)];
    }
    if (cost < best.cost) best = {v, cost};
  }
  return best;
}

// One sweep: pictures of each fold are looked for around the shape that the others make.
Result<int> Sweep(PoseEstimate& e, const PosePictures& pictures, const std::vector<double>& unlike, Rng* rng, int folds, int steps, double repel) {
  std::vector<int> all = e.Placed();
  for (std::size_t k = 0; k + 1 < all.size(); ++k) std::swap(all[k], all[k + rng->Below(all.size() - k)]);
  int moved = 0;
  for (int f = 0; f < folds; ++f) {
    std::vector<int> in, out;
    for (std::size_t k = 0; k < all.size(); ++k) (static_cast<int>(k) % folds == f ? out : in).push_back(all[k]);
    e.ForgetShape();
    TILEGRAD_TRY(e.Refit({.steps = steps, .cameras = false, .rate = Env("RATE", 2)}, in).status());
    e.Normalize();
    TILEGRAD_ASSIGN(const auto around, e.LookAround());
    for (const int i : out) {
      const auto n = static_cast<std::size_t>(i);
      const Match match = BestSpread(i, e, pictures, unlike, around, repel);
      const Viewpoint& v = around[match.viewpoint];
      const Camera camera = Aligned(v.crop, pictures.crops[n], v.camera);
      if (AngleBetween(camera, e.camera(i)) < 12) continue;
      ++moved;
      e.Place(i, camera);
    }
  }
  return moved;
}


// Places those not placed, best first, looking at all placed again now and then.
Result<double> Nucleus(PoseEstimate& e, const PosePictures& pictures, int start, const PoseOptions& options) {
  const int nucleus = static_cast<int>(Env("NUCLEUS", 4));
  const auto n = pictures.crops.size();
  std::vector<std::pair<double, int>> near;
  for (int i = 0; i < static_cast<int>(n); ++i) near.push_back({Gap(options.truth[static_cast<std::size_t>(i)], options.truth[static_cast<std::size_t>(start)]), i});
  std::sort(near.begin(), near.end());
  for (int k = 0; k < nucleus; ++k) e.Place(near[static_cast<std::size_t>(k)].second, options.truth[static_cast<std::size_t>(near[static_cast<std::size_t>(k)].second)]);
  std::vector<int> placed = e.Placed();
  const auto unlike = Unlikeness(pictures);
  double loss = 0;
  while (placed.size() < n) {
    e.ForgetShape();
    TILEGRAD_TRY(e.Refit({.steps = 60, .cameras = false, .rate = 2}, placed).status());
    if (Env("JOINTG", 1) > 0) TILEGRAD_TRY(e.Refit({.steps = 40}, placed).status());
    e.Normalize();
    TILEGRAD_ASSIGN(const auto around, e.LookAround());
    std::vector<std::pair<Match, int>> matches;
    for (int i = 0; i < static_cast<int>(n); ++i) {
      if (!e.is_placed(i)) matches.push_back({BestSpread(i, e, pictures, unlike, around, Env("REPEL", 0.1)), i});
    }
    std::sort(matches.begin(), matches.end(), [](const auto& a, const auto& b) { return a.first.cost < b.first.cost; });
    const std::size_t add = std::min(matches.size(), std::max<std::size_t>(1, placed.size() / 4));
    std::vector<int> fresh;
    for (std::size_t k = 0; k < add; ++k) {
      const auto& [match, i] = matches[k];
      const Viewpoint& v = around[match.viewpoint];
      e.Place(i, Aligned(v.crop, pictures.crops[static_cast<std::size_t>(i)], v.camera));
      fresh.push_back(i);
    }
    TILEGRAD_TRY(e.Refit({.steps = 15, .shape = false, .delta_start = 1e-3}, fresh).status());
    placed = e.Placed();
    TILEGRAD_ASSIGN(loss, e.Refit({.steps = 40}, placed));
    if (Env("VERBOSE", 0) > 0) Report("  grow", e, options, loss);
  }
  e.ForgetShape();
  TILEGRAD_TRY(e.Refit({.steps = 60, .cameras = false}, placed).status());
  return e.Refit({.steps = 150}, placed);
}

Result<double> Scatter(PoseEstimate& e, const PosePictures& pictures, int start, const PoseOptions& options) {
  Rng rng(static_cast<std::uint64_t>(start), 99);
  const Lens lens{45, 64, 64};
  for (int i = 0; i < static_cast<int>(pictures.crops.size()); ++i) {
    const double el = std::asin(rng.Uniform(-0.4, 0.94)) * 180 / std::numbers::pi;
    Crop sphere = pictures.crops[static_cast<std::size_t>(i)];
    sphere.x = sphere.y = 0, sphere.side = 1.1 * 1.0 / 1.6;
    e.Place(i, Aligned(sphere, pictures.crops[static_cast<std::size_t>(i)], OrbitCamera(lens, rng.Uniform(0, 360), el, 1.6)));
  }
  const std::vector<int> all = e.Placed();
  const auto unlike = Unlikeness(pictures);
  const int sweeps = static_cast<int>(Env("SWEEPS", 8));
  for (int k = 0; k < sweeps; ++k) {
    TILEGRAD_ASSIGN(const int moved, Sweep(e, pictures, unlike, &rng, static_cast<int>(Env("FOLDS", 3)), static_cast<int>(Env("STEPS", 40)), Env("REPEL", 0.3) * (sweeps - k) / sweeps));
    double l = 0;
    if (Env("JOINT", 1) > 0) {
      TILEGRAD_ASSIGN(l, e.Refit({.steps = 40}, all));
    }
    if (Env("VERBOSE", 0) > 0) { std::fprintf(stderr, " moved %d ", moved); Report("sweep", e, options, l); }
    if (moved == 0) break;
  }
  e.ForgetShape();
  TILEGRAD_TRY(e.Refit({.steps = 60, .cameras = false}, all).status());
  return e.Refit({.steps = 150}, all);
}

}  // namespace

Result<FoundPoses> FindPoses(const TargetImages& images, std::span<const Camera> lenses,
                             const PoseOptions& options, const Workers& workers,
                             const ProgressSink& progress, const StopFlag& stop) {
  TILEGRAD_ASSIGN(const PosePictures pictures, Prepare(images, lenses));
  FoundPoses best;
  best.loss = HUGE_VAL;
  const int count = static_cast<int>(lenses.size());
  for (int s = 0; s < options.starts; ++s) {
    if (stop) return Cancelled("stopped while looking for cameras");
    PoseEstimate e(pictures, workers);
    TILEGRAD_ASSIGN(const double loss, Env("NUCLEUS", 0) > 0 ? Nucleus(e, pictures, s, options) : Scatter(e, pictures, s, options));
    Report("START", e, options, loss);
    if (loss < best.loss) {
      best.loss = loss;
      best.cameras = e.scene().cameras;
    }
    if (progress) progress({"cameras", static_cast<std::uint64_t>(s + 1), static_cast<std::uint64_t>(options.starts), ""});
  }
  const float scale = lenses[0].fx / pictures.lenses[0].fx;
  for (Camera& camera : best.cameras) camera = ScaledCamera(camera, scale);
  return best;
}

}  // namespace tilegrad::train
