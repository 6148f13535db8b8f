// SPDX-License-Identifier: Apache-2.0
// Sums over portions have the same bits, whoever holds the portions.
#include <gtest/gtest.h>
#include <sched.h>

#include <thread>

#include "base/parallel.h"
#include "base/rng.h"
#include "nn/nn.h"
#include "support/temp_folder.h"
#include "thread_ranks.h"
#include "train/ranks/exchange.h"
#include "train/ranks/gradient_sums.h"
#include "train/ranks/launch.h"
#include "train/ranks/process_group.h"
#include "train/ranks/weight_share.h"

namespace tilegrad::train::sums_test {

TEST(PortionTree, RanksShareAllPortionsAndSubtreesAreComplete) {
  for (std::int64_t portions = 1; portions <= 64; portions *= 2) {
    for (int ranks = 1; ranks <= portions; ++ranks) {
      std::int64_t at = 0;
      std::vector<std::int64_t> of_rank(static_cast<std::size_t>(ranks));
      for (const Subtree& s : SubtreesOf(ranks, portions)) {
        EXPECT_EQ(s.first, at);
        EXPECT_EQ(s.first % s.count, 0);
        of_rank[static_cast<std::size_t>(s.owner)] += s.count;
        at += s.count;
      }
      EXPECT_EQ(at, portions);
      const auto [least, most] = std::minmax_element(of_rank.begin(), of_rank.end());
      EXPECT_GE(*least, 1);
      EXPECT_LE(*most - *least, 1);  // nobody waits for more than one portion
    }
  }
}

// As ((a + b) + (c + d)) + ...: written down another way than the code does it.
double TreeSum(std::span<const double> values) {
  if (values.size() == 1) return values[0];
  const std::size_t half = values.size() / 2;
  return TreeSum(values.first(half)) + TreeSum(values.subspan(half));
}

std::vector<double> ValuesOf(std::int64_t portion) {
  Rng rng(7, static_cast<std::uint64_t>(portion));
  return {rng.Uniform(-1, 1), rng.Uniform(0, 1e6)};
}

TEST(ValueSums, AreThoseOfTheTree) {
  for (const std::int64_t portions : {1, 2, 8, 16}) {
    std::vector<std::vector<double>> want(2);
    for (std::int64_t p = 0; p < portions; ++p) {
      for (std::size_t k = 0; k < 2; ++k) want[k].push_back(ValuesOf(p)[k]);
    }
    for (int size = 1; size <= std::min<std::int64_t>(portions, 5); ++size) {
      OnRanks(size, [&](Transport& ranks) {
        ValueSums sums(portions, &ranks);
        for (int update = 0; update < 2; ++update) {
          sums.BeginUpdate();
          for (const Subtree& s : SubtreesOf(size, portions)) {
            for (std::int64_t p = s.first; s.owner == ranks.rank() && p < s.first + s.count; ++p)
              sums.Add(ValuesOf(p));
          }
          const auto got = sums.Finish(nullptr);
          if (ranks.rank() > 0) {
            EXPECT_TRUE(got.empty());
            continue;
          }
          ASSERT_EQ(got.size(), 2u);
          EXPECT_EQ(got[0], TreeSum(want[0])) << portions << " on " << size;
          EXPECT_EQ(got[1], TreeSum(want[1])) << portions << " on " << size;
        }
      });
    }
  }
}

// A network with a statistic, and a batch of random numbers for each portion.
struct Problem {
  Workers workers;
  nn::Context context{workers};
  nn::Sequential net;

  // Portions are shared by as many lanes as `shape` and the workers allow.
  explicit Problem(const GradientSums::Shape& shape = {}, int count = 1) : workers(count) {
    context.MakeLanes(GradientSums::MostLanes(shape));
    Rng rng(3);
    net.Add<nn::LinearLayer>("first", context, nn::LinearShape{.in = 5, .out = 7}, rng);
    net.Add<nn::BatchNorm>("norm", context, 7, nn::BatchNormOptions{.relu = true});
    net.Add<nn::LinearLayer>("second", context, nn::LinearShape{.in = 7, .out = 3}, rng);
  }
  nn::Var Loss(std::int64_t portion) {
    Rng rng(11, static_cast<std::uint64_t>(portion));
    nn::Tensor x = context.Empty({6, 5});
    for (float& v : x.span<float>()) v = static_cast<float>(rng.Uniform(-1, 1));
    return nn::Mean(nn::Square(net.Forward(nn::Constant(context, x), nn::Mode::kTrain)));
  }
  std::vector<nn::Var> Parameters() {
    std::vector<nn::Var> out;
    for (const nn::NamedVar& p : nn::Parameters(net)) out.push_back(p.value);
    return out;
  }
  // All portions of the process.
  void Run(GradientSums* sums, std::span<const nn::Var> parameters, bool listening = true) {
    sums->BeginUpdate();
    context.ForEachLane([&](std::size_t l) {
      GradientSums::Lane& lane = *sums->lanes()[l];
      for (std::size_t i = 0; i < lane.portions().size(); ++i) {
        lane.BeginPortion(i);
        const nn::Var loss = Loss(lane.portions()[i]);
        lane.EndPortion(nn::Gradients(loss, parameters, listening ? &lane : nullptr));
      }
      EXPECT_TRUE(context.TakeStatus().ok());
    });
  }
};

// Gradients and statistics after two updates, in one row.
using Bits = std::vector<float>;

void Append(const nn::Tensor& t, Bits* out) {
  out->insert(out->end(), t.data<float>(), t.data<float>() + t.elements());
}

Bits MeansOf(std::int64_t portions, bool listening, int workers = 1) {
  const GradientSums::Shape shape{portions, nullptr, /*bucket=*/10};
  Problem p(shape, workers);
  GradientSums sums(p.context, shape, nn::Buffers(p.net));
  const std::vector<nn::Var> parameters = p.Parameters();
  Bits out;
  for (int update = 0; update < 2; ++update) {
    p.Run(&sums, parameters, listening);
    EXPECT_TRUE(sums.Finish(nullptr));
    for (const nn::Gradient& g : sums.means()) Append(g.Value().value(), &out);
  }
  for (const nn::NamedTensor& t : nn::Buffers(p.net)) Append(t.value, &out);
  EXPECT_TRUE(p.context.status().ok());
  return out;
}

TEST(GradientSums, HaveTheSameBitsWhoeverTellsOfThem) {
  for (const std::int64_t portions : {1, 2, 4, 16})
    EXPECT_EQ(MeansOf(portions, false), MeansOf(portions, true));
}

TEST(GradientSums, HaveTheSameBitsOnAnyNumberOfLanes) {
  for (const std::int64_t portions : {1, 2, 4, 16}) {
    const Bits want = MeansOf(portions, true);
    for (const int workers : {2, 3, 5, 16})
      EXPECT_EQ(MeansOf(portions, true, workers), want) << portions << " on " << workers;
  }
}

// Weights and statistics of every rank, and the moments that rank 0 gathers, after three updates.
Bits TrainedOn(std::int64_t portions, Transport* ranks, int workers = 1) {
  const GradientSums::Shape shape{portions, ranks, /*bucket=*/10};
  Problem p(shape, workers);
  nn::Adam adam(p.context, nn::Parameters(p.net), {.weight_decay = 0.01});
  GradientSums sums(p.context, shape, nn::Buffers(p.net));
  for (int update = 0; update < 3; ++update) {
    p.Run(&sums, adam.parameters(), /*listening=*/ranks != nullptr);
    EXPECT_TRUE(sums.Finish(nullptr));
    EXPECT_TRUE(adam.Step(sums.means(), sums.share()).ok());
  }
  Bits out;
  for (const nn::NamedTensor& t : nn::State(p.net)) Append(t.value, &out);
  if (sums.share()) sums.share()->GatherMoments();
  if (ranks && ranks->rank() > 0) return out;
  for (std::size_t i = 0; i < adam.parameters().size(); ++i) {
    for (const nn::Tensor& moment : adam.moments(i)) Append(moment, &out);
  }
  return out;
}

// What followers have is the beginning of what rank 0 has.
TEST(WeightShare, EndsInTheSameBits) {
  for (const std::int64_t portions : {2, 4, 8, 16}) {
    const Bits want = TrainedOn(portions, nullptr);
    for (const int size : {2, 3, 5, 8}) {
      if (size > portions) continue;
      OnRanks(size, [&](Transport& ranks) {
        const Bits got = TrainedOn(portions, &ranks, /*workers=*/1 + ranks.rank() % 3);
        EXPECT_EQ(got.size() == want.size(), ranks.rank() == 0);
        EXPECT_TRUE(std::equal(got.begin(), got.end(), want.begin()))
            << portions << " on rank " << ranks.rank() << " of " << size;
      });
    }
  }
}

// Against gradients of each portion, summed by the definition of the tree.
TEST(GradientSums, AreMeansOverPortions) {
  constexpr std::int64_t kPortions = 8;
  Problem p;
  std::vector<std::vector<double>> of_portion;
  for (std::int64_t portion = 0; portion < kPortions; ++portion) {
    std::vector<double> row;
    for (const nn::Gradient& g : nn::Gradients(p.Loss(portion), p.Parameters())) {
      const nn::Var value = g.Value();
      for (const float x : value.value().span<float>()) row.push_back(double{x});
    }
    of_portion.push_back(row);
  }
  const Bits got = MeansOf(kPortions, true);
  for (std::size_t i = 0; i < of_portion[0].size(); ++i) {
    double mean = 0, size = 0;
    for (const auto& row : of_portion) {
      mean += row[i] / kPortions;
      size += std::abs(row[i]);
    }
    // Three additions in float, each to half a unit of the last place of at most `size`.
    EXPECT_NEAR(got[i], mean, 3 * 0x1p-24 * size / kPortions + 1e-30) << i;
  }
}

TEST(GradientSums, GivingUpLeavesTheStatisticsAsTheyWere) {
  Problem p;
  Bits before, after;
  for (const nn::NamedTensor& t : nn::Buffers(p.net)) Append(t.value, &before);
  GradientSums sums(p.context, {2, nullptr}, nn::Buffers(p.net));
  sums.BeginUpdate();
  sums.lanes()[0]->BeginPortion(0);
  (void)p.Loss(0);
  sums.GiveUp();
  for (const nn::NamedTensor& t : nn::Buffers(p.net)) Append(t.value, &after);
  EXPECT_EQ(after, before);
}

TEST(Messages, BroadcastReachesAllAndTextsComeInOrder) {
  for (int size = 1; size <= 9; ++size) {
    OnRanks(size, [&](Transport& ranks) {
      std::vector<int> data(100, ranks.rank() == 0 ? 42 : 0);
      Broadcast(ranks, std::as_writable_bytes(std::span(data)));
      EXPECT_EQ(data, std::vector<int>(100, 42));
      const auto texts =
          GatherTexts(ranks, std::string(static_cast<std::size_t>(ranks.rank()), 'x'));
      ASSERT_EQ(texts.size(), ranks.rank() == 0 ? static_cast<std::size_t>(size) : 0u);
      for (std::size_t i = 0; i < texts.size(); ++i) EXPECT_EQ(texts[i].size(), i);
    });
  }
}

TEST(ProcessGroup, TheLeaderHearsOfAnErrorElsewhere) {
  OnRanks(3, [](Transport& ranks) {
    ProcessGroup group(ranks);
    if (ranks.rank() == 2) group.TellLeader({StatusCode::kInternal, "the loss is nan"});
    if (!group.leads()) return;
    Status heard;
    while ((heard = group.ReportedError()).ok()) std::this_thread::yield();
    EXPECT_EQ(heard.message(), "rank 2: the loss is nan");
  });
}

TEST(Share, RankZeroGetsWhatAllMade) {
  for (const std::size_t block : {1, 3}) {
    OnRanks(3, [&](Transport& ranks) {
      ProcessGroup group(ranks);
      const Share share(&group, block);
      constexpr std::size_t kItems = 11, kWidth = 2;
      std::vector<int> results(kItems * kWidth, -1);
      for (std::size_t i = 0; i < kItems; ++i) {
        if (!share.Has(i)) continue;
        for (std::size_t k = 0; k < kWidth; ++k)
          results[i * kWidth + k] = static_cast<int>(10 * i + k);
      }
      EXPECT_EQ(std::count(results.begin(), results.end(), -1) == 0, false);
      EXPECT_TRUE(share.Gather(&results, kWidth).ok());
      group.Shutdown();
      if (!group.leads()) return;
      for (std::size_t i = 0; i < results.size(); ++i)
        EXPECT_EQ(results[i], static_cast<int>(10 * (i / kWidth) + i % kWidth));
    });
  }
}

TEST(Share, RankZeroHearsOfAnErrorInsteadOfResults) {
  OnRanks(2, [](Transport& ranks) {
    ProcessGroup group(ranks);
    if (!group.leads()) return group.TellLeader({StatusCode::kInternal, "a broken file"});
    std::vector<int> results(4);
    EXPECT_EQ(Share(&group).Gather(&results).message(), "rank 1: a broken file");
  });
}

TEST(ProcessGroup, RefusesByNameAndTheLeaderSpeaksForAll) {
  OnRanks(3, [](Transport& ranks) {
    ProcessGroup group(ranks);
    EXPECT_TRUE(group.Agree({}, {{"dataset", "a", "look"}}).ok());
    const Status other =
        group.Agree({}, {{"dataset", ranks.rank() == 2 ? "b" : "a", "look there"}});
    EXPECT_FALSE(other.ok());
    const Status failed = group.Agree(
        ranks.rank() == 1 ? Status(StatusCode::kNotFound, "no such file") : Status(), {});
    EXPECT_FALSE(failed.ok());
    group.Shutdown();
    if (!group.leads()) {
      EXPECT_EQ(other.code(), StatusCode::kCancelled);
      return;
    }
    EXPECT_EQ(other.message(),
              "rank 2 on here has another dataset (b) than rank 0 on here (a): all ranks must have "
              "the same, or their results would differ; look there");
    EXPECT_EQ(failed.message(), "rank 1 on here: no such file");
    EXPECT_EQ(failed.code(), StatusCode::kNotFound);
  });
}

// Machines of several NUMA nodes as the kernel would describe them.

class Placement : public TempFolderTest {
 protected:
  void AddNode(int node, const std::string& cores) {
    const Path folder = folder_ / ("node" + std::to_string(node));
    std::filesystem::create_directories(folder);
    ASSERT_TRUE(WriteTextAtomic(folder / "cpulist", cores).ok());
  }
};

TEST_F(Placement, ReadsWhatTheKernelSays) {
  EXPECT_TRUE(NumaNodes(folder_).empty());
  AddNode(0, "0-2,8-9\n");
  AddNode(1, "\n");  // memory without cores
  AddNode(2, "3\n");
  EXPECT_EQ(NumaNodes(folder_), (std::vector<Cores>{{0, 1, 2, 8, 9}, {3}}));
  for (const char* broken : {"x", "1-", "2-1", "0;1", "0-99999999", "-1"}) {
    AddNode(2, broken);
    EXPECT_EQ(NumaNodes(folder_).size(), 1u) << broken;
  }
}

TEST(PlaceOfRanks, EachHasANodeOrSharesOneOrHasSeveral) {
  const std::vector<Cores> nodes = {{0, 1, 2, 3}, {4, 5, 6, 7}, {8, 9, 10, 11}, {12, 13, 14, 15}};
  EXPECT_EQ(PlaceOf(nodes, 2, 4).cores, nodes[2]);
  EXPECT_EQ(PlaceOf(nodes, 2, 4).workers, 4);
  EXPECT_EQ(PlaceOf(nodes, 1, 2).cores, (Cores{8, 9, 10, 11, 12, 13, 14, 15}));
  EXPECT_EQ(PlaceOf(nodes, 1, 2).workers, 8);
  for (int rank = 0; rank < 8; ++rank) {
    EXPECT_EQ(PlaceOf(nodes, rank, 8).cores, nodes[static_cast<std::size_t>(rank / 2)]);
    EXPECT_EQ(PlaceOf(nodes, rank, 8).workers, 2);
  }
  EXPECT_EQ(PlaceOf(nodes, 63, 64).workers, 1);
}

TEST(PlaceOfRanks, NoNodeIsIdleAndRanksOnOneAreAtMostOneMoreThanOnAnother) {
  const std::vector<Cores> nodes = {{0, 1}, {2, 3}, {4, 5}};
  for (int ranks = 1; ranks < 20; ++ranks) {
    std::vector<int> on(6);
    for (int rank = 0; rank < ranks; ++rank) {
      for (const int core : PlaceOf(nodes, rank, ranks).cores) ++on[static_cast<std::size_t>(core)];
    }
    const auto [least, most] = std::minmax_element(on.begin(), on.end());
    EXPECT_GE(*least, 1) << ranks;
    EXPECT_LE(*most - *least, 1) << ranks;
  }
}

TEST(KeepToCores, ThreadsThatStartLaterStayThere) {
  std::thread([] {
    cpu_set_t may;
    ASSERT_EQ(sched_getaffinity(0, sizeof(may), &may), 0);
    int first = 0;
    while (!CPU_ISSET(first, &may)) ++first;
    KeepToCores(Cores{first});
    std::thread([] { EXPECT_EQ(AvailableCores(), 1); }).join();
  }).join();
}

}  // namespace tilegrad::train::sums_test
