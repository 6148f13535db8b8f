// SPDX-License-Identifier: Apache-2.0
#include "fit/hull/hollows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <optional>
#include <span>
#include <vector>

#include "base/error.h"
#include "fit/hull/hollow_shape.h"
#include "fit/hull/photo_views.h"

namespace tilegrad::train {
namespace {

constexpr int kMostCells = 128;  // along the longest side of the grid that shapes are tried on
constexpr int kMostHollows = 3;

// What is tried: a few shapes for each rim; then, for the best rim, each number in turn.
constexpr HollowShape kGlances[] = {{2},           {4},          {8},
                                    {2.5f, 0.45f}, {2.5f, 0.8f}, {2.5f, 0.2f, 0, 10}};
constexpr float kWalls[] = {1.5f, 2, 2.5f, 3, 4, 6, 8, 12};
constexpr float kFloors[] = {0, 0.08f, 0.15f, 0.22f, 0.3f, 0.45f, 0.6f, 0.75f, 0.88f};
constexpr float kTapers[] = {0, 0.15f, 0.3f, 0.6f, 1};
constexpr float kReaches[] = {4, 2, 8, 16};
constexpr HollowShape kWidest = {.wall = 1.5f, .reach = 10};
constexpr int kSweeps = 2;
// A number is the first in its list that none other beats by more than this share of the gain: the
// floor of a cup of one colour gives no evidence, and is then as thick as the walls.
constexpr double kTie = 0.02;
// The share of the pixels known with the list's best that must be known: nothing contradicts what
// few pixels show.
constexpr double kLeastKnown = 0.5;

// Cells behind the hull's surface where a hollow begins below its lid. Those that views look into
// from the side begin behind a wall, two cells and more, and show the outside's colours.
constexpr float kLookInside = 1;
constexpr float kPartReach = 4;       // cells behind the surface where a part of a hollow may begin
constexpr int kLidReach = 4;          // cells above and below a rim that belong to its lid
constexpr double kLeastDoubt = 0.01;  // mean difference of colours on a lid
// Columns in doubt differ by that much, and by this share of what the worst tenth does.
constexpr float kDoubtfulColumn = 0.015f, kDoubtfulShare = 0.35f;
constexpr int kColumnReach = 2;   // cells around a column that its mean is over
constexpr int kColumnMargin = 3;  // cells that are added around columns in doubt

// Heights of flat lids, shares of the rim's.
constexpr float kLids[] = {0.95f, 1};
// What convinces.
constexpr double kMostOfHull = 0.7, kMostOfLid = 0.85;  // of the difference on either
constexpr double kLeastGain = 0.004;
constexpr std::size_t kLeastPixels = 60;
// Of the hull's cells. Those of cups, bowls and a jar are 0.16 to 0.79 of it; one of 0.0014 below
// the seat of a footstool was none.
constexpr double kLeastShare = 0.05;

constexpr float kTolerated = 0.004f;  // what the rays through a cell may lose, mean
constexpr float kSeen = 0.05f;        // rays through a cell, blurred
constexpr int kBlurs = 2;
constexpr std::size_t kMostUnseen = 3;  // cells for each that is seen, where a shape is trusted

ScalarGrid EveryNth(const ScalarGrid& fine, int n) {
  ScalarGrid out{{}, fine.low, fine.cell * static_cast<float>(n), {}};
  for (std::size_t a = 0; a < 3; ++a) out.size[a] = (fine.size[a] - 1) / n + 1;
  for (int i = 0; i < out.size[0]; ++i)
    for (int j = 0; j < out.size[1]; ++j)
      for (int k = 0; k < out.size[2]; ++k)
        out.values.push_back(fine.values[fine.At(n * i, n * j, n * k)]);
  return out;
}

void Subtract(const ScalarGrid& hollow, const Workers& workers, ScalarGrid* hull) {
  workers.For(static_cast<std::size_t>(hull->size[0]), [&](std::size_t x, std::size_t) {
    const int i = static_cast<int>(x);
    for (int j = 0; j < hull->size[1]; ++j) {
      for (int k = 0; k < hull->size[2]; ++k) {
        float& value = hull->values[hull->At(i, j, k)];
        value = std::min(value, -SampleGrid(hollow, hull->low + hull->cell * glm::vec3(i, j, k)));
      }
    }
  });
}

ScalarGrid Less(const ScalarGrid& hull, const ScalarGrid& hollow) {
  ScalarGrid out = hull;
  for (std::size_t i = 0; i < out.values.size(); ++i)
    out.values[i] = std::min(out.values[i], -hollow.values[i]);
  return out;
}

// How much views differ over pixels that look into a hollow: sums.
struct Evidence {
  double before = 0, after = 0;
  std::size_t pixels = 0;

  void Add(float was, float is) {
    before += static_cast<double>(was);
    after += static_cast<double>(is);
    ++pixels;
  }
  bool convinces(double most_left) const {
    return pixels >= kLeastPixels && after < most_left * before &&
           before - after > kLeastGain * static_cast<double>(pixels);
  }
};

// Of a grid's numbers: means over three cells along each axis.
void Blur(const std::array<int, 3>& size, std::vector<float>* values) {
  const auto z = static_cast<std::size_t>(size[2]);
  for (const std::size_t stride : {z * static_cast<std::size_t>(size[1]), z, std::size_t{1}}) {
    const std::vector<float> in = *values;
    for (std::size_t i = stride; i + stride < in.size(); ++i)
      (*values)[i] = (in[i - stride] + in[i] + in[i + stride]) / 3;
  }
}

class HollowSearch {
 public:
  HollowSearch(const FitInput& input, ScalarGrid hull, const Workers& workers)
      : hull_(std::move(hull)),
        workers_(workers),
        views_(input, hull_, workers),
        seeing_(views_.Seeing()),
        agreement_(views_.Agree(seeing_, workers_)) {}

  // The hollows of the rim that gains most, positive inside, which the hull is less by then.
  std::optional<ScalarGrid> Next() {
    Best best;
    std::optional<HollowRim> rim;
    for (const int layer : RimsOf(hull_)) {
      for (const Footprint& footprint : {AllColumns(hull_), DoubtfulColumns(layer)}) {
        HollowRim next(hull_, layer, footprint, workers_);
        const Best found = Glance(next);
        if (found.gain <= best.gain) continue;
        best = found;
        rim.emplace(std::move(next));
      }
    }
    if (!rim.has_value()) return std::nullopt;
    const Lookers lookers = LookersInto(rim->Hollow(kWidest));
    HollowShape shape = Refined(*rim, lookers, best.shape);
    ScalarGrid hollow = rim->Hollow(shape);
    FillUnproven(lookers, &hollow);
    std::vector<ScalarGrid> lids;
    for (const float height : kLids) {
      shape.floor = height;
      lids.push_back(rim->Hollow(shape));
    }
    if (!KeepConvincing(lookers, lids, &hollow) || ShareOf(hollow) < kLeastShare)
      return std::nullopt;
    hull_ = Less(hull_, hollow);
    views_.Look(seeing_, hull_, workers_);
    agreement_ = views_.Agree(seeing_, workers_);
    return hollow;
  }

 private:
  using Pixels = std::vector<PhotoViews::Pixel>;

  // Pixels that may look into a hollow, and their differences of colours on the hull.
  struct Lookers {
    Pixels pixels;
    std::vector<float> before;

    double doubt() const {
      double sum = 0;
      for (const float d : before) sum += static_cast<double>(d);
      return sum / static_cast<double>(std::max<std::size_t>(1, pixels.size()));
    }
  };
  struct Best {
    HollowShape shape;
    double gain = 0;  // sum over pixels
  };
  // What lookers see through a hollow.
  struct Insight {
    std::vector<PhotoViews::Agreement> agreement;
    std::vector<float> depths;
  };

  std::array<int, 3> CellOf(glm::vec3 point) const {
    const glm::vec3 at = glm::vec3(0.5f) + (point - hull_.low) / hull_.cell;
    std::array<int, 3> cell;
    for (int a = 0; a < 3; ++a) {
      const int last = hull_.size[static_cast<std::size_t>(a)] - 1;
      cell[static_cast<std::size_t>(a)] = std::clamp(static_cast<int>(at[a]), 0, last);
    }
    return cell;
  }

  template <class Visit>
  void AroundColumn(int i, int k, int reach, const Visit& visit) const {
    for (int x = std::max(0, i - reach); x <= std::min(i + reach, hull_.size[0] - 1); ++x)
      for (int z = std::max(0, k - reach); z <= std::min(k + reach, hull_.size[2] - 1); ++z)
        visit(static_cast<std::size_t>(x * hull_.size[2] + z));
  }

  // Mean difference of colours on a lid, by columns; negative where no pixel sees it.
  std::vector<float> DoubtByColumn(int layer) const {
    const std::size_t area = AllColumns(hull_).size();
    std::vector<float> sums(area, 0), counts(area, 0), means(area, -1);
    for (std::size_t n = 0; n < seeing_.size(); ++n) {
      const auto [i, j, k] = CellOf(views_.PointOf(seeing_[n]));
      if (!agreement_[n].known || std::abs(j - layer) > kLidReach) continue;
      const auto at = static_cast<std::size_t>(i * hull_.size[2] + k);
      sums[at] += agreement_[n].difference;
      counts[at] += 1;
    }
    for (int i = 0; i < hull_.size[0]; ++i) {
      for (int k = 0; k < hull_.size[2]; ++k) {
        float sum = 0, count = 0;
        AroundColumn(i, k, kColumnReach, [&](std::size_t at) {
          sum += sums[at];
          count += counts[at];
        });
        if (count > 0) means[static_cast<std::size_t>(i * hull_.size[2] + k)] = sum / count;
      }
    }
    return means;
  }

  // Where views disagree on a lid, and some cells around: a wash basin in its cabinet.
  Footprint DoubtfulColumns(int layer) const {
    const std::vector<float> means = DoubtByColumn(layer);
    Footprint out(means.size(), 0);
    std::vector<float> sorted;
    std::ranges::copy_if(means, std::back_inserter(sorted), [](float m) { return m >= 0; });
    if (sorted.empty()) return out;
    std::ranges::sort(sorted);
    const float least = std::max(kDoubtfulColumn, kDoubtfulShare * sorted[sorted.size() * 9 / 10]);
    for (int i = 0; i < hull_.size[0]; ++i)
      for (int k = 0; k < hull_.size[2]; ++k)
        if (means[static_cast<std::size_t>(i * hull_.size[2] + k)] > least)
          AroundColumn(i, k, kColumnMargin, [&](std::size_t at) { out[at] = 1; });
    return out;
  }

  Lookers LookersInto(const ScalarGrid& hollow) const {
    Lookers out;
    for (std::size_t i = 0; i < seeing_.size(); ++i) {
      bool enters = false;
      for (float cells = 0; cells <= kLookInside && !enters; ++cells)
        enters = SampleGrid(hollow, views_.PointOf(seeing_[i], cells * hollow.cell)) > 0;
      if (!enters) continue;
      out.pixels.push_back(seeing_[i]);
      out.before.push_back(agreement_[i].difference);
    }
    return out;
  }

  // Of every `stride`-th looker; depths of all.
  Insight LookThrough(const Lookers& lookers, const ScalarGrid& hollow, std::size_t stride) {
    const auto depths = views_.Depths(lookers.pixels);
    views_.Look(lookers.pixels, Less(hull_, hollow), workers_);
    Pixels some;
    for (std::size_t i = 0; i < lookers.pixels.size(); i += stride)
      some.push_back(lookers.pixels[i]);
    Insight out{views_.Agree(some, workers_), views_.Depths(lookers.pixels)};
    views_.SetDepths(lookers.pixels, depths);
    return out;
  }

  using Agreements = std::vector<PhotoViews::Agreement>;

  static constexpr std::size_t kStride = 3;
  Agreements AgreeThrough(const Lookers& lookers, const ScalarGrid& hollow) {
    return LookThrough(lookers, hollow, kStride).agreement;
  }

  // The mean difference; that on the hull where a hollow's inside is not known.
  static double MeanOf(const Lookers& lookers, const Agreements& seen) {
    double sum = 0;
    for (std::size_t i = 0; i < seen.size(); ++i)
      sum += static_cast<double>(seen[i].known ? seen[i].difference : lookers.before[kStride * i]);
    return sum / static_cast<double>(seen.size());
  }

  static std::size_t Known(const Agreements& seen) {
    return static_cast<std::size_t>(std::ranges::count(seen, true, &PhotoViews::Agreement::known));
  }

  // How much more views differ through one hollow than through another: a sum over the pixels for
  // which both insides are known. What only one shows speaks for neither: fewer views look down to
  // the floor of a deep jar than onto a floor that is too high.
  static double Excess(const Agreements& one, const Agreements& other) {
    double sum = 0;
    for (std::size_t i = 0; i < one.size(); ++i)
      if (one[i].known && other[i].known)
        sum += static_cast<double>(one[i].difference - other[i].difference);
    return sum;
  }

  // The first hollow whose excess over any other is at most `slack`; if there is none, the one
  // whose greatest excess is least.
  static std::size_t FirstUnbeaten(const std::vector<Agreements>& seen, double slack) {
    std::vector<std::size_t> known;
    for (const Agreements& s : seen) known.push_back(Known(s));
    const double enough = kLeastKnown * static_cast<double>(*std::ranges::max_element(known));
    std::size_t best = 0;
    double least = HUGE_VAL;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (static_cast<double>(known[i]) < enough) continue;
      double worst = slack;
      for (const Agreements& other : seen) worst = std::max(worst, Excess(seen[i], other));
      if (worst >= least) continue;
      least = worst;
      best = i;
    }
    return best;
  }

  Best Glance(const HollowRim& rim) {
    const Lookers lookers = LookersInto(rim.Hollow(kWidest));
    const double doubt = lookers.doubt();
    if (lookers.pixels.size() < kLeastPixels || doubt < kLeastDoubt) return {};
    Best best;
    for (const HollowShape& shape : kGlances) {
      const double left = MeanOf(lookers, AgreeThrough(lookers, rim.Hollow(shape)));
      const double gain = static_cast<double>(lookers.pixels.size()) * (doubt - left);
      if (gain > best.gain) best = {shape, gain};
    }
    return best;
  }

  HollowShape Refined(const HollowRim& rim, const Lookers& lookers, HollowShape shape) {
    const double doubt = lookers.doubt();
    const auto sweep = [&](float HollowShape::*number, std::span<const float> values) {
      std::vector<Agreements> seen;
      double least = doubt;
      for (const float value : values) {
        shape.*number = value;
        seen.push_back(AgreeThrough(lookers, rim.Hollow(shape)));
        least = std::min(least, MeanOf(lookers, seen.back()));
      }
      const double slack = kTie * (doubt - least) * static_cast<double>(seen[0].size());
      shape.*number = values[FirstUnbeaten(seen, slack)];
    };
    for (int i = 0; i < kSweeps; ++i) {
      const HollowShape before = shape;
      sweep(&HollowShape::wall, kWalls);
      sweep(&HollowShape::floor, kFloors);
      sweep(&HollowShape::taper, kTapers);
      sweep(&HollowShape::reach, kReaches);
      if (shape == before) break;
    }
    return shape;
  }

  // Sums over the rays that look through each cell and end where views know the colour, blurred.
  struct CellSums {
    std::vector<float> gains, rays;
  };
  CellSums SumOverCells(const Lookers& lookers, const ScalarGrid& hollow) {
    const Insight seen = LookThrough(lookers, hollow, 1);
    const auto from = views_.Depths(lookers.pixels);
    const std::vector<float> zeros(hollow.values.size(), 0);
    CellSums out{zeros, zeros};
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (!seen.agreement[i].known || !std::isfinite(seen.depths[i])) continue;
      views_.Trace(lookers.pixels[i], from[i], seen.depths[i], hull_.cell, [&](glm::vec3 point) {
        const auto [x, y, z] = CellOf(point);
        const std::size_t at = hull_.At(x, y, z);
        out.gains[at] += lookers.before[i] - seen.agreement[i].difference;
        out.rays[at] += 1;
      });
    }
    for (int i = 0; i < kBlurs; ++i) {
      Blur(hull_.size, &out.gains);
      Blur(hull_.size, &out.rays);
    }
    return out;
  }

  // Fills cells through which views agree less than on the lid; and, where they are too many for
  // the shape to be trusted, those that no ray goes through.
  void FillUnproven(const Lookers& lookers, ScalarGrid* hollow) {
    const auto [gains, rays] = SumOverCells(lookers, *hollow);
    std::size_t seen = 0, unseen = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
      if (hollow->values[i] > 0 && hull_.values[i] > 0) ++(rays[i] > kSeen ? seen : unseen);
    const bool trusted = unseen <= kMostUnseen * seen;
    for (std::size_t i = 0; i < rays.size(); ++i)
      if (rays[i] > kSeen ? gains[i] < -kTolerated * rays[i] : !trusted) Close(i, hollow);
  }

  static void Close(std::size_t cell, ScalarGrid* hollow) {
    hollow->values[cell] = std::min(hollow->values[cell], -0.5f * hollow->cell);
  }

  // Differences of colours through a hollow; those on the hull where its inside is not known.
  std::vector<float> DifferencesThrough(const Lookers& lookers, const ScalarGrid& hollow) {
    const auto seen = LookThrough(lookers, hollow, 1).agreement;
    std::vector<float> out = lookers.before;
    for (std::size_t i = 0; i < out.size(); ++i)
      if (seen[i].known) out[i] = seen[i].difference;
    return out;
  }

  // Leaves the parts for which colours speak; false if there is none. Beside the hull itself, what
  // a part must be better than is a lid that is flat, at the rim or just below: below a lid of one
  // colour any hollow agrees, and what it gains is that the lid no longer bulges.
  bool KeepConvincing(const Lookers& lookers, std::span<const ScalarGrid> lids,
                      ScalarGrid* hollow) {
    const std::vector<int> parts = PartsOf(*hollow);
    const auto count = static_cast<std::size_t>(*std::ranges::max_element(parts)) + 1;
    std::vector<char> convinces(count, 1);
    convinces[0] = 0;
    const std::vector<float> after = DifferencesThrough(lookers, *hollow);
    const auto compare = [&](const std::vector<float>& before, double most_left) {
      std::vector<Evidence> evidence(count);
      for (std::size_t i = 0; i < after.size(); ++i)
        evidence[static_cast<std::size_t>(PartBehind(lookers.pixels[i], parts))].Add(before[i],
                                                                                     after[i]);
      for (std::size_t part = 0; part < count; ++part)
        if (!evidence[part].convinces(most_left)) convinces[part] = 0;
    };
    compare(lookers.before, kMostOfHull);
    for (const ScalarGrid& lid : lids) compare(DifferencesThrough(lookers, lid), kMostOfLid);
    for (std::size_t i = 0; i < parts.size(); ++i)
      if (!convinces[static_cast<std::size_t>(parts[i])]) Close(i, hollow);
    return std::ranges::find(convinces, 1) != convinces.end();
  }

  // Of the hull's cells.
  double ShareOf(const ScalarGrid& hollow) const {
    std::size_t inside = 0, all = 0;
    for (std::size_t i = 0; i < hull_.values.size(); ++i) {
      if (!(hull_.values[i] > 0)) continue;
      ++all;
      inside += hollow.values[i] > 0;
    }
    return static_cast<double>(inside) / static_cast<double>(all);
  }

  // The part of a hollow that a pixel looks into; 0: none.
  int PartBehind(PhotoViews::Pixel pixel, const std::vector<int>& parts) const {
    for (float cells = 0; cells <= kPartReach; cells += 0.5f) {
      const auto [i, j, k] = CellOf(views_.PointOf(pixel, cells * hull_.cell));
      if (const int part = parts[hull_.At(i, j, k)]; part > 0) return part;
    }
    return 0;
  }

  // Numbers, from 1, of the connected parts of the hull that lie in the hollow; 0 elsewhere.
  std::vector<int> PartsOf(const ScalarGrid& hollow) const {
    std::vector<int> parts(hollow.values.size(), 0);
    const auto open = [&](std::size_t at) {  // the grid's border is outside of the hull
      return parts[at] == 0 && hollow.values[at] > 0 && hull_.values[at] > 0;
    };
    std::vector<std::size_t> stack;
    int count = 0;
    for (std::size_t first = 0; first < parts.size(); ++first) {
      if (!open(first)) continue;
      parts[first] = ++count;
      stack.push_back(first);
      while (!stack.empty()) {
        const std::size_t at = stack.back();
        stack.pop_back();
        for (const std::size_t stride : {hull_.At(1, 0, 0), hull_.At(0, 1, 0), std::size_t{1}}) {
          for (const std::size_t next : {at - stride, at + stride}) {
            if (!open(next)) continue;
            parts[next] = count;
            stack.push_back(next);
          }
        }
      }
    }
    return parts;
  }

  ScalarGrid hull_;
  const Workers& workers_;
  PhotoViews views_;
  Pixels seeing_;
  std::vector<PhotoViews::Agreement> agreement_;  // of seeing_, on the hull
};

}  // namespace

Result<bool> CarveHollows(const FitInput& input, const Workers& workers, const Watch& watch,
                          ScalarGrid* hull) {
  const Progress now = {"looking for hollows", 0, 0, ""};
  TILEGRAD_TRY(watch.At(now));
  const int longest = std::max({hull->size[0], hull->size[1], hull->size[2]});
  HollowSearch search(input, EveryNth(*hull, (longest + kMostCells - 1) / kMostCells), workers);
  bool found = false;
  for (int i = 0; i < kMostHollows; ++i) {
    TILEGRAD_TRY(watch.At(now));
    const auto hollow = search.Next();
    if (!hollow.has_value()) break;
    Subtract(*hollow, workers, hull);
    found = true;
  }
  return found;
}

}  // namespace tilegrad::train
