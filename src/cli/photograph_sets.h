// SPDX-License-Identifier: Apache-2.0
// `tilegrad dataset` for photographs: CUB-200 and PASCAL3D+.
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

// Fills one folder, or a folder in it for each of several classes; names and omits classes without
// a usable photograph.
Status MakePhotographSets(const PhotographSetOptions& options);

}  // namespace tilegrad::cli
