// SPDX-License-Identifier: Apache-2.0
// The machine's cores, by the kernel's numbers.
#pragma once

#include <span>

namespace tilegrad {

inline constexpr int kMostCores = 1024;  // numbers are below

// How many the machine has switched on, whether or not this process may use them.
int MachineCores();

// Keeps the calling thread, and those it starts, to these cores. Where the system refuses, it stays
// where it may run: only speed is at stake. Numbers out of range are left out.
void KeepToCores(std::span<const int> cores);

}  // namespace tilegrad
