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

// Workers of a rank that was not told how many: the cores that it may use or, where it may use all
// of the machine, its share of them.
int WorkersOfRank();

}  // namespace tilegrad::train
