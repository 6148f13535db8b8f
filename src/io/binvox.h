// SPDX-License-Identifier: Apache-2.0
// Voxel grids of the program binvox (P. Min, https://www.patrickmin.com/binvox).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

inline constexpr int kMaxBinvoxSide = 512;

// Voxel (i, j, k) has its centre at translate + scale * (i + 0.5, j + 0.5, k + 0.5) / side.
struct BinvoxGrid {
  int side = 0;                       // voxels, in [1, kMaxBinvoxSide]
  std::array<double, 3> translate{};  // the cube's lowest corner, in the model's coordinates
  double scale = 1;                   // the cube's side, in the model's coordinates, > 0
  std::vector<std::uint8_t> voxels;   // [x][y][z] of 0 or 1
};

// The file stores y fastest, then z, then x, run-length encoded as value and count. Refuses grids
// that are no cube or too large, voxel counts that differ from the header, and values other than 0
// and 1; allocates only for as many voxels as the runs can hold. Messages call the file `name`.
Result<BinvoxGrid> DecodeBinvox(std::span<const std::uint8_t> bytes, const std::string& name);
Result<BinvoxGrid> LoadBinvox(const Path& path);
Bytes EncodeBinvox(const BinvoxGrid& grid);

}  // namespace tilegrad::io
