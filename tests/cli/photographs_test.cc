// SPDX-License-Identifier: Apache-2.0
// The commands of docs/photographs.md for owners of CUB-200 and PASCAL3D+, on miniatures of
// their layout.
#include <gtest/gtest.h>

#include "io/image_file.h"
#include "support/run_program.h"
#include "train/data/photographs/miniature.h"

namespace tilegrad::photographs_test {

class Photographs : public ProgramTest {};

constexpr const char* kSmall =
    " --set schedule.steps=3 --set schedule.batch=2 --set network.base=4 --set network.most=8"
    " --set network.levels=2 --set network.latent=8 --set network.template_level=1"
    " --set photographs.size=16";

TEST_F(Photographs, FromAnnotationsToATableInFourCommands) {
  ImageU8 cutout(32, 32, 4);
  for (int y = 8; y < 24; ++y)
    for (int x = 4; x < 28; ++x) std::fill_n(cutout.at(x, y), 4, std::uint8_t{255});
  ASSERT_TRUE(io::SavePng(folder_ / "cutout.png", cutout).ok());
  for (const auto& [source, config] : {std::pair("cub", "birds"), {"pascal3d", "cars_photos"}}) {
    train::WriteMiniature(folder_ / source, source);
    const std::string run = In(std::string(source) + "_run");
    const std::string set = In(std::string(source) + "_set");
    const std::string collect =
        std::string("dataset --source ") + source + " --input " + In(source) + " --out " + set;
    ExpectIn(ExpectDone(collect), "10 training, 0 validation and 3 test photographs");
    ExpectError(collect + " --views 3", "--views: --source " + std::string(source));
    ExpectDone(std::string("train --config ") + config + " --data " + set + " --out " + run +
               kSmall);
    const std::string table = ExpectDone("eval --run " + run);
    ExpectIn(table, "PCK@0.1");
    ExpectIn(ExpectDone("report --run " + run), "3 photographs");
    ExpectDone("predict --refine 20 --run " + run + " --out " + In("out_" + std::string(source)) +
               " " + In("cutout.png"));
    EXPECT_TRUE(
        std::filesystem::exists(folder_ / ("out_" + std::string(source)) / "cutout_predicted.glb"));
    EXPECT_TRUE(std::filesystem::exists(Path(run) / "report.html"));
  }
}

TEST_F(Photographs, AreNoDatasetOfModels) {
  MakeData(In("d"));
  ExpectRefused("train --config birds --data " + In("d") + " --out " + In("r") + kSmall, 2,
                "d: holds a dataset of models");
}

}  // namespace tilegrad::photographs_test
