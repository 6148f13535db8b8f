// SPDX-License-Identifier: Apache-2.0
// tilegrad dataset: which axis of the models is up, and which sources go together.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "io/binvox.h"
#include "io/npz.h"
#include "support/run_program.h"

namespace tilegrad::dataset_test {

// A wedge without symmetry, with integer coordinates, so that turning it rounds nothing.
enum class Axes { kYUp, kZUp };
constexpr int kWedge[6][3] = {{0, 0, 0}, {3, 0, 0}, {0, 5, 0}, {0, 0, 2}, {3, 0, 2}, {0, 5, 2}};
constexpr const char* kFaces =
    "f 1 3 2\nf 4 5 6\nf 1 2 5\nf 1 5 4\nf 2 3 6\nf 2 6 5\nf 3 1 4\nf 3 4 6\n";

class DatasetTest : public ProgramTest {
 protected:
  // A folder CLASS/MODEL of the wedge, and the dataset's pictures of it.
  std::vector<std::uint8_t> PicturesOf(const std::string& name, Axes axes = Axes::kYUp,
                                       const std::string& options = "") {
    std::string obj;
    for (const auto& [x, y, z] : kWedge) {
      obj += axes == Axes::kYUp ? fmt::format("v {} {} {}\n", x, y, z)
                                : fmt::format("v {} {} {}\n", x, -z, y);
    }
    Write(name + "/wedge/a.obj", obj + kFaces);
    Write(name + "/wedge/b.obj", obj + kFaces);  // one to train on, one to test with
    ExpectDone(Dataset(name) + options);
    return Ok(io::LoadNpzArray(folder_ / (name + "_data/models/wedge/a.npz"), "images"))
        ->As<std::uint8_t>()
        .value();
  }
  std::string Dataset(const std::string& name) const {
    return "dataset --source folder --input " + In(name) + " --size 16 --views 3 --out " +
           In(name + "_data");
  }
};

TEST_F(DatasetTest, TheAxisThatIsUpTurnsTheModel) {
  const auto upright = PicturesOf("y");
  ASSERT_EQ(upright.size(), 3u * 4 * 16 * 16);
  EXPECT_TRUE(PicturesOf("z", Axes::kZUp, " --up z") == upright);
  EXPECT_FALSE(PicturesOf("lying", Axes::kZUp) == upright);
  ExpectRefused(Dataset("y") + " --up z", 2);  // that is another dataset
  ExpectRefused("dataset --source folder --up w --input " + folder_.string(), 2, "--up");
}

TEST_F(DatasetTest, VoxelsOfAModelAsBinvox) {
  PicturesOf("y");
  const std::string view = "dataset-view --data " + In("y_data") + " --model wedge/a --out " +
                           In("a.png") + " --voxels " + In("a.binvox");
  ExpectDone(view);
  const auto grid = Ok(io::LoadBinvox(folder_ / "a.binvox"));
  EXPECT_EQ(grid->voxels, Ok(io::LoadNpzArray(folder_ / "y_data/models/wedge/a.npz", "occupancy"))
                              ->As<std::uint8_t>()
                              .value());
  EXPECT_EQ(grid->scale, 0.9);
  EXPECT_EQ(grid->translate, (std::array{-0.45, -0.45, -0.45}));
  ExpectRefused(view, 2, "a.png");
}

TEST_F(DatasetTest, PublishedSetsHaveViewsAndSplitsOfTheirOwn) {
  const std::string set = " --input " + folder_.string() + " --out " + In("out");
  ExpectError("dataset --source choy --views 3" + set, "24 views", "--views");
  ExpectError("dataset --source nmr --size 32" + set, "64 pixels", "--size");
  ExpectError("dataset --source dvr --test-share 0.1" + set, "--source dvr has a fixed split");
  ExpectError("dataset --source dibr --up z" + set, "--up");
  ExpectError("dataset --source folder --allow-broken" + set, "--allow-broken");
  ExpectError("dataset --source nmr --split-list a" + set, "--split-list");
  ExpectError("dataset --source choy" + set, "ShapeNetRendering");
  ExpectError("dataset --source choy --split-list " + In("none.txt") + set, "none.txt");
}

TEST_F(DatasetTest, SourcesThatDoNotGoTogether) {
  const std::string folder = folder_.string(), out = " --out " + folder + "/out";
  ExpectError("dataset --source planes,folder --input " + folder + out, "reads several folders");
  ExpectError("dataset --source cars,folder" + out,
              "different ones of sweethome3d, planes, ships and cars");
  ExpectError("dataset --source cars,cars" + out, "several must be different");
  ExpectError("dataset --source thirteen,cars" + out, "different ones of sweethome3d");
  ExpectError("dataset --source thirteen --input " + folder + out, "--input");
  ExpectError("dataset --source boats" + out, "boats");
}

TEST_F(DatasetTest, MissingPackagesAndOptionsWithoutEffect) {
  const std::string folder = folder_.string(), out = " --out " + folder + "/out";
  ExpectError("dataset --source planes --input " + folder + out, "recommends flightgear-data-ai");
  ExpectError("dataset --source ships --input " + folder + out,
              "recommends flightgear-data-models");
  ExpectError("dataset --source cars --input " + folder + out, "recommends torcs-data");
  ExpectError("dataset --source folder --liveries 2 --input " + folder + out, "--liveries");
  ExpectError("dataset --source planes --up z" + out, "--up");
}

TEST_F(DatasetTest, ClassesByTheNamesOfTheirFolders) {
  for (const char* name : {"椅子", "a b", "other"}) {
    for (const char* model : {"/a.obj", "/b.obj"})
      Write(std::string("set/") + name + model,
            std::string("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  }
  const std::string chosen = Dataset("set") + " --classes '椅子,a b'";
  ExpectIn(ExpectDone(chosen), "4 models", "椅子", "(0 model files reused)");
  Write("set/a b/b.obj", "v 0 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n");
  ExpectIn(ExpectDone(chosen), "(3 model files reused)", "1 model file made again");
  EXPECT_TRUE(Exists("set_data/models/a_b/b.npz"));
}

TEST_F(DatasetTest, WhatAFolderHoldsBesidesIsNamed) {
  Write("set/notes.txt", "none");
  Write("set/wedge/a.max", "none");
  PicturesOf("set");
  ExpectIn(ExpectDone(Dataset("set")), "2 files or folders ignored", "notes.txt: is not a model",
           "a.max: is not a supported format");
}

}  // namespace tilegrad::dataset_test
