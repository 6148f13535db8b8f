// SPDX-License-Identifier: Apache-2.0
// tilegrad tradeoff, from its command line to its files.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "support/run_program.h"
#include "support/source_dir.h"

namespace tilegrad::tradeoff_test {

class TradeoffCommand : public ProgramTest {
 protected:
  void SetUp() override {
    Write("tent.obj", "v -1 0 0\nv 1 0 0\nv 0 1 1\nv 0 -1 1\nf 1 2 3\nf 2 1 4\n");
  }
  std::string Tradeoff(const std::string& arguments) const {
    return "tradeoff --out " + In("out") + " " + arguments;
  }
  std::string Out(const std::string& name) { return Ok(ReadText(folder_ / "out" / name)).value(); }
};

std::vector<std::vector<std::string>> Cells(const std::string& csv) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    auto& row = rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
  }
  return rows;
}

TEST_F(TradeoffCommand, MeasuresAMeshFileAndWritesTableCsvAndPicture) {
  ExpectDone(
      Tradeoff(In("tent.obj") + " --size 24 --errors 0,1e-2 --deltas 1e-3,1e-2 --repetitions 1"));
  const auto rows = Cells(Out("tradeoff.csv"));
  ASSERT_EQ(rows.size(), 7u);
  EXPECT_EQ(rows[3][4], "the paper's rule");
  for (const auto& row : rows) EXPECT_EQ(row.size(), rows[0].size());
  EXPECT_EQ(rows[0][0], "scene");
  EXPECT_EQ(rows[0][4], "max_alpha_error");
  EXPECT_EQ(rows[1][0], "tent");
  EXPECT_EQ(rows[1][1], "2");
  EXPECT_EQ(rows[1][4], "0");
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (i % 3 == 0) continue;  // the paper's rule has no bound
    const double bound = std::stod(rows[i][4]), largest = std::stod(rows[i][8]);
    EXPECT_LE(largest, bound + 1e-5) << i;  // and rounding: docs/numerics.md
  }
  ExpectIn(Out("tradeoff.md"), "tent, 2 faces");
  const std::string picture = Out("tradeoff.svg");
  EXPECT_EQ(picture.rfind("<svg", 0), 0u);
  EXPECT_GT(std::count(picture.begin(), picture.end(), '\n'), 10);
}

// The end of the line: a training for each error, scored on models that it did not see. They pass
// over a broken checkpoint aloud, as `tilegrad train` does, and go on from the one before.
TEST_F(TradeoffCommand, TrainsWithEachErrorAndScores) {
  auto config = Ok(ReadText(TILEGRAD_SOURCE_DIR "/configs/quick.toml"));
  const std::string every = "checkpoint_every = ";
  ASSERT_NE(config->find(every), std::string::npos);
  Write("often.toml", config->replace(config->find(every), every.size() + 3, every + "1"));
  const std::string data = In("data");
  ExpectDone("dataset --source procedural --per-class 2 --views 3 --size 32 --out " + data);
  const std::string study =
      Tradeoff(In("tent.obj") + " --size 8 --errors 1e-2 --deltas 1e-2 --repetitions 1 --force");
  const std::string trainings =
      " --training " + data + " --training-errors 1e-3,1e-2 --steps 2 --config " + In("often.toml");
  ExpectDone(study + trainings);
  const auto rows = Cells(Out("training.csv"));
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0][3], "mean_iou");
  EXPECT_EQ(rows[1][0], "0.001");
  EXPECT_EQ(rows[2][0], "0.01");
  for (std::size_t i = 1; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].size(), rows[0].size());
    EXPECT_EQ(rows[i][1], "2");
    EXPECT_GT(std::stod(rows[i][3]), 0);
  }
  ExpectIn(Out("tradeoff.md"), "### Training");
  std::filesystem::resize_file(folder_ / "out/training_0.01/checkpoints/step_00000002.safetensors",
                               1000);
  ExpectIn(ExpectDone(study + trainings), "step_00000002.safetensors");
  const auto after = Cells(Out("training.csv"));  // but for the seconds, the same
  for (const std::size_t column : {0u, 1u, 3u, 4u}) EXPECT_EQ(rows[2][column], after[2][column]);
  // Without trainings, the table of these is told from what is new.
  ExpectIn(ExpectDone(study), "training.csv is from an earlier call");
}

TEST_F(TradeoffCommand, RefusesWhatItCannotMeasure) {
  const auto refused = [&](const std::string& arguments, const std::string& part) {
    ExpectError(Tradeoff(arguments), part);
    EXPECT_FALSE(Exists("out")) << arguments;
  };
  refused("nowhere.obj", "nowhere.obj");
  refused("--errors 2", "--errors");
  refused("--errors x", "--errors");
  refused("--deltas 0", "--deltas");
  refused("--repetitions 0", "--repetitions");
  refused("--steps 5", "--training");
  refused("--training-errors 0.1", "--training");
  refused("--config quick.toml", "--training");
  refused("--size 16", "mesh");
  // At once: of this command the measurements alone take hours.
  const std::string hours = "--repetitions 1000 --training ";
  refused(hours + In("nowhere"), "nowhere");
  Write("flat.obj", "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n");
  refused(In("flat.obj"), "flat.obj");
}

}  // namespace tilegrad::tradeoff_test
