// SPDX-License-Identifier: Apache-2.0
// tilegrad dataset: which axis of the models is up, and which sources go together.
#include <gtest/gtest.h>

#include <array>

#include "io/npz.h"
#include "support/run_program.h"

namespace tilegrad::dataset_test {

// A wedge without symmetry, with integer coordinates, so that turning it rounds nothing.
constexpr int kWedge[6][3] = {{0, 0, 0}, {3, 0, 0}, {0, 5, 0}, {0, 0, 2}, {3, 0, 2}, {0, 5, 2}};
constexpr const char* kFaces =
    "f 1 3 2\nf 4 5 6\nf 1 2 5\nf 1 5 4\nf 2 3 6\nf 2 6 5\nf 3 1 4\nf 3 4 6\n";

class DatasetTest : public ProgramTest {
 protected:
  // A folder CLASS/MODEL of the wedge, its axes where `place` puts them; and the dataset's
  // pictures of it.
  template <class Place>
  std::vector<std::uint8_t> PicturesOf(const std::string& name, const Place& place,
                                       const std::string& options) {
    std::filesystem::create_directories(folder_ / name / "wedge");
    std::string obj;
    for (const auto& [x, y, z] : kWedge) {
      const auto [a, b, c] = place(x, y, z);
      obj += "v " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(c) + "\n";
    }
    Write(name + "/wedge/a.obj", obj + kFaces);
    Write(name + "/wedge/b.obj", obj + kFaces);  // one to train on, one to test with
    const std::string out = (folder_ / (name + "_data")).string();
    ExpectDone("dataset --source folder --input " + In(name) + " --size 16 --views 3 --out " + out +
               " " + options);
    const auto images = io::LoadNpzArray(Path(out) / "models" / "wedge" / "a.npz", "images");
    EXPECT_TRUE(images.ok()) << images.status().message();
    return images.ok() ? images->As<std::uint8_t>().value() : std::vector<std::uint8_t>();
  }
};

using Point = std::array<int, 3>;

TEST_F(DatasetTest, TheAxisThatIsUpTurnsTheModel) {
  const auto upright = PicturesOf(
      "y",
      [](int x, int y, int z) {
        return Point{x, y, z};
      },
      "");
  const auto turned = PicturesOf(
      "z",
      [](int x, int y, int z) {
        return Point{x, -z, y};
      },
      "--up z");
  const auto lying = PicturesOf(
      "lying",
      [](int x, int y, int z) {
        return Point{x, -z, y};
      },
      "");
  ASSERT_EQ(upright.size(), 3u * 4 * 16 * 16);
  EXPECT_TRUE(turned == upright);
  EXPECT_FALSE(lying == upright);
}

TEST_F(DatasetTest, AnotherAxisIsAnotherDataset) {
  const auto same = [](int x, int y, int z) { return Point{x, y, z}; };
  PicturesOf("m", same, "");
  const Outcome again =
      RunProgram("dataset --source folder --input " + (folder_ / "m").string() +
                 " --size 16 --views 3 --up z --out " + (folder_ / "m_data").string());
  EXPECT_EQ(again.exit_code, 2) << again.output;
  const Outcome wrong = RunProgram("dataset --source folder --up w --input " + folder_.string());
  EXPECT_EQ(wrong.exit_code, 2) << wrong.output;
  EXPECT_NE(wrong.output.find("--up"), std::string::npos) << wrong.output;
}

void ExpectError(const std::string& options, const std::string& says) {
  const Outcome made = RunProgram("dataset " + options);
  EXPECT_NE(made.exit_code, 0) << options;
  EXPECT_NE(made.output.find(says), std::string::npos) << made.output;
}

TEST_F(DatasetTest, SourcesThatDoNotGoTogether) {
  const std::string folder = folder_.string(), out = " --out " + folder + "/out";
  ExpectError("--source planes,folder --input " + folder + out, "reads several folders");
  ExpectError("--source cars,folder" + out,
              "different ones of sweethome3d, planes, ships and cars");
  ExpectError("--source cars,cars" + out, "several must be different");
  ExpectError("--source thirteen,cars" + out, "different ones of sweethome3d");
  ExpectError("--source thirteen --input " + folder + out, "--input");
  ExpectError("--source boats" + out, "boats");
}

TEST_F(DatasetTest, MissingPackagesAndOptionsWithoutEffect) {
  const std::string folder = folder_.string(), out = " --out " + folder + "/out";
  ExpectError("--source planes --input " + folder + out, "recommends flightgear-data-ai");
  ExpectError("--source ships --input " + folder + out, "recommends flightgear-data-models");
  ExpectError("--source cars --input " + folder + out, "recommends torcs-data");
  ExpectError("--source folder --liveries 2 --input " + folder + out, "--liveries");
  ExpectError("--source planes --up z" + out, "--up");
}

TEST_F(DatasetTest, WhatAFolderHoldsBesidesIsNamed) {
  Write("set/notes.txt", "none");
  Write("set/wedge/a.max", "none");
  PicturesOf(
      "set",
      [](int x, int y, int z) {
        return Point{x, y, z};
      },
      "");
  const Outcome again = RunProgram("dataset --source folder --input " + (folder_ / "set").string() +
                                   " --size 16 --views 3 --out " + (folder_ / "set_data").string());
  EXPECT_EQ(again.exit_code, 0) << again.output;
  for (const char* text : {"2 files or folders ignored", "notes.txt: is no model",
                           "a.max: is of no kind that is read"})
    EXPECT_NE(again.output.find(text), std::string::npos) << again.output;
}

}  // namespace tilegrad::dataset_test
