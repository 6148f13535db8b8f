// SPDX-License-Identifier: Apache-2.0
// Cameras of pictures that came without, by COLMAP where it is installed: a program of its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/progress.h"

namespace tilegrad::train {

// Of a folder where it was run.
inline constexpr const char* kColmapPictures = "colmap/pictures.txt";

// Whether COLMAP is worth a try: it is on the PATH, the folder holds at least three pictures and
// no cameras, and nobody has tried before (<folder>/colmap).
bool MayRunColmap(const Path& folder);

struct ColmapOutcome {
  std::vector<std::string> placed, missing;  // names of pictures
  std::optional<double> error;               // of the points that it placed them by, pixels
  bool useful() const { return placed.size() >= 2 * missing.size() && !placed.empty(); }
};

// Extracts features, matches all pairs and maps, with one lens for all pictures, on the CPU. Leaves
// <folder>/colmap: sparse/0, where a fit finds the cameras, the database, the list of pictures and
// log.txt. Where less than two thirds were placed, sparse is renamed to sparse_partial, so that no
// fit takes it. `tell` gets each command before it runs. Errors: a step that fails, with its log;
// kCancelled.
Result<ColmapOutcome> RunColmap(const Path& folder, const WarningSink& tell, const Watch& watch);

}  // namespace tilegrad::train
