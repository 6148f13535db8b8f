// SPDX-License-Identifier: Apache-2.0
// Whether this process is one of several that mpirun or srun started, and how it joins them.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/file.h"
#include "tilegrad/status.h"
#include "train/ranks/transport.h"

namespace tilegrad::train {

// From the environment (Open MPI, MPICH and relatives, Slurm with PMIx); 1 without any.
int LaunchedRanks();

// Loads the plugin, libtilegrad_mpi.so, from beside the program or where it was installed, and
// joins the other ranks. Once in a process. NotFound says how to get the plugin.
Result<std::unique_ptr<Transport>> ConnectRanks();

// The number of workers of a rank; `asked` 0: as many as it has cores, which are those mpirun bound
// it to or its share of the machine. On several NUMA nodes it is kept to its own, unless more
// workers are asked for than those have cores for. To be called before there are threads and data.
int PlaceRank(int asked);

// Where a rank works, on machines of several NUMA nodes: memory belongs to the node whose core
// first touches it, so a rank keeps to one node, or to as few as it needs.

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
