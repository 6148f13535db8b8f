// SPDX-License-Identifier: Apache-2.0
#include "io/binvox.h"

#include <gtest/gtest.h>

#include "support/temp_folder.h"

namespace tilegrad::io::binvox_test {

Bytes FileOf(std::string header, const std::string& runs) {
  header += "data\n" + runs;
  return {header.begin(), header.end()};
}

// A grid without symmetry: x, y and z are told apart.
BinvoxGrid Sample() {
  BinvoxGrid grid{4, {-0.25, -0.5, 0.125}, 0.75, std::vector<std::uint8_t>(64)};
  for (const std::size_t i : {0 * 16 + 0 * 4 + 1, 0 * 16 + 2 * 4 + 0, 3 * 16 + 0 * 4 + 0})
    grid.voxels[i] = 1;
  return grid;
}

// The format's own rule: index = x * side^2 + z * side + y.
TEST(Binvox, YIsFastestThenZ) {
  const std::string header = "#binvox 1\ndim 2 2 2\ntranslate -1 0 2.5\nscale 3\n";
  const auto grid = DecodeBinvox(FileOf(header, std::string("\0\1\1\1\0\4\1\1\0\1", 10)), "a");
  ASSERT_TRUE(grid.ok()) << grid.status().message();
  // Voxels 1 and 6 of the file: (x, y, z) = (0, 1, 0) and (1, 0, 1).
  EXPECT_EQ(grid->voxels, (std::vector<std::uint8_t>{0, 0, 1, 0, 0, 1, 0, 0}));
  EXPECT_EQ(grid->translate, (std::array<double, 3>{-1, 0, 2.5}));
  EXPECT_EQ(grid->scale, 3);
}

TEST(Binvox, ComesBackAsItWasWritten) {
  const BinvoxGrid grid = Sample();
  const auto again = DecodeBinvox(EncodeBinvox(grid), "a");
  ASSERT_TRUE(again.ok()) << again.status().message();
  EXPECT_EQ(again->voxels, grid.voxels);
  EXPECT_EQ(again->translate, grid.translate);
  EXPECT_EQ(again->scale, grid.scale);
  const BinvoxGrid full{32, {}, 1, std::vector<std::uint8_t>(32 * 32 * 32, 1)};  // runs of 255
  EXPECT_EQ(DecodeBinvox(EncodeBinvox(full), "a").value().voxels, full.voxels);
}

TEST(Binvox, RefusesWhatIsBroken) {
  const auto read = [](const Bytes& bytes) { return DecodeBinvox(bytes, "a.binvox").status(); };
  ExpectCutsRefused(EncodeBinvox(Sample()), "a.binvox: ", read);
  const std::string dim = "#binvox 1\ndim 2 2 2\n";
  const std::string eight("\0\10", 2);
  EXPECT_TRUE(read(FileOf(dim, eight)).ok());  // the lines of translate and scale may be missing
  ExpectMessage(read(FileOf(dim, eight + eight)), "more voxels");
  ExpectMessage(read(FileOf(dim, "\2\10")), "a voxel is 2");
  ExpectMessage(read(FileOf("#binvox 1\ndim 2 2 3\n", eight)), "line 2");
  ExpectMessage(read(FileOf("#binvox 1\ndim 2000 2000 2000\n", eight)), "up to 512");
  ExpectMessage(read(FileOf("#binvox 1\ndim 512 512 512\n", eight)), "ends before");
  ExpectMessage(read(FileOf(dim + "scale nan\n", eight)), "line 3");
  ExpectMessage(read(FileOf(dim + "scale 0\n", eight)), "line 3");
}

}  // namespace tilegrad::io::binvox_test
