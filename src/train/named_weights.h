// SPDX-License-Identifier: Apache-2.0
// Installed weights: networks in a folder that the program and the Python module find by
// themselves, so that both predict without a training. A file NAME.safetensors for each, as
// `tilegrad export` writes it (run/checkpoint.h: WriteWeights).
//
//   share/tilegrad/weights    in the folder of the program or module, or in one above it
//   $TILEGRAD_WEIGHTS         another folder, in its place
#pragma once

#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

// What is used where no run is named.
inline constexpr const char* kCutoutWeights = "furniture";         // a cut-out to a mesh
inline constexpr const char* kGeneratorWeights = "car-generator";  // noise to meshes

inline constexpr const char* kWeightsVariable = "TILEGRAD_WEIGHTS";

// Sorted; none where the folder is not there.
std::vector<std::string> NamedWeights();
// The file of that name. NotFound lists the names that there are, or says where none were found.
Result<Path> WeightsNamed(const std::string& name);

// A run's folder, a checkpoint or a file of weights by its path; if nothing has that path, the
// weights of that name, as of WeightsNamed.
Result<Path> FindRun(const Path& path_or_name);

}  // namespace tilegrad::train
