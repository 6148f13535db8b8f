// SPDX-License-Identifier: Apache-2.0
// One small file of each format that Assimp reads for us, for tests.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

struct MeshSample {
  std::string name;  // a file name; its ending is the format's
  Bytes bytes;
};

// All hold the tetrahedron of (0,0,0), (1,0,0), (0,2,0), (0,0,3), perhaps with axes exchanged, and,
// where the format has materials, the colour (0.8, 0.2, 0.4). Some are made by Assimp's exporters,
// some by hand. Writes into the folder `scratch`.
std::vector<MeshSample> MakeMeshSamples(const Path& scratch);

// The MD2 among them, with a skin of 4 x 2 pixels by that name unless it is empty. Corner i lies at
// pixel (i, i / 2), from the upper left. Nothing follows its one frame, as in files of our time.
Bytes Md2Sample(const std::string& skin);

}  // namespace tilegrad::io
