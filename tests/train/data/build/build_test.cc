// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/build.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "base/file.h"
#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"
#include "train/data/broken_members.h"
#include "train/data/build/make_model.h"
#include "train/data/build/truth_mesh.h"

namespace tilegrad::train::build_test {

BuildOptions SmallOptions() {
  BuildOptions options;
  options.image_size = 16;
  options.views = 3;
  return options;
}

class BuildTest : public TempFolderTest {
 protected:
  Result<BuildSummary> Build(const ModelSource& source, const Path& folder, int workers = 1,
                             const ProgressSink& progress = {}) {
    return BuildDataset(source, options_, folder, Workers(workers), {progress, &stop_});
  }

  BuildOptions options_ = SmallOptions();
  StopFlag stop_ = false;
};

TEST_F(BuildTest, ProceduralSetEndToEnd) {
  const auto source = ProceduralSource(4, 1);
  const auto summary = Ok(Build(*source, folder_ / "set", 2));
  EXPECT_EQ(summary->models.size(), 20u);
  EXPECT_TRUE(summary->rejected.empty());

  const auto dataset = Ok(Dataset::Open(folder_ / "set"));
  EXPECT_EQ(dataset->info().classes,
            (std::vector<std::string>{"car", "chair", "lamp", "plane", "table"}));
  EXPECT_EQ(dataset->Select(Split::kTest).size(), 5u);
  EXPECT_EQ(dataset->Select(Split::kTrain).size(), 15u);
  for (std::size_t i = 0; i < dataset->models().size(); ++i) {
    const auto data = Ok(dataset->Load(static_cast<int>(i)));
    EXPECT_EQ(data->images.size(), 3u * 4 * 16 * 16);
    EXPECT_EQ(data->images, dataset->LoadImages(static_cast<int>(i)).value());
    EXPECT_GT(std::count(data->occupancy.begin(), data->occupancy.end(), 1), 32);
    ASSERT_EQ(data->points.size(), static_cast<std::size_t>(kTruthPoints));
    float reach = 0;
    for (const auto& p : data->mesh.positions) {
      for (int k = 0; k < 3; ++k) reach = std::max(reach, std::abs(p[k]));
    }
    EXPECT_NEAR(reach, 0.45f, 1e-6f);  // one rounding of the scale and one of the shift
    EXPECT_LE(data->mesh.faces.size(), static_cast<std::size_t>(kTruthFaces));
  }
  const auto sheet = Ok(io::LoadImage(folder_ / "set" / "contact_sheet.png"));
  EXPECT_GT(sheet->width, 6 * 3 * 16);
}

TEST_F(BuildTest, RgbIsPremultiplied) {
  const auto source = ProceduralSource(2, 5);
  ASSERT_TRUE(Build(*source, folder_ / "set").ok());
  const auto images = Dataset::Open(folder_ / "set")->LoadImages(0).value();
  constexpr std::size_t kPlane = 16 * 16;
  int partial = 0;
  for (std::size_t view = 0; view < 3; ++view) {
    for (std::size_t p = 0; p < kPlane; ++p) {
      const std::uint8_t* pixel = images.data() + view * 4 * kPlane + p;
      const int alpha = pixel[3 * kPlane];
      partial += alpha > 0 && alpha < 255;
      for (std::size_t c = 0; c < 3; ++c) EXPECT_LE(pixel[c * kPlane], alpha);
    }
  }
  EXPECT_GT(partial, 10);  // edges are anti-aliased
}

TEST_F(BuildTest, WorkersDoNotChangeAByte) {
  const auto source = ProceduralSource(2, 3);
  ASSERT_TRUE(Build(*source, folder_ / "one", 1).ok());
  ASSERT_TRUE(Build(*source, folder_ / "two", 2).ok());
  ASSERT_TRUE(Build(*source, folder_ / "seven", 7).ok());
  const auto one = Contents(folder_ / "one");
  EXPECT_EQ(one.size(), 10u + 4u);  // models; dataset.json, two lists, the sheet
  EXPECT_EQ(one, Contents(folder_ / "two"));
  EXPECT_EQ(one, Contents(folder_ / "seven"));
}

TEST_F(BuildTest, StoppedAndGoneOnIsTheSame) {
  const auto source = ProceduralSource(2, 3);
  ASSERT_TRUE(Build(*source, folder_ / "whole").ok());
  const auto stop_after_four = [&](const Progress& p) {
    if (p.stage == "rendering" && p.done == 4) stop_ = true;
  };
  const auto stopped = Build(*source, folder_ / "parts", 1, stop_after_four);
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.status().code(), StatusCode::kCancelled);
  ExpectMessage(Dataset::Open(folder_ / "parts").status(), "not complete");

  stop_ = false;
  const auto resumed = Ok(Build(*source, folder_ / "parts"));
  EXPECT_EQ(resumed->reused, 4);
  EXPECT_EQ(Contents(folder_ / "whole"), Contents(folder_ / "parts"));
  EXPECT_EQ(Build(*source, folder_ / "parts")->reused, 10);
}

TEST_F(BuildTest, HalfWrittenFilesOfAKilledCommandGo) {
  const auto source = ProceduralSource(1, 3);
  ASSERT_TRUE(Build(*source, folder_ / "set").ok());
  const auto whole = Contents(folder_ / "set");
  for (const char* name : {"models/lamp/lamp-00000.npz", "models.jsonl"}) {
    ASSERT_TRUE(WriteTextAtomic(folder_ / "set" / (std::string(name) + ".4194305.tmp"), "x").ok());
  }
  ASSERT_TRUE(Build(*source, folder_ / "set").ok());
  EXPECT_EQ(Contents(folder_ / "set"), whole);
}

TEST_F(BuildTest, OneProcessAtATime) {
  const auto source = ProceduralSource(1, 3);
  {
    const auto lock = Ok(FolderLock::Take(folder_ / "set"));
    ExpectMessage(Build(*source, folder_ / "set").status(), "another process");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "set" / "dataset.json"));
  }
  EXPECT_TRUE(Build(*source, folder_ / "set").ok());
}

TEST_F(BuildTest, StoppedWithOtherClassesTheIndexStillFits) {
  const auto source = ProceduralSource(2, 1);
  ASSERT_TRUE(Build(*source, folder_ / "set").ok());
  options_.limit = 2;
  stop_ = true;
  ASSERT_EQ(Build(*source, folder_ / "set").status().code(), StatusCode::kCancelled);
  const auto dataset = Ok(Dataset::Open(folder_ / "set"));
  EXPECT_EQ(dataset->models().size(), 10u);
}

TEST_F(BuildTest, BrokenModelFilesAreMadeAgain) {
  const auto source = ProceduralSource(1, 3);
  ASSERT_TRUE(Build(*source, folder_ / "set").ok());
  const auto whole = Contents(folder_ / "set");
  const Path file = folder_ / "set" / "models" / "lamp" / "lamp-00000.npz";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const auto again = Ok(Build(*source, folder_ / "set"));
  EXPECT_EQ(again->reused, 4);
  EXPECT_EQ(Contents(folder_ / "set"), whole);
}

// What cannot be opened may be whole: it is neither made again nor taken for missing.
TEST_F(BuildTest, FilesThatTheSystemDoesNotGiveStopIt) {
  const auto source = ProceduralSource(1, 3);
  for (const char* name : {"models/lamp/lamp-00000.npz", "dataset.json"}) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(Build(*source, folder_ / "set").ok());
    const Path file = folder_ / "set" / name;
    std::filesystem::remove(file);
    std::filesystem::create_symlink(file, file);  // also stops root, unlike permissions
    const Status status = Build(*source, folder_ / "set").status();
    EXPECT_EQ(status.code(), StatusCode::kIo) << status.message();
    ExpectMessage(status, file.string());
    EXPECT_TRUE(std::filesystem::is_symlink(file));
    std::filesystem::remove(file);
  }
}

TEST_F(BuildTest, OtherSettingsDoNotOverwrite) {
  const auto source = ProceduralSource(1, 3);
  ASSERT_TRUE(Build(*source, folder_ / "set").ok());
  const auto whole = Contents(folder_ / "set");
  options_.image_size = 32;
  const auto other = Build(*source, folder_ / "set");
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(Build(*ProceduralSource(1, 4), folder_ / "set").status().code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(Contents(folder_ / "set"), whole);
}

TEST_F(BuildTest, PerClassAndLimitChoose) {
  const auto source = ProceduralSource(6, 3);
  options_.per_class = 2;
  EXPECT_EQ(Build(*source, folder_ / "a")->models.size(), 10u);
  options_.limit = 7;
  EXPECT_EQ(Build(*source, folder_ / "b")->models.size(), 7u);
}

TEST_F(BuildTest, OptionsOutOfRangeAreErrors) {
  const auto source = ProceduralSource(1, 3);
  options_.views = 0;
  EXPECT_EQ(Build(*source, folder_ / "a").status().code(), StatusCode::kInvalidArgument);
  options_ = SmallOptions();
  options_.split.test_share = std::nan("");
  EXPECT_EQ(Build(*source, folder_ / "a").status().code(), StatusCode::kInvalidArgument);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a"));
}

// A sphere, the same in red, and three that cannot be used.
class MixedSource : public ModelSource {
 public:
  MixedSource() : ModelSource({.name = "mixed", .credits = {}}) {
    for (const char* id : {"broken", "empty", "flat-point", "red", "white"}) {
      entries_.push_back({"ball", id, id, "", "", std::string(id) + ".obj", {}});
    }
  }
  Result<SourceModel> Load(std::size_t entry) const override {
    const std::string& id = entries_[entry].id;
    if (id == "broken") return DataLoss("broken.obj: line 3: no number");
    if (id == "empty") return SourceModel{Mesh{}};
    Mesh mesh = Icosphere(1, 1.0f);
    if (id == "flat-point") {
      for (auto& p : mesh.positions) p = glm::vec3(1, 2, 3);
    }
    if (id == "red") SetColor(mesh, {1, 0, 0, 1});
    SourceModel model{mesh};
    if (id == "red") model.warnings = {"texture \"red.png\" not found"};
    return model;
  }
};

TEST_F(BuildTest, UnusableModelsAreListedWithReasonsAndWarningsReported) {
  const auto summary = Ok(Build(MixedSource(), folder_ / "set", 2));
  EXPECT_EQ(summary->models.size(), 2u);
  ASSERT_EQ(summary->rejected.size(), 3u);
  EXPECT_EQ(summary->rejected[0].reason, "broken.obj: line 3: no number");
  const std::string list = ReadText(folder_ / "set" / "rejected.jsonl").value();
  EXPECT_EQ(std::count(list.begin(), list.end(), '\n'), 3);
  ExpectIn(list, "\"broken\"", "\"empty.obj\"", "\"flat-point\"");
  ASSERT_EQ(summary->warnings.size(), 1u);
  EXPECT_EQ(summary->warnings[0].file, "red.obj");
  EXPECT_EQ(summary->warnings[0].text, "texture \"red.png\" not found");
  // Recoloured copies are on one side of the split.
  EXPECT_EQ(summary->models[0].geometry, summary->models[1].geometry);
  EXPECT_NE(summary->models[0].geometry, 0u);
  EXPECT_EQ(summary->models[0].split, summary->models[1].split);
}

TEST(BrokenMembers, OneInAHundredCostsItselfAlone) {
  BrokenMembers broken;
  EXPECT_TRUE(broken.Check(0, false).ok());
  EXPECT_EQ(broken.Summary(), "");
  broken.Add("chair/a", "no faces");
  EXPECT_TRUE(broken.Check(100, false).ok());
  ExpectMessage(broken.Check(99, false), "1 of 99", "--allow-broken", "chair/a: no faces");
  EXPECT_TRUE(broken.Check(1, true).ok());
}

TEST(BrokenMembers, EachReasonIsCountedWithItsFirst) {
  BrokenMembers broken;
  for (char name = 'a'; name <= 'k'; ++name) broken.Add(std::string(1, name), "x.png: cut");
  broken.Add("z", "no faces");
  EXPECT_EQ(broken.Summary(), "     11  cut (a, b, c, d, e, ...)\n      1  no faces (z)\n");
}

Mesh TwoMaterials() {  // a red box and one of glass
  Mesh mesh = Box({0, 0, 0}, {0.9f, 0.9f, 0.9f});
  mesh.materials = {{"red", {1, 0, 0, 1}, -1}, {"glass", {1, 1, 1, 0.1f}, -1}};
  mesh.face_materials.assign(mesh.faces.size(), 0);
  for (std::size_t f = 0; f < 4; ++f) mesh.face_materials[f] = 1;
  return mesh;
}

TEST(TruthMesh, SmallMeshesKeepTheirShapeAndGetColours) {
  Mesh mesh = TwoMaterials();
  const Mesh truth = MakeTruthMesh(mesh, 100);
  EXPECT_TRUE(Validate(truth).ok());
  EXPECT_EQ(truth.faces.size(), mesh.faces.size());
  EXPECT_TRUE(truth.materials.empty());
  const auto red = std::count(truth.colors.begin(), truth.colors.end(), glm::vec4(1, 0, 0, 1));
  const auto white = std::count(truth.colors.begin(), truth.colors.end(), glm::vec4(1, 1, 1, 1));
  EXPECT_GT(red, 0);
  EXPECT_GT(white, 0);
  EXPECT_EQ(red + white, static_cast<std::ptrdiff_t>(truth.colors.size()));  // colours do not mix
}

TEST(TruthMesh, LargeMeshesAreReducedWithinAFewPercent) {
  const Mesh ball = Icosphere(6, 0.45f);  // 81,920 faces
  const Mesh truth = MakeTruthMesh(ball, 5000);
  EXPECT_TRUE(Validate(truth).ok());
  EXPECT_LE(truth.faces.size(), 5000u);
  EXPECT_GT(truth.faces.size(), 1500u);
  for (const auto& p : truth.positions) {
    const float r = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    EXPECT_NEAR(r, 0.45f, 0.03f);  // the mean of a cell of at most 0.9 / 26 across
  }
  EXPECT_LE(MakeTruthMesh(ball, 10).faces.size(), 10u);
}

// A ball whose corners say where they were: they stay where they are shown.
TEST(ClusterFaces, LeavesCornersWithWhatTheyHad) {
  Mesh ball = Icosphere(5, 0.45f);  // 20,480 faces
  for (const Face& face : ball.faces) {
    for (const std::int32_t v : face) {
      const glm::vec3 p = ball.positions[static_cast<std::size_t>(v)];
      ball.corner_uvs.emplace_back(p.x, p.y);
    }
  }
  ball.textures = {{"white", ImageU8(1, 1, 3, 255)}};
  ball.materials = {{.name = "", .base_color_texture = 0}};
  ClusterFaces(20480, &ball);
  EXPECT_EQ(ball.faces.size(), 20480u);
  ClusterFaces(2000, &ball);
  EXPECT_TRUE(Validate(ball).ok());
  EXPECT_LE(ball.faces.size(), 2000u);
  EXPECT_GT(ball.faces.size(), 500u);
  EXPECT_LT(ball.positions.size(), 1500u);
  EXPECT_EQ(ball.textures.size(), 1u);
  for (std::size_t c = 0; c < ball.corner_uvs.size(); ++c) {
    const glm::vec3 p = ball.positions[static_cast<std::size_t>(ball.faces[c / 3][c % 3])];
    EXPECT_NEAR(ball.corner_uvs[c].x, p.x, 0.09f);  // a cell is at most 0.9 / 20 across
    EXPECT_NEAR(ball.corner_uvs[c].y, p.y, 0.09f);
    EXPECT_NEAR(glm::length(p), 0.45f, 0.03f);
  }
  ClusterFaces(1, &ball);  // there is always something left
  EXPECT_FALSE(ball.faces.empty());
}

TEST(GeometryFingerprint, SeesShapeOnly) {
  const Mesh mesh = TwoMaterials();
  Mesh other = mesh;
  std::reverse(other.faces.begin(), other.faces.end());
  for (Face& f : other.faces) std::rotate(f.begin(), f.begin() + 1, f.end());
  SetColor(other, {0, 1, 0, 1});
  EXPECT_EQ(GeometryFingerprint(mesh), GeometryFingerprint(other));
  other.positions[0].x += 0.01f;
  EXPECT_NE(GeometryFingerprint(mesh), GeometryFingerprint(other));
}

TEST(RemoveGlass, TakesGlassUnlessThatIsAllThereIs) {
  Mesh mesh = TwoMaterials();
  mesh.corner_uvs.assign(3 * mesh.faces.size(), glm::vec2(0));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) mesh.corner_uvs[3 * f + k].x = static_cast<float>(f);
  }
  const std::size_t faces = mesh.faces.size();
  RemoveGlass(&mesh);
  EXPECT_TRUE(Validate(mesh).ok());
  EXPECT_EQ(mesh.faces.size(), faces - 4);
  EXPECT_EQ(mesh.corner_uvs[0].x, 4);  // attributes go with their faces
  for (auto& material : mesh.materials) material.base_color.a = 0;
  RemoveGlass(&mesh);
  EXPECT_EQ(mesh.faces.size(), faces - 4);
}

}  // namespace tilegrad::train::build_test
