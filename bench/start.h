// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace tilegrad::bench {

// What every benchmark's main begins with: takes Google Benchmark's options from the command line
// and forces the instruction set that TILEGRAD_TARGET names, if it is set. The one that runs is in
// the output's context. False, after a message on stderr, if either is wrong.
bool Start(int* argc, char** argv);

}  // namespace tilegrad::bench
