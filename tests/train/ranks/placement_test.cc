// SPDX-License-Identifier: Apache-2.0
// Machines of several NUMA nodes as the kernel would describe them.
#include <gtest/gtest.h>
#include <sched.h>

#include <thread>

#include "base/parallel.h"
#include "support/temp_folder.h"
#include "train/ranks/launch.h"

namespace tilegrad::train::placement_test {

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

}  // namespace tilegrad::train::placement_test
