// SPDX-License-Identifier: Apache-2.0
// What there is to do at least, counted on the scene itself, and the time that a core's own limits
// give it. docs/benchmarks.md says where the machine's rates come from.
#pragma once

#include <cstddef>

#include "raster/culled.h"

namespace tilegrad::bench {

// Of one image or of a batch. A block is 4x2 pixels, what a vector of eight floats covers.
struct WorkCount {
  double pixels = 0, faces = 0;
  double covered = 0;      // pixels that show a face
  double seen = 0;         // faces that a pixel shows
  double hard_blocks = 0;  // (face, block) whose boxes share a pixel centre
  double soft_blocks = 0;  // (face, block) with a pair
  double pairs = 0;        // (face, background pixel) with A >= 2^-25; each takes an exponential

  WorkCount& operator+=(const WorkCount& other);
};

// `frame` as CulledForward fills it, with alpha or without.
WorkCount CountWork(const CulledScene& scene, const CulledFrame& frame);

// Rates of one core. The defaults are those measured on the machine of docs/benchmarks.md.
struct MachineRates {
  double lane_ops = 59e9;              // multiplications, sums, comparisons and so on of one float
  double loads = 7.4e9;                // scalar or of a vector: two a cycle
  double horizontal_sums = 1.5e9;      // three dependent steps
  double read = 28e9, write = 24.5e9;  // bytes, main memory
};

// low: every lane is used, arithmetic and memory overlap perfectly. high: whole blocks in the soft
// part, and nothing overlaps. Milliseconds.
struct Limit {
  double low = 0, high = 0;
  double bytes = 0;  // that have to be written (forward) or read (backward)
};
Limit ForwardLimit(const WorkCount& work, const CulledParts& parts, const MachineRates& rates = {});
Limit BackwardLimit(const WorkCount& work, const CulledParts& parts,
                    const MachineRates& rates = {});

}  // namespace tilegrad::bench
