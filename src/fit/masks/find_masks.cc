// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/find_masks.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "base/error.h"
#include "fit/masks/color_odds.h"
#include "fit/masks/common_hull.h"
#include "fit/masks/floor.h"
#include "fit/masks/holes.h"
#include "fit/quarter_turn.h"
#include "fit/sphere.h"

namespace tilegrad::train {
namespace {

constexpr float kLeastVariance = 2e-4f;  // of the difference of neighbours' colours: noise
constexpr float kDiagonal = 1 / std::numbers::sqrt2_v<float>;

// Labels of pixels that agree with their neighbours, but for where the picture has an edge: the
// mean field of an Ising model whose couplings fall with the difference of colours (Y. Boykov,
// M.-P. Jolly: Interactive graph cuts, ICCV 2001).
class PixelField {
 public:
  // `color` [3,H,W]. Eight neighbours couple by exp(-d^2 / 2 s^2) over their distance, where s^2 is
  // the mean d^2 of the picture, at least that of its noise.
  PixelField(std::span<const float> color, int width, int height)
      : width_(width), height_(height), stride_(static_cast<std::size_t>(width) + 2) {
    const std::size_t plane = color.size() / 3;
    const auto between = [&](int x, int y, int u, int v) {
      const std::size_t p = static_cast<std::size_t>(y * width + x),
                        q = static_cast<std::size_t>(v * width + u);
      float sum = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const float d = color[c * plane + p] - color[c * plane + q];
        sum += d * d;
      }
      return sum;
    };
    double total = 0;
    const auto fill = [&](int dx, int dy, std::vector<float>* to) {
      to->assign(stride_ * static_cast<std::size_t>(height + 2), 0.0f);
      for (int y = 0; y + dy < height; ++y) {
        for (int x = std::max(0, -dx); x < width - std::max(0, dx); ++x) {
          const float d = between(x, y, x + dx, y + dy);
          total += static_cast<double>(d);
          (*to)[At(x, y)] = d;
        }
      }
    };
    fill(1, 0, &right_);
    fill(0, 1, &below_);
    fill(1, 1, &below_right_);
    fill(-1, 1, &below_left_);
    const float variance =
        std::max(static_cast<float>(total / (4 * static_cast<double>(plane))), kLeastVariance);
    const auto couple = [&](int dx, int dy, float weight, std::vector<float>* to) {
      for (int y = 0; y + dy < height; ++y)
        for (int x = std::max(0, -dx); x < width - std::max(0, dx); ++x)
          (*to)[At(x, y)] = weight * std::exp(-(*to)[At(x, y)] / (2 * variance));
    };
    couple(1, 0, 1, &right_);
    couple(0, 1, 1, &below_);
    couple(1, 1, kDiagonal, &below_right_);
    couple(-1, 1, kDiagonal, &below_left_);
  }

  struct Relaxing {
    int rounds = 40;
    float coupling = 1;  // of like neighbours at the end; it grows from 0
  };
  // `odds` [H,W], ln: of each pixel by itself. Returns in [0, 1] how far it belongs inside.
  std::vector<float> Relax(std::span<const float> odds, const Relaxing& how) const {
    // Means of +1 inside and -1 outside, within a border of zeros.
    std::vector<float> mean(right_.size()), next(right_.size());
    const std::size_t s = stride_;
    const auto wide = static_cast<std::size_t>(width_);
    for (int round = 0; round <= how.rounds; ++round) {
      const float k = how.coupling * static_cast<float>(round) / static_cast<float>(how.rounds);
      const float* m = mean.data();
      for (int y = 0; y < height_; ++y) {
        const std::size_t row = At(0, y);
        const float* own = &odds[static_cast<std::size_t>(y) * wide];
        for (std::size_t x = 0; x < wide; ++x) {
          const std::size_t p = row + x;
          const float near = right_[p] * m[p + 1] + right_[p - 1] * m[p - 1] +
                             below_[p] * m[p + s] + below_[p - s] * m[p - s];
          const float across =
              below_right_[p] * m[p + s + 1] + below_right_[p - s - 1] * m[p - s - 1] +
              below_left_[p] * m[p + s - 1] + below_left_[p - s + 1] * m[p - s + 1];
          const float a = own[x] + k * (near + across);
          next[p] = a / std::sqrt(4 + a * a);  // as tanh(a / 2), without its cost
        }
      }
      mean.swap(next);
    }
    std::vector<float> out(odds.size());
    for (std::size_t p = 0; p < out.size(); ++p)
      out[p] = 0.5f + 0.5f * mean[At(static_cast<int>(p % wide), static_cast<int>(p / wide))];
    return out;
  }

 private:
  // Of planes with a border of one pixel.
  std::size_t At(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * stride_ + static_cast<std::size_t>(x + 1);
  }

  int width_, height_;
  std::size_t stride_;
  std::vector<float> right_, below_, below_right_, below_left_;  // couplings, 0 across the border
};

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
  MaskSearch(const FitInput& input, glm::vec3 middle, const Workers& workers)
      : full_(input.images),
        up_(UpOf(HeldCameras(input, input.cameras))),
        workers_(workers),
        factor_(std::max(1, std::max(full_.width, full_.height) / kRoundSide)),
        images_(Reduce(full_, factor_)),
        odds_(images_, workers),
        inside_(images_.alpha.size()),
        on_floor_(images_.alpha.size()),
        in_false_hole_(images_.alpha.size()) {
    for (const Camera& c : input.cameras)
      cameras_.push_back(Reduced(c, static_cast<float>(factor_)));
    hull_.emplace(cameras_, ImageSize{images_.width, images_.height}, middle, workers);
    for (std::size_t v = 0; v < views(); ++v)
      fields_.emplace_back(std::span(images_.color).subspan(3 * v * plane(), 3 * plane()),
                           images_.width, images_.height);
    Start(middle);
  }

  Status CheckReach() const {
    if (std::isnormal(hull_->reach())) return {};
    return InvalidArgument("masks cannot be found: the views see {:.3g} of what they look at",
                           hull_->reach());
  }

  Status Run(const Watch& watch) {
    for (int round = 0; round < kRounds; ++round) {
      TILEGRAD_TRY(watch.At({"finding masks", static_cast<std::uint64_t>(round), kRounds + 1, ""}));
      Round(static_cast<double>(round) / (kRounds - 1));
    }
    return RunHoleRounds(watch);
  }

  // At full resolution.
  Result<FoundMasks> Finish(const Watch& watch) const {
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

 private:
  std::size_t views() const { return cameras_.size(); }
  std::size_t plane() const { return images_.pixels(); }
  std::span<const float> Of(std::size_t view, const std::vector<float>& values) const {
    return std::span(values).subspan(view * plane(), plane());
  }
  std::span<float> Of(std::size_t view, std::vector<float>* values) const {
    return std::span(*values).subspan(view * plane(), plane());
  }

  // Belief falls with the distance from where all views look; the hull holds all that they see.
  void Start(glm::vec3 middle) {
    hull_->Vote(std::vector<float>(inside_.size(), 1.0f), kFirstTolerance, workers_);
    floor_.emplace(images_, cameras_, Floor::Region{middle, hull_->reach(), up_}, workers_);
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

  // Closed holes change the hull and the floor's colours, which reveal more, so each round looks
  // again.
  Status RunHoleRounds(const Watch& watch) {
    bool any = false;
    for (int round = 0; round < kHoleRounds; ++round) {
      TILEGRAD_TRY(watch.At({"finding masks", kRounds, kRounds + 1, ""}));
      any = CloseFalseHoles() || any;
      if (!any) break;
      Round(1);
    }
    return watch.At({"finding masks", kRounds, kRounds + 1, ""});
  }

  // A true hole shows the floor as other views see it, or what lies beyond; a false one, a part of
  // the object in the background's colours. Returns whether there was a false one.
  bool CloseFalseHoles() {
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

  std::vector<std::vector<Hole>> FindHoles() const {
    std::vector<std::vector<Hole>> out(views());
    workers_.For(views(), [&](std::size_t v, std::size_t) {
      out[v] = HolesOf(Of(v, inside_), {images_.width, images_.height});
    });
    return out;
  }

  void RelearnFloor(const std::vector<std::vector<Hole>>& holes) {
    std::vector<float> in_hole(inside_.size());
    for (std::size_t v = 0; v < views(); ++v) {
      for (const Hole& hole : holes[v]) {
        for (const std::size_t p : hole.pixels) Of(v, &in_hole)[p] = 1;
      }
    }
    floor_->Relearn(inside_, in_hole, workers_);
  }

  void Round(double time) {
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

  std::vector<float> Enlarged(std::span<const float> values) const {
    std::vector<float> out(full_.pixels());
    const auto wide = static_cast<std::size_t>(full_.width);
    for (std::size_t p = 0; p < out.size(); ++p) {
      const int x = std::min(static_cast<int>(p % wide) / factor_, images_.width - 1),
                y = std::min(static_cast<int>(p / wide) / factor_, images_.height - 1);
      out[p] = values[static_cast<std::size_t>(y * images_.width + x)];
    }
    return out;
  }

  std::vector<float> FullMask(std::size_t view) const {
    std::vector<float> odds = odds_.Of(full_, view, Enlarged(Of(view, on_floor_)));
    RaiseOdds(Enlarged(Of(view, in_false_hole_)), &odds);
    const std::vector<float> before = Enlarged(Of(view, inside_));
    for (std::size_t p = 0; p < odds.size(); ++p) odds[p] += kKept * (2 * before[p] - 1);
    const std::size_t pixels = full_.pixels();
    const PixelField field(std::span(full_.color).subspan(3 * view * pixels, 3 * pixels),
                           full_.width, full_.height);
    return field.Relax(odds, kRelaxing);
  }

  double Agreement(std::size_t view) const {
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

  const TargetImages& full_;
  const glm::vec3 up_;
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
