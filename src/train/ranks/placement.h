// SPDX-License-Identifier: Apache-2.0
// Where a rank works, on machines of several NUMA nodes: memory belongs to the node whose core
// first touches it, so a rank keeps to one node, or to as few as it needs.
#pragma once

#include <span>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

using Cores = std::vector<int>;  // by the kernel's numbers

// The cores of each node, as /sys/devices/system/node says; empty where it does not.
std::vector<Cores> NumaNodes(const Path& folder = "/sys/devices/system/node");

struct RankPlace {
  Cores cores;      // of whole nodes
  int workers = 0;  // that these cores have for each of the ranks on them, at least 1
};
// Of rank `local` of `ranks` on one machine: neighbours share a node where there are more ranks
// than nodes, and have several where there are fewer.
RankPlace PlaceOf(std::span<const Cores> nodes, int local, int ranks);

}  // namespace tilegrad::train
