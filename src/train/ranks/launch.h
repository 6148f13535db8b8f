// SPDX-License-Identifier: Apache-2.0
// Whether this process is one of several that mpirun or srun started, and how it joins them.
#pragma once

#include <memory>

#include "tilegrad/status.h"
#include "train/ranks/transport.h"

namespace tilegrad::train {

// As the environment says (Open MPI, MPICH and their kin, Slurm with PMIx); 1 without any.
int LaunchedRanks();

// Loads the plugin, libtilegrad_mpi.so, from beside the program or where it was installed, and
// joins the other ranks. Once in a process. NotFound says how to get the plugin.
Result<std::unique_ptr<Transport>> ConnectRanks();

// Workers of a rank that was asked for so many, 0: as many as it has cores. A rank that mpirun has
// bound has those cores. Others have their share of the machine; where that has several NUMA nodes,
// the rank is kept to its own, unless more workers were asked for than those have cores for. To be
// called before there are threads and data.
int PlaceRank(int asked);

}  // namespace tilegrad::train
