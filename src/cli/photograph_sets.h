// SPDX-License-Identifier: Apache-2.0
// tilegrad dataset of photographs: CUB-200 and PASCAL3D+.
#pragma once

#include <string>
#include <vector>

#include "tilegrad/status.h"

namespace tilegrad::cli {

struct PhotographSetOptions {
  std::string source, input, out, masks;  // `out` empty: datasets/<source>
  std::vector<std::string> classes;       // of pascal3d; empty: car
  int workers = 0;
  bool allow_broken = false, force = false;
};

// Whether a source holds photographs.
bool IsPhotographSource(const std::string& source);

// Fills one folder, or one for each of several classes in it, of which those without a usable
// photograph are named and left out.
Status MakePhotographSets(const PhotographSetOptions& options);

}  // namespace tilegrad::cli
