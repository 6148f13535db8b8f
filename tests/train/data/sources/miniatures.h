// SPDX-License-Identifier: Apache-2.0
// Published sets of renders in miniature: names, folders, types and cameras as the real ones have
// them, by the formulas of the programs that made or read them; shapes and pictures are ours.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "scene/mesh.h"

namespace tilegrad::train::miniatures {

struct MiniatureModel {
  std::string synset, id;
  Mesh mesh;  // centred, its largest half-extent that of the set
};

inline constexpr const char* kMiniatureSynsets[] = {"02958343", "03001627"};  // car, chair
inline constexpr int kMiniatureModels = 5;                                    // of each

std::vector<MiniatureModel> MiniatureModels(float half_extent);

// Fill `folder`. Errors of writing end the test.
void WriteChoy(const Path& folder, const std::vector<MiniatureModel>& models);  // 0.45
void WriteDvr(const Path& folder, const std::vector<MiniatureModel>& models);   // 0.5
void WriteDibr(const Path& folder, const std::vector<MiniatureModel>& models);  // 0.45
void WriteNmr(const Path& folder, const std::vector<MiniatureModel>& models);   // 0.5

}  // namespace tilegrad::train::miniatures
