// SPDX-License-Identifier: Apache-2.0
// What `prove` has counted so far, as a file that a later run goes on from.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"

namespace tilegrad::test {

// Of scenes of one kind, or a sum of such.
struct ProofRow {
  std::uint64_t scenes = 0, numbers = 0;  // numbers: that were compared
  std::uint64_t violations = 0;           // scenes with one
  double ratio = 0;                       // largest error / what is allowed
  double share = 0;                       // largest error beyond rounding / E

  void Add(const ProofRow& other);
};

// What a scene is counted under: the check, and for alpha the decades of delta and of faces.
using ProofKey = std::pair<std::string, std::string>;

struct ProofTally {
  std::uint64_t next = 0;  // the scene to go on with
  std::map<ProofKey, ProofRow> rows;
  std::vector<std::string> violations;  // a line each; the first thousand

  void Add(const ProofTally& other);
  ProofRow Sum() const;
};

// A table for people.
std::string ProofTable(const ProofTally& tally);

// An empty tally if there is no file.
Result<ProofTally> ReadTally(const Path& file);
Status WriteTally(const Path& file, const ProofTally& tally);  // whole or not at all

}  // namespace tilegrad::test
