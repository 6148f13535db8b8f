// SPDX-License-Identifier: Apache-2.0
// Vector body of product_adam.h: the loops of gemm-inl.h around groups of rows that stay in cache
// until Adam has used them.

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <bit>
#include <optional>

#include "nn/kernels/adam-inl.h"
#include "nn/kernels/gemm-inl.h"
#include "nn/kernels/product_adam.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// Each work item packs its own columns of B; rows of that many columns are long enough for memory.
// Two groups of rows of C stay in L2 beside those columns.
constexpr GemmItems kUpdateItems{.rows = 256, .columns = 1024};
// The minimum, so that many workers have two items each of a smaller matrix.
constexpr GemmItems kLeastUpdateItems{.rows = 32, .columns = 256};
constexpr std::size_t kEnoughItemsFor = 4;  // workers
constexpr std::size_t kGroupPanels = 2;     // row panels in a group: the best of 1 to 8

static_assert(kMostProductAdamSteps <= kDepth);  // else a group would be summed in several passes

inline GemmItems UpdateItemsFor(const GemmProblem<float>& p, std::size_t workers) {
  GemmItems items = kUpdateItems;
  if (workers <= kEnoughItemsFor) return items;
  const auto too_few = [&] {
    return DivideUp(p.m, items.rows) * DivideUp(p.n, items.columns) < 2 * workers;
  };
  while (too_few() && items.rows > kLeastUpdateItems.rows) items.rows /= 2;
  while (too_few() && items.columns > kLeastUpdateItems.columns) items.columns /= 2;
  return items;
}

struct ProductAdamPlan {
  ProductAdamPlan(const ProductAdamProblem& problem, std::size_t workers)
      : gemm(problem.product, UpdateItemsFor(problem.product, workers)),
        adam(problem.adam),
        rule(problem.adam.coefficients),
        portions(problem.portions) {}

  // Stride between rows of a group: one extra line, so that they do not share cache sets.
  std::size_t group_ld() const { return gemm.column_blocks.largest() * kTileColumns + kLineFloats; }
  std::size_t group_size() const {
    return RoundUp(kGroupPanels * gemm.rows.largest() * group_ld(), kAlignment);
  }
  std::size_t packed_b_size() const {
    return RoundUp(gemm.column_blocks.largest() * PackedPanelStride(gemm.p.k), kAlignment);
  }
  // Per worker: packed columns, the group being computed and the one that Adam uses.
  std::size_t worker_size() const { return packed_b_size() + 2 * group_size(); }

  GemmPlan gemm;
  AdamProblem<float> adam;
  AdamRule rule;
  std::size_t portions;
};

// Adam over some rows and columns of the gradient, in small portions: the multiplication calls it
// between tiles, so that its prefetches arrive while a tile is computed.
class GroupUpdater {
 public:
  GroupUpdater() = default;  // no rows
  // gradient: for these rows and columns; rows are plan.group_ld() apart.
  GroupUpdater(const ProductAdamPlan& plan, Panels::Range rows, const ColumnBlock& columns,
               const float* gradient)
      : plan_(&plan),
        row_(rows.begin),
        end_row_(rows.end),
        begin_(columns.begin),
        columns_(columns.end - columns.begin),
        gradient_(gradient) {}

  // As many numbers as a tile has. Not inlined, or the tile's sums would not stay in registers.
  HWY_NOINLINE void Run() {
    if (row_ < end_row_) Update(kTileRows * kTileColumns);
  }
  void Finish() {
    while (row_ < end_row_) Update(columns_);
  }

 private:
  // The next `count` numbers of the current row, or the rest of it.
  HWY_INLINE void Update(std::size_t count) {
    const AdamRule rule = plan_->rule;
    const std::size_t ld = plan_->gemm.p.n, at = row_ * ld + begin_;
    const std::size_t next_row = row_ + 1 < plan_->gemm.p.m ? ld : 0;
    float* const p = plan_->adam.parameter + at;
    float* const m = plan_->adam.m + at;
    float* const v = plan_->adam.v + at;
    const std::size_t end = std::min(columns_, column_ + count);
    for (std::size_t i = column_; i < end; i += kLanes) {
      if (i % kLineFloats == 0) {
        for (const float* x : {p, m, v}) PrefetchLine(x + next_row + i);
      }
      const std::size_t lanes = std::min(kLanes, end - i);
      rule.Update(LoadSome(DF(), gradient_ + i, lanes), p + i, m + i, v + i, lanes);
    }
    column_ = end;
    if (column_ == columns_) {
      column_ = 0;
      ++row_;
      gradient_ += plan_->group_ld();
    }
  }

  const ProductAdamPlan* plan_ = nullptr;
  std::size_t row_ = 0, end_row_ = 0;
  std::size_t begin_ = 0, columns_ = 0, column_ = 0;
  const float* gradient_ = nullptr;
};

constexpr std::size_t kTileFloats = kTileRows * kTileColumns;
// Levels of the tree over portions, from single ones to all of them.
constexpr std::size_t kMostTreeLevels =
    static_cast<std::size_t>(std::bit_width(kMostProductAdamSteps));

inline HWY_NOINLINE void MultiplyPortion(const float* packed_a, std::size_t rows,
                                         const float* packed_b, std::size_t steps, float* tile) {
  PackedRowsTile(packed_a, rows, PackedColumns{packed_b}, steps,
                 TileTarget{.c = tile,
                            .ldc = kTileColumns,
                            .offset = {0, kLanes},
                            .count = {kLanes, kTileColumns - kLanes}});
}

// A tile of the mean over portions: `rows` rows of kTileColumns floats, `ld` apart in `out`. Each
// portion's product is added to the sums of its left neighbours in the tree, smaller ones first.
inline HWY_NOINLINE void MeanTile(const ProductAdamPlan& plan, const float* packed_a,
                                  std::size_t rows, const float* packed_b, float* out) {
  const DF d;
  HWY_ALIGN float levels[kMostTreeLevels * kTileFloats];
  const std::size_t steps = plan.gemm.p.k / plan.portions, floats = rows * kTileColumns;
  float* sum = levels;
  for (std::size_t portion = 0; portion < plan.portions; ++portion) {
    const auto climb = static_cast<std::size_t>(std::countr_one(portion));
    sum = levels + climb * kTileFloats;
    MultiplyPortion(packed_a + portion * steps * rows, rows,
                    packed_b + portion * steps * kTileColumns, steps, sum);
    for (const float* left = levels; left < sum; left += kTileFloats) {
      for (std::size_t i = 0; i < floats; i += kLanes)
        hn::Store(hn::Add(hn::Load(d, left + i), hn::Load(d, sum + i)), d, sum + i);
    }
  }
  const VF share = hn::Set(d, 1 / static_cast<float>(plan.portions));
  for (std::size_t r = 0; r < rows; ++r, sum += kTileColumns, out += plan.group_ld()) {
    for (std::size_t i = 0; i < kTileColumns; i += kLanes)
      hn::StoreU(hn::Mul(hn::Load(d, sum + i), share), d, out + i);
  }
}

// Multiplies row panels [first, end) with the packed columns into `group`, interleaved with Adam
// over `before`.
inline HWY_NOINLINE void MultiplyGroup(const ProductAdamPlan& plan, Panels::Range panels,
                                       const float* packed_a, const ColumnPacker& columns,
                                       float* group, GroupUpdater& before) {
  const ColumnBlock& block = columns.block();
  const Panels& rows = plan.gemm.rows;
  GemmProblem<float> out;
  out.n = block.end - block.begin;
  out.c = group;
  out.ldc = plan.group_ld();
  for (std::size_t j = 0; j < block.panels(); ++j) {
    for (std::size_t panel = panels.begin; panel < panels.end; ++panel) {
      const std::size_t row = rows.begin(panel), group_row = row - rows.begin(panels.begin);
      if (plan.portions > 1) {
        MeanTile(plan, packed_a + row * block.steps, rows.size(panel), columns.panel(j),
                 group + group_row * out.ldc + j * kTileColumns);
      } else {
        PackedRowsTile(packed_a + row * block.steps, rows.size(panel),
                       PackedColumns{columns.panel(j)}, block.steps,
                       TargetOf(out, group_row, j * kTileColumns, true));
      }
      before.Run();
    }
  }
  before.Finish();
}

// Work item: one block of rows by one block of columns. memory: plan.worker_size() floats.
inline void UpdateItem(const ProductAdamPlan& plan, std::size_t item, const float* packed_a,
                       float* memory) {
  const GemmPlan& gemm = plan.gemm;
  const ColumnBlock block = gemm.Columns(item / gemm.row_blocks.count());
  const ColumnPacker columns(gemm.p, block, memory);
  columns.Pack();
  const Panels::Range row_panels = gemm.row_blocks.range(item % gemm.row_blocks.count());
  const Panels groups(row_panels.end - row_panels.begin, kGroupPanels);
  GroupUpdater updater;
  for (std::size_t g = 0; g < groups.count(); ++g) {
    float* gradient = memory + plan.packed_b_size() + g % 2 * plan.group_size();
    const Panels::Range panels = groups.range(g, row_panels.begin);
    MultiplyGroup(plan, panels, packed_a, columns, gradient, updater);
    updater = GroupUpdater(plan, {gemm.rows.begin(panels.begin), gemm.rows.begin(panels.end)},
                           block, gradient);
  }
  updater.Finish();
}

// The plans of several steps, and the addresses of what they share.
struct ProductAdamPlans {
  ProductAdamPlans(std::span<const ProductAdamProblem> problems, std::size_t workers)
      : count(problems.size()) {
    for (std::size_t i = 0; i < count; ++i) {
      const auto& plan = plans[i].emplace(problems[i], workers);
      panels[i + 1] = panels[i] + plan.gemm.rows.count();
      items[i + 1] = items[i] + plan.gemm.items();
      packed[i + 1] = packed[i] + RoundUp(plan.gemm.packed_a_size(), kAlignment);
      worker_size = std::max(worker_size, plan.worker_size());
      bytes += static_cast<double>(plan.adam.n * 6 * sizeof(float));
    }
  }

  // Calls run(plan number, index in the plan) for item `at`, where `ends` counts items.
  template <class Ends, class Run>
  void In(const Ends& ends, std::size_t at, const Run& run) const {
    std::size_t i = 0;
    while (at >= ends[i + 1]) ++i;
    run(i, at - ends[i]);
  }

  using Sums = std::array<std::size_t, kMostProductAdams + 1>;  // over the plans before
  std::size_t count;
  std::array<std::optional<ProductAdamPlan>, kMostProductAdams> plans;
  Sums panels{}, items{}, packed{};
  std::size_t worker_size = 0;
  double bytes = 0;
};

inline void ProductAdamsTarget(std::span<const ProductAdamProblem> problems,
                               const KernelContext& context) {
  const auto workers = context.workers.size();
  const ProductAdamPlans all(problems, workers);
  const std::size_t a_size = all.packed[all.count];
  float* packed_a = context.scratch.Floats(a_size + all.worker_size * workers);
  context.workers.For(all.panels[all.count], [&](std::size_t index) {
    all.In(all.panels, index, [&](std::size_t i, std::size_t panel) {
      PackRowPanel(all.plans[i]->gemm, panel, 0, 1, packed_a + all.packed[i]);
    });
  });
  context.workers.NoteTraffic(all.bytes);
  context.workers.For(all.items[all.count], [&](std::size_t index, std::size_t worker) {
    all.In(all.items, index, [&](std::size_t i, std::size_t item) {
      UpdateItem(*all.plans[i], item, packed_a + all.packed[i],
                 packed_a + a_size + worker * all.worker_size);
    });
  });
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
