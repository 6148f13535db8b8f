// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/find_masks.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "fit/masks/color_odds.h"
#include "fit/masks/common_hull.h"
#include "fit/masks/floor.h"
#include "fit/masks/holes.h"
#include "fit/masks/pixel_field.h"
#include "fit/sphere.h"

namespace tilegrad::train {
namespace {

constexpr int kRoundSide = 192;  // pixels of the longer side, about, of all rounds but the last
constexpr int kRounds = 10;
constexpr int kHoleRounds = 4;  // at most, after them, where masks have false holes
// Share of the views that may see past a cell of the hull.
constexpr double kFirstTolerance = 0.15, kLastTolerance = 0.06;
// ln: of a pixel that nothing of the hull covers, and of one in its silhouette, in later rounds.
constexpr float kOutsideHull = -5, kInsideHull = 0.4f;
constexpr float kKept = 5;  // ln: of the rounds, for the last one at full resolution
constexpr PixelField::Relaxing kRelaxing = {.rounds = 40, .coupling = 0.5f};
// Least mean agreement with the floor of a true hole. In rendered captures true holes have 0.99 or
// more, parts of the object in the floor's colour 0.75 or less.
constexpr float kShowsFloor = 0.85f;
constexpr float kBeyondFloor =
    1;  // agreement of a ray that misses the known floor: as of a true hole
constexpr float kInFalseHole = 2;  // ln: odds of a pixel in a false hole, at least
constexpr float kInsideMask = 0.5f;
const Progress kDone = {"finding masks", kRounds + 1, kRounds + 1, ""};

Camera Reduced(Camera c, float factor) {
  c.fx /= factor;
  c.fy /= factor;
  c.cx /= factor;
  c.cy /= factor;
  return c;
}

// `in_false_hole` [H,W]: 1 there.
void RaiseOdds(std::span<const float> in_false_hole, std::vector<float>* odds) {
  for (std::size_t p = 0; p < odds->size(); ++p) {
    if (in_false_hole[p] > 0) (*odds)[p] = std::max((*odds)[p], kInFalseHole);
  }
}

float MeanOf(const std::vector<float>& values, const std::vector<std::size_t>& where) {
  float sum = 0;
  for (const std::size_t p : where) sum += values[p];
  return sum / static_cast<float>(where.size());
}

class MaskSearch {
 public:
  MaskSearch(const FitInput& input, glm::vec3 middle, const Workers& workers);

  Status CheckReach() const;
  Status Run(const Watch& watch);
  Result<FoundMasks> Finish(const Watch& watch) const;  // at full resolution

 private:
  std::size_t views() const { return cameras_.size(); }
  std::size_t plane() const { return images_.pixels(); }
  std::span<const float> Of(std::size_t view, const std::vector<float>& values) const {
    return std::span(values).subspan(view * plane(), plane());
  }
  std::span<float> Of(std::size_t view, std::vector<float>* values) const {
    return std::span(*values).subspan(view * plane(), plane());
  }

  void Start(glm::vec3 middle);
  Status RunHoleRounds(const Watch& watch);
  bool CloseFalseHoles();
  std::vector<std::vector<Hole>> FindHoles() const;
  void RelearnFloor(const std::vector<std::vector<Hole>>& holes);
  void Round(double time);
  std::vector<float> Enlarged(std::span<const float> values) const;
  std::vector<float> FullMask(std::size_t view) const;
  double Agreement(std::size_t view) const;

  const TargetImages& full_;
  const Workers& workers_;
  const int factor_;
  const TargetImages images_;
  std::vector<Camera> cameras_;
  ColorOdds odds_;
  std::optional<CommonHull> hull_;
  std::optional<Floor> floor_;
  std::vector<PixelField> fields_;
  std::vector<float> inside_, on_floor_;  // [N,H,W]
  std::vector<float> in_false_hole_;      // [N,H,W]: 1 there
};

MaskSearch::MaskSearch(const FitInput& input, glm::vec3 middle, const Workers& workers)
    : full_(input.images),
      workers_(workers),
      factor_(std::max(1, std::max(full_.width, full_.height) / kRoundSide)),
      images_(Reduce(full_, factor_)),
      odds_(images_, workers),
      inside_(images_.alpha.size()),
      on_floor_(images_.alpha.size()),
      in_false_hole_(images_.alpha.size()) {
  for (const Camera& c : input.cameras) cameras_.push_back(Reduced(c, static_cast<float>(factor_)));
  hull_.emplace(cameras_, ImageSize{images_.width, images_.height}, middle, workers);
  for (std::size_t v = 0; v < views(); ++v)
    fields_.emplace_back(std::span(images_.color).subspan(3 * v * plane(), 3 * plane()),
                         images_.width, images_.height);
  Start(middle);
}

// Belief falls with the distance from where all views look; the hull holds all that they see.
void MaskSearch::Start(glm::vec3 middle) {
  hull_->Vote(std::vector<float>(inside_.size(), 1.0f), kFirstTolerance, workers_);
  floor_.emplace(images_, cameras_, Floor::Region{middle, hull_->reach()}, workers_);
  const float radius = 0.5f * static_cast<float>(std::min(images_.width, images_.height));
  workers_.For(views(), [&](std::size_t v, std::size_t) {
    const auto at = hull_->Project(v, middle);
    const auto wide = static_cast<std::size_t>(images_.width);
    for (std::size_t p = 0; p < plane(); ++p) {
      const float x = (static_cast<float>(p % wide) + 0.5f - at.x) / radius,
                  y = (static_cast<float>(p / wide) + 0.5f - at.y) / radius;
      const float d = x * x + y * y;
      inside_[v * plane() + p] = 0.9f * std::exp(-d * d);
    }
    if (floor_->found()) std::ranges::copy(floor_->Agreement(v), Of(v, &on_floor_).begin());
  });
}

void MaskSearch::Round(double time) {
  odds_.Learn(inside_, workers_);
  const float inside_hull = kInsideHull * static_cast<float>(std::min(1.0, 2 * time));
  workers_.For(views(), [&](std::size_t v, std::size_t) {
    std::vector<float> odds = odds_.Of(images_, v, Of(v, on_floor_));
    const std::vector<float> hull = hull_->Silhouette(v);
    for (std::size_t p = 0; p < odds.size(); ++p)
      odds[p] += kOutsideHull * (1 - hull[p]) + inside_hull * hull[p];
    RaiseOdds(Of(v, in_false_hole_), &odds);
    std::ranges::copy(fields_[v].Relax(odds, kRelaxing), Of(v, &inside_).begin());
  });
  hull_->Vote(inside_, kFirstTolerance + time * (kLastTolerance - kFirstTolerance), workers_);
}

std::vector<std::vector<Hole>> MaskSearch::FindHoles() const {
  std::vector<std::vector<Hole>> out(views());
  workers_.For(views(), [&](std::size_t v, std::size_t) {
    out[v] = HolesOf(Of(v, inside_), {images_.width, images_.height});
  });
  return out;
}

void MaskSearch::RelearnFloor(const std::vector<std::vector<Hole>>& holes) {
  std::vector<float> in_hole(inside_.size());
  for (std::size_t v = 0; v < views(); ++v) {
    for (const Hole& hole : holes[v]) {
      for (const std::size_t p : hole.pixels) Of(v, &in_hole)[p] = 1;
    }
  }
  floor_->Relearn(inside_, in_hole, workers_);
}

// A true hole shows the floor as other views see it, or what lies beyond; a false one, a part of
// the object in the background's colours. Returns whether there was a false one.
bool MaskSearch::CloseFalseHoles() {
  if (!floor_->found()) return false;
  const std::vector<std::vector<Hole>> holes = FindHoles();
  RelearnFloor(holes);
  bool any = false;
  for (std::size_t v = 0; v < views(); ++v) {
    if (holes[v].empty()) continue;
    const std::vector<float> agreement = floor_->Agreement(v, kBeyondFloor);
    for (const Hole& hole : holes[v]) {
      if (MeanOf(agreement, hole.core) >= kShowsFloor) continue;
      any = true;
      for (const std::size_t p : hole.pixels) Of(v, &in_false_hole_)[p] = Of(v, &inside_)[p] = 1;
    }
  }
  if (any) hull_->Vote(inside_, kLastTolerance, workers_);
  return any;
}

Status MaskSearch::CheckReach() const {
  if (std::isnormal(hull_->reach())) return {};
  return InvalidArgument("masks cannot be found: the views see {:.3g} of what they look at",
                         hull_->reach());
}

Status MaskSearch::Run(const Watch& watch) {
  for (int round = 0; round < kRounds; ++round) {
    TILEGRAD_TRY(watch.At({"finding masks", static_cast<std::uint64_t>(round), kRounds + 1, ""}));
    Round(static_cast<double>(round) / (kRounds - 1));
  }
  return RunHoleRounds(watch);
}

// Closed holes change the hull and the floor's colours, which reveal more, so each round looks
// again.
Status MaskSearch::RunHoleRounds(const Watch& watch) {
  bool any = false;
  for (int round = 0; round < kHoleRounds; ++round) {
    TILEGRAD_TRY(watch.At({"finding masks", kRounds, kRounds + 1, ""}));
    any = CloseFalseHoles() || any;
    if (!any) break;
    Round(1);
  }
  return watch.At({"finding masks", kRounds, kRounds + 1, ""});
}

std::vector<float> MaskSearch::Enlarged(std::span<const float> values) const {
  std::vector<float> out(full_.pixels());
  const auto wide = static_cast<std::size_t>(full_.width);
  for (std::size_t p = 0; p < out.size(); ++p) {
    const int x = std::min(static_cast<int>(p % wide) / factor_, images_.width - 1),
              y = std::min(static_cast<int>(p / wide) / factor_, images_.height - 1);
    out[p] = values[static_cast<std::size_t>(y * images_.width + x)];
  }
  return out;
}

std::vector<float> MaskSearch::FullMask(std::size_t view) const {
  std::vector<float> odds = odds_.Of(full_, view, Enlarged(Of(view, on_floor_)));
  RaiseOdds(Enlarged(Of(view, in_false_hole_)), &odds);
  const std::vector<float> before = Enlarged(Of(view, inside_));
  for (std::size_t p = 0; p < odds.size(); ++p) odds[p] += kKept * (2 * before[p] - 1);
  const std::size_t pixels = full_.pixels();
  const PixelField field(std::span(full_.color).subspan(3 * view * pixels, 3 * pixels), full_.width,
                         full_.height);
  return field.Relax(odds, kRelaxing);
}

double MaskSearch::Agreement(std::size_t view) const {
  const std::vector<float> hull = hull_->Silhouette(view);
  const auto mask = Of(view, inside_);
  double both = 0, either = 0;
  for (std::size_t p = 0; p < hull.size(); ++p) {
    const bool a = mask[p] >= kInsideMask, b = hull[p] >= kInsideMask;
    both += a && b;
    either += a || b;
  }
  return both / std::max(either, 1.0);
}

Result<FoundMasks> MaskSearch::Finish(const Watch& watch) const {
  FoundMasks out;
  out.alpha.resize(full_.alpha.size());
  out.agreement.resize(views());
  workers_.For(views(), [&](std::size_t v, std::size_t) {
    if (watch.stopped()) return;
    out.agreement[v] = Agreement(v);
    const std::vector<float> mask = FullMask(v);
    // As a file of 8 bits keeps it.
    std::ranges::transform(mask, out.alpha.begin() + static_cast<std::ptrdiff_t>(v * mask.size()),
                           [](float a) { return std::floor(255 * a + 0.5f) / 255; });
  });
  TILEGRAD_TRY(watch.At(kDone));
  return out;
}

}  // namespace

Result<FoundMasks> FindMasks(const FitInput& input, const Workers& workers, const Watch& watch) {
  TILEGRAD_TRY(watch.At({"finding masks", 0, kRounds + 1, ""}));
  TILEGRAD_ASSIGN(const Sphere sphere, GuessSphere(input));
  MaskSearch search(input, sphere.centre, workers);
  TILEGRAD_TRY(search.CheckReach());
  TILEGRAD_TRY(search.Run(watch));
  return search.Finish(watch);
}

}  // namespace tilegrad::train
