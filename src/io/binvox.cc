// SPDX-License-Identifier: Apache-2.0
#include "io/binvox.h"

#include <cmath>
#include <sstream>

#include "base/error.h"
#include "base/read_budget.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

constexpr int kMaxVoxelRun = 255;  // voxels

std::size_t Cubed(int side) {
  const auto n = static_cast<std::size_t>(side);
  return n * n * n;
}

// Index in BinvoxGrid::voxels of voxel number `i` of a file.
std::size_t PlaceOfVoxel(std::size_t i, std::size_t side) {
  const std::size_t x = i / (side * side), z = i / side % side, y = i % side;
  return (x * side + y) * side + z;
}

bool IsFiniteCube(const BinvoxGrid& grid) {
  for (const double t : grid.translate) {
    if (!std::isfinite(t)) return false;
  }
  return std::isfinite(grid.scale) && grid.scale > 0;
}

// One line of the header; false if it is invalid.
bool ReadBinvoxLine(std::string_view line, BinvoxGrid* grid) {
  std::istringstream words{std::string(line)};
  std::string key;
  words >> key;
  if (key == "dim") {
    int sides[3] = {};
    words >> sides[0] >> sides[1] >> sides[2];
    grid->side = sides[0];
    if (sides[0] != sides[1] || sides[0] != sides[2]) return false;
    return !words.fail() && grid->side >= 1 && grid->side <= kMaxBinvoxSide;
  }
  if (key == "translate") words >> grid->translate[0] >> grid->translate[1] >> grid->translate[2];
  if (key == "scale") words >> grid->scale;
  return !words.fail() && (key == "translate" || key == "scale") && IsFiniteCube(*grid);
}

Status ReadBinvoxRuns(std::string_view runs, const std::string& name, BinvoxGrid* grid) {
  const std::size_t wanted = Cubed(grid->side);
  if (runs.size() % 2 != 0 || runs.size() / 2 * kMaxVoxelRun < wanted)
    return DataLoss("{}: the file ends before its {} voxels do", name, wanted);
  TILEGRAD_TRY(ReadBudget::Take(wanted, name));
  grid->voxels.resize(wanted);
  std::size_t at = 0;
  for (std::size_t r = 0; r < runs.size(); r += 2) {
    const auto value = static_cast<std::uint8_t>(runs[r]);
    const std::size_t count = static_cast<std::uint8_t>(runs[r + 1]);
    if (value > 1) return DataLoss("{}: a voxel is {}; 0 and 1 are possible", name, value);
    if (count > wanted - at) return DataLoss("{}: more voxels than dim^3 = {}", name, wanted);
    for (const std::size_t end = at + count; at < end; ++at)
      grid->voxels[PlaceOfVoxel(at, static_cast<std::size_t>(grid->side))] = value;
  }
  if (at == wanted) return {};
  return DataLoss("{}: {} voxels, but dim^3 = {}", name, at, wanted);
}

}  // namespace

Result<BinvoxGrid> DecodeBinvox(std::span<const std::uint8_t> bytes, const std::string& name) {
  Lines lines(TextOf(bytes), name);
  std::string_view line;
  if (!lines.Next(line) || !line.starts_with("#binvox"))
    return DataLoss("{}: not a binvox file: it does not begin with #binvox", name);
  BinvoxGrid grid;
  while (lines.Next(line) && line != "data") {
    if (!ReadBinvoxLine(line, &grid)) {
      return lines.Error(
          "expected \"dim N N N\" with N up to {}, \"translate X Y Z\", \"scale S\" or \"data\"",
          kMaxBinvoxSide);
    }
  }
  if (line != "data" || grid.side == 0)
    return DataLoss("{}: the header has no \"dim\" or no \"data\"", name);
  TILEGRAD_TRY(ReadBinvoxRuns(lines.Rest(), name, &grid));
  return grid;
}

Result<BinvoxGrid> LoadBinvox(const Path& path) {
  constexpr std::size_t kMostBytes = std::size_t{300} << 20;  // kMaxBinvoxSide^3 runs of one voxel
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path, kMostBytes));
  return DecodeBinvox(bytes, path.string());
}

Bytes EncodeBinvox(const BinvoxGrid& grid) {
  const std::string header =
      fmt::format("#binvox 1\ndim {0} {0} {0}\ntranslate {1} {2} {3}\nscale {4}\ndata\n", grid.side,
                  grid.translate[0], grid.translate[1], grid.translate[2], grid.scale);
  Bytes out(header.begin(), header.end());
  const auto side = static_cast<std::size_t>(grid.side);
  const auto at = [&](std::size_t i) { return grid.voxels[PlaceOfVoxel(i, side)]; };
  for (std::size_t i = 0, end = Cubed(grid.side); i < end;) {
    std::uint8_t count = 0;
    const std::uint8_t value = at(i);
    for (; i < end && count < kMaxVoxelRun && at(i) == value; ++i) ++count;
    out.insert(out.end(), {value, count});
  }
  return out;
}

}  // namespace tilegrad::io
