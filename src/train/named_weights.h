// SPDX-License-Identifier: Apache-2.0
// Installed weights: networks that the program and the Python module find by themselves, so that
// both predict without training. One NAME.safetensors for each, as `tilegrad export` writes it
// (run/checkpoint.h: WriteWeights).
//
//   share/tilegrad/weights    in the folder of the program or module, or in a parent folder
//   $TILEGRAD_WEIGHTS         another folder instead
#pragma once

#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::train {

// The defaults where no run is named.
inline constexpr const char* kCutoutWeights = "furniture";         // cut-out to mesh
inline constexpr const char* kGeneratorWeights = "car-generator";  // noise to meshes

inline constexpr const char* kWeightsVariable = "TILEGRAD_WEIGHTS";

// Sorted; empty without a folder of weights.
std::vector<std::string> NamedWeights();
// The file of that name. NotFound lists the installed names or, if there are none, says where it
// searched.
Result<Path> WeightsNamed(const std::string& name);

// The run folder, checkpoint or file of weights at that path; if there is none, WeightsNamed.
Result<Path> FindRun(const Path& path_or_name);

}  // namespace tilegrad::train
