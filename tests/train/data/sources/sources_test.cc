// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>

#include "io/npz.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"
#include "train/data/sources/model_source.h"
#include "train/data/sources/package_models.h"
#include "train/data/sources/split_list.h"

namespace tilegrad::train::sources_test {

constexpr const char* kTetrahedron =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
const std::string kPainted =
    "mtllib m.mtl\nvt 0 0\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n";

class SourcesTest : public TempFolderTest {
 protected:
  Result<std::unique_ptr<ModelSource>> Listed() const {
    TILEGRAD_ASSIGN(const SplitList list, SplitList::Read({folder_ / "split.txt"}));
    return ShapeNetSource(folder_ / "net", list);
  }
  // Of the folder "set".
  BuildSummary Build(int workers = 1) const {
    BuildOptions options;
    options.image_size = 8;
    options.views = 2;
    const auto source = Ok(FolderSource(folder_ / "set"));
    return Ok(BuildDataset(**source, options, folder_ / "out", Workers(workers), {})).value();
  }
};

TEST(Procedural, ModelsAreValidDifferentAndRepeatable) {
  for (int c = 0; c < static_cast<int>(ProceduralClasses().size()); ++c) {
    std::set<std::vector<float>> shapes;
    for (std::uint64_t i = 0; i < 20; ++i) {
      const Mesh mesh = ProceduralModel(c, i, 9), again = ProceduralModel(c, i, 9);
      ASSERT_TRUE(Validate(mesh).ok());
      EXPECT_EQ(mesh.colors.size(), mesh.positions.size());
      EXPECT_EQ(mesh.positions, again.positions);
      EXPECT_EQ(mesh.colors, again.colors);
      const Bounds bounds = MeshBounds(mesh);
      const glm::vec3 size = bounds.high - bounds.low;
      shapes.insert({size.x, size.y, size.z});
    }
    EXPECT_EQ(shapes.size(), 20u) << ProceduralClasses()[static_cast<std::size_t>(c)];
  }
}

// Six times the volume that the faces enclose: positive if they are counter-clockwise from outside.
double SignedVolume(const Mesh& mesh) {
  double volume = 0;
  for (const Face& f : mesh.faces) {
    const glm::dvec3 a(mesh.positions[static_cast<std::size_t>(f[0])]),
        b(mesh.positions[static_cast<std::size_t>(f[1])]),
        c(mesh.positions[static_cast<std::size_t>(f[2])]);
    volume += glm::dot(a, glm::cross(b, c));
  }
  return volume;
}

TEST(Procedural, FacesLookOutwards) {
  for (int c = 0; c < static_cast<int>(ProceduralClasses().size()); ++c) {
    for (std::uint64_t i = 0; i < 20; ++i) EXPECT_GT(SignedVolume(ProceduralModel(c, i, 2)), 0);
  }
}

TEST_F(SourcesTest, FolderFindsModelsAndReportsBrokenOnes) {
  Write("set/solid/a b.obj", kTetrahedron);
  Write("set/solid/c.obj", "v 0 0 0\nf 1 2 9\n");
  Write("set/solid/notes.txt", "no model");
  Write("set/readme.md", "no class");
  const auto source = Ok(FolderSource(folder_ / "set"));
  ASSERT_EQ((*source)->entries().size(), 2u);
  EXPECT_EQ((*source)->entries()[0].id, "a_b");
  EXPECT_EQ((*source)->entries()[0].class_name, "solid");
  const BuildSummary summary = Build();
  EXPECT_EQ(summary.models.size(), 1u);
  ASSERT_EQ(summary.rejected.size(), 1u);
  ExpectIn(summary.rejected[0].reason, "c.obj");
  ASSERT_EQ(summary.ignored.size(), 2u);
  ExpectIn(summary.ignored[0].file, "readme.md");
  ExpectIn(summary.ignored[1].file, "notes.txt");
}

// Models that nobody published are used without their textures.
TEST_F(SourcesTest, BrokenModelsOfAFolderCostThemselves) {
  Write("set/none/faces.obj", "v 0 0 0\n");
  Write("set/nan/vertex.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  for (const std::string name : {"missing", "cut"}) {
    Write("set/" + name + "/m.obj", kPainted);
    Write("set/" + name + "/m.mtl", "newmtl m\nmap_Kd m.png\n");
  }
  Write("set/cut/m.png", "\x89PNG\r\n\x1a\n");
  std::filesystem::create_directory(folder_ / "set/empty");
  const BuildSummary summary = Build();
  EXPECT_EQ(summary.models.size(), 2u);
  ExpectIn(summary.broken.Summary(), "(none/faces)", "(nan/vertex)");
  ASSERT_EQ(summary.warnings.size(), 2u);
  ExpectIn(summary.warnings[0].file + summary.warnings[0].text, "cut/m.obj", "m.png");
  ExpectIn(summary.warnings[1].file + summary.warnings[1].text, "missing/m.obj", "m.png");
  ExpectIn(summary.ignored.back().file + summary.ignored.back().reason, "set/empty", "no model");
}

TEST_F(SourcesTest, FolderSaysWhatItPassedOver) {
  Write("set/loose.obj", kTetrahedron);
  Write("set/deep/inner/a.obj", kTetrahedron);
  Write("set/empty/.hidden", "");
  Write("set/solid/a.OBJ", kTetrahedron);
  Write("set/solid/a.mtl", "");
  Write("set/solid/skin.JPG", "");
  Write("set/solid/textures/skin.png", "");
  Write("set/solid/b.max", "");
  const auto source = Ok(FolderSource(folder_ / "set"));
  ASSERT_EQ((*source)->entries().size(), 1u);
  const std::vector<IgnoredFile> ignored = (*source)->ignored();
  const std::vector<std::pair<std::string, std::string>> expected = {
      {"deep/inner", "too deep"},
      {"deep", "no model"},
      {"empty", "no model"},
      {"loose.obj", "not in a class folder"},
      {"solid/b.max", "not a supported format"}};
  ASSERT_EQ(ignored.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(ignored[i].file, (folder_ / "set" / expected[i].first).string());
    ExpectIn(ignored[i].reason, expected[i].second);
  }
  // Where nothing is left, the error has the first of them.
  std::filesystem::remove(folder_ / "set/solid/a.OBJ");
  ExpectMessage(FolderSource(folder_ / "set").status(), "deep/inner");
  std::filesystem::remove(folder_ / "set/empty/.hidden");  // our own
}

TEST_F(SourcesTest, NamesOfClassesStayDifferent) {
  for (const char* name : {"椅子", "桌子", "a b", "A_B", "\xff", "a.b"})
    Write(std::string("set/") + name + "/é.off.obj", kTetrahedron);
  std::set<std::string> classes;
  const auto source = Ok(FolderSource(folder_ / "set"));
  for (const SourceEntry& entry : (*source)->entries()) {
    classes.insert(entry.class_name);
    EXPECT_EQ(entry.id, "é.off");
  }
  EXPECT_EQ(classes, (std::set<std::string>{"椅子", "桌子", "a_b", "A_B", "_", "a.b"}));
  Write("set/a_b/x.obj", kTetrahedron);
  ExpectMessage(FolderSource(folder_ / "set").status(), "a b and ", "a_b would both", "rename one");
}

TEST_F(SourcesTest, HiddenNamesAreNoModels) {
  const char* const hidden[] = {"set/.git", "set/c/._a.obj", "set/c/textures/._x.obj"};
  Write("set/.git/a.obj", kTetrahedron);
  Write(hidden[1], "");
  Write(hidden[2], "");
  Write("set/c/a.obj", kTetrahedron);
  const auto source = Ok(FolderSource(folder_ / "set"));
  EXPECT_EQ((*source)->entries().size(), 1u);
  EXPECT_TRUE((*source)->ignored().empty());
  for (const char* name : hidden) std::filesystem::remove_all(folder_ / name);
}

// Builds a dataset of one folder again and again.
class RepeatedTest : public SourcesTest {
 protected:
  void ExpectBuilt(int reused, int renewed) const {
    const BuildSummary summary = Build();
    EXPECT_EQ(summary.reused, reused);
    EXPECT_EQ(summary.renewed, renewed);
  }
};

// Which are made unique by what is beside them.
TEST_F(RepeatedTest, IdsMayMoveToOtherModels) {
  Write("set/c/b.off",
        "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  Build();
  Write("set/c/b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const BuildSummary moved = Build();
  EXPECT_EQ(moved.renewed, 1);
  ASSERT_EQ(moved.models.size(), 2u);
  EXPECT_EQ(moved.models[0].source_faces, 1);
  EXPECT_EQ(moved.models[1].source_faces, 4);
  ExpectBuilt(2, 0);
  const auto again = Contents(folder_ / "out");
  std::filesystem::remove_all(folder_ / "out");
  Build(2);
  EXPECT_EQ(Contents(folder_ / "out"), again);
}

TEST_F(RepeatedTest, ChangedFilesAreReadAgain) {
  Write("set/c/a.obj", kPainted);
  Write("set/c/m.mtl", "newmtl m\nKd 1 0 0\n");
  Write("set/c/b.obj", kTetrahedron);
  Build();
  ExpectBuilt(2, 0);
  Write("set/c/a.obj", kPainted + "# changed\n");
  ExpectBuilt(1, 1);
  Write("set/c/m.mtl", "newmtl m\nKd 0 1 0\nmap_Kd skin.ppm\n");
  ExpectBuilt(1, 1);
  ExpectBuilt(2, 0);  // without its texture
  Write("set/c/skin.ppm", std::string("P6 1 1 255\n\x20\x40\x60"));
  ExpectBuilt(1, 1);
  Write("set/c/skin.ppm", std::string("P6 1 1 255\n\x60\x40\x20"));
  ExpectBuilt(1, 1);
  std::filesystem::remove(folder_ / "set/c/skin.ppm");
  ExpectBuilt(1, 1);
}

// As files of earlier versions are.
TEST_F(RepeatedTest, FilesWithoutARecordAreMadeAgain) {
  Write("set/c/a.obj", kTetrahedron);
  const DatasetInfo info = Build().info;
  const auto whole = Contents(folder_ / "out");
  const Path file = ModelFilePath(folder_ / "out", "c", "a");
  ModelStamp stamp = Ok(VerifyModelFile(file, info)).value();
  stamp.inputs.clear();
  Ok(SaveModelFile(file, info, Ok(LoadModelFile(file, info)).value(), stamp));
  ExpectBuilt(0, 1);
  EXPECT_EQ(Contents(folder_ / "out"), whole);
}

// A link to itself cannot be opened even by root, unlike a file without permissions.
TEST_F(RepeatedTest, FilesThatCannotBeOpenedCostThemselves) {
  Write("set/c/a.obj", kTetrahedron);
  std::filesystem::create_symlink("b.obj", folder_ / "set/c/b.obj");
  const BuildSummary summary = Build();
  EXPECT_EQ(summary.models.size(), 1u);
  ASSERT_EQ(summary.rejected.size(), 1u);
  ExpectIn(summary.rejected[0].reason, "b.obj", "cannot open");
}

TEST_F(SourcesTest, FoldersWithoutModelsAreErrors) {
  EXPECT_EQ(FolderSource(folder_).status().code(), StatusCode::kNotFound);
  EXPECT_EQ(FolderSource(folder_ / "no").status().code(), StatusCode::kNotFound);
  EXPECT_EQ(ShapeNetSource(folder_, {}).status().code(), StatusCode::kNotFound);
  EXPECT_EQ(NmrSource(folder_).status().code(), StatusCode::kNotFound);
}

TEST_F(SourcesTest, ShapeNetTreeAndSplitList) {
  for (const char* model : {"a1", "b2", "c3"}) {
    Write(std::string("net/03001627/") + model + "/models/model_normalized.obj", kTetrahedron);
  }
  Write("net/99999999/z/models/model_normalized.obj", kTetrahedron);
  const auto all = Ok(ShapeNetSource(folder_ / "net", {}));
  ASSERT_EQ((*all)->entries().size(), 3u);
  EXPECT_EQ((*all)->entries()[0].class_name, "chair");
  EXPECT_FALSE((*all)->entries()[0].split.has_value());
  EXPECT_TRUE((*all)->Load(0).ok());

  Write("split.txt", "03001627/a1 test\n\n03001627/c3 val\n");
  const auto listed = Ok(Listed());
  ASSERT_EQ((*listed)->entries().size(), 2u);
  EXPECT_EQ((*listed)->entries()[0].split, Split::kTest);
  EXPECT_EQ((*listed)->entries()[1].split, Split::kValidation);

  Write("split.txt", "03001627/a1 test\n03001627/b2 exam\n");
  ExpectMessage(Listed().status(), "line 2");

  Write("split.txt", "03001627/d4 test\n");
  ExpectMessage(Listed().status(), "that the list names");
}

TEST_F(SourcesTest, MissingFurnitureSaysWhatToInstall) {
  const auto source = SweetHome3dSource(folder_);
  ASSERT_FALSE(source.ok());
  EXPECT_EQ(source.status().code(), StatusCode::kNotFound);
  ExpectMessage(source.status(), "apt-get install");
}

TEST(SweetHome3d, ListIsCompiledIn) {
  const Path file = Path(TILEGRAD_SOURCE_DIR) / "data" / "sweethome3d_classes.tsv";
  EXPECT_EQ(ReadText(file).value(), SweetHome3dList());
}

TEST(SweetHome3d, ElevenClassesLoad) {
  if (!std::filesystem::exists(kSweetHome3dFolder)) {
    GTEST_SKIP() << "the package sweethome3d-furniture is not installed";
  }
  const auto source = Ok(SweetHome3dSource(kSweetHome3dFolder));
  std::set<std::string> classes;
  for (std::size_t i = 0; i < (*source)->entries().size(); ++i) {
    if (!classes.insert((*source)->entries()[i].class_name).second) continue;
    Ok((*source)->Load(i).status());
  }
  EXPECT_EQ(classes.size(), 11u);
}

// --- N3MR / SoftRas ---

constexpr std::size_t kImage = 24 * 4 * 64 * 64, kGrid = 32 * 32 * 32;

// `models` opaque white squares on black, with `grid` for all.
void WriteNmr(const Path& stem, std::size_t models, const std::vector<std::uint8_t>& grid) {
  std::vector<std::uint8_t> images(models * kImage), voxels;
  for (std::size_t i = 0; i < images.size(); i += 64 * 64) {
    std::fill_n(images.begin() + static_cast<std::ptrdiff_t>(i + 64 * 32), 64, 255);
  }
  for (std::size_t i = 0; i < models; ++i) voxels.insert(voxels.end(), grid.begin(), grid.end());
  auto npy = io::MakeNpy<std::uint8_t>({models, 32, 32, 32}, voxels);
  npy.type = io::NpyType::kBool;
  Ok(io::SaveNpz(stem.string() + "_images.npz",
                 {{"arr_0", io::MakeNpy<std::uint8_t>({models, 24, 4, 64, 64}, images)}}));
  ASSERT_TRUE(io::SaveNpz(stem.string() + "_voxels.npz", {{"arr_0", npy}}).ok());
}

TEST_F(SourcesTest, NmrFilesThatDoNotFitAreErrors) {
  WriteNmr(folder_ / "car_val", 1, std::vector<std::uint8_t>(kGrid));
  const std::vector<std::uint8_t> small(16);
  Ok(io::SaveNpz(folder_ / "car_val_voxels.npz",
                 {{"arr_0", io::MakeNpy<std::uint8_t>({1, 16}, small)}}));
  ExpectMessage(NmrSource(folder_).status(), "car_val_voxels.npz");
}

using Vec = glm::dvec3;

// Where N3MR's own camera sees a point of its frame in view v: right and up, 1 at the border.
glm::dvec2 ProjectAsNmr(Vec p, int v) {
  const double rad = std::acos(-1.0) / 180, azimuth = -15 * v * rad, elevation = 30 * rad;
  const Vec eye = 2.732 * Vec(std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                              -std::cos(elevation) * std::cos(azimuth));
  const Vec z = glm::normalize(-eye), x = glm::normalize(glm::cross(Vec(0, 1, 0), z)),
            y = glm::cross(z, x), q = p - eye;
  const double width = std::tan(15 * rad) * glm::dot(z, q);
  return {glm::dot(x, q) / width, glm::dot(y, q) / width};
}

glm::dvec2 ProjectAsOurs(Vec p, const Camera& camera) {
  Vec q;
  for (int r = 0; r < 3; ++r) {
    q[r] = camera.translation[r];
    for (int c = 0; c < 3; ++c) q[r] += camera.rotation[3 * r + c] * p[c];
  }
  return {camera.fx * q.x / -q.z / 32, camera.fy * q.y / -q.z / 32};
}

// A voxel of their frame, through the file and back, stands where their images show it.
TEST_F(SourcesTest, NmrVoxelsMeetTheirImages) {
  const std::array<int, 3> theirs = {3, 20, 11};  // x', y', z'
  std::vector<std::uint8_t> grid(kGrid);
  grid[static_cast<std::size_t>((theirs[1] * 32 + theirs[0]) * 32 + 31 - theirs[2])] = 1;
  WriteNmr(folder_ / "car_train", 1, grid);
  const auto source = Ok(NmrSource(folder_));
  const auto data = std::get<ModelData>((*source)->Load(0).value().data);
  const auto at = std::find(data.occupancy.begin(), data.occupancy.end(), 1);
  ASSERT_NE(at, data.occupancy.end());
  const int index = static_cast<int>(at - data.occupancy.begin());
  const auto place = [](int x, int y, int z) { return (Vec(x, y, z) + 0.5) / 32.0 - 0.5; };
  const Vec ours = place(index / 1024, index / 32 % 32, index % 32);
  const DatasetInfo info = *(*source)->FixedInfo();
  for (int v = 0; v < info.views; ++v) {
    const auto a = ProjectAsNmr(place(theirs[0], theirs[1], theirs[2]), v);
    const auto b = ProjectAsOurs(ours, info.camera.View(v));
    EXPECT_NEAR(a.x, b.x, 1e-5) << v;  // the camera is float: 2^-24 times a few terms of size 3
    EXPECT_NEAR(a.y, b.y, 1e-5) << v;
  }
}

// --- Lists that split a set ---

class SplitListTest : public TempFolderTest {
 protected:
  SplitList Read(const std::string& name, const std::string& text) const {
    return Ok(SplitList::Read({Write(name, text)})).value();
  }
  static void ExpectSplit(const SplitList& list, const char* synset, const char* model,
                          std::optional<Split> split) {
    const Listing listing = list.Of(synset, model);
    EXPECT_EQ(listing.used, split.has_value()) << synset << "/" << model;
    EXPECT_EQ(listing.split, split) << synset << "/" << model;
  }
};

TEST_F(SplitListTest, WithoutAListEverythingIsUsed) {
  const Listing listing = Ok(SplitList::Read({}))->Of("03001627", "a");
  EXPECT_TRUE(listing.used);
  EXPECT_FALSE(listing.split);
}

TEST_F(SplitListTest, LinesOfAModelAndItsSplit) {
  const SplitList list =
      Read("list.txt", "03001627/a train\r\n\n03001627/b val\n02958343/a test\n");
  EXPECT_EQ(list.size(), 3u);
  ExpectSplit(list, "03001627", "a", Split::kTrain);
  ExpectSplit(list, "03001627", "b", Split::kValidation);
  ExpectSplit(list, "02958343", "a", Split::kTest);
  ExpectSplit(list, "02958343", "b", std::nullopt);
}

// Some models of Pixel2Mesh's have views in both files.
TEST_F(SplitListTest, Pixel2MeshListsViews) {
  const Path train = Write("train_list.txt",
                           "Data/ShapeNetP2M/03001627/a/rendering/00.dat\n"
                           "Data/ShapeNetP2M/03001627/a/rendering/01.dat\n"
                           "Data/ShapeNetP2M/03001627/b/rendering/00.dat\n");
  const Path test = Write("test_list.txt", "Data/ShapeNetP2M/03001627/b/rendering/04.dat\n");
  const SplitList list = Ok(SplitList::Read({test, train})).value();
  EXPECT_EQ(list.size(), 2u);
  ExpectSplit(list, "03001627", "a", Split::kTrain);
  ExpectSplit(list, "03001627", "b", Split::kTest);
}

TEST_F(SplitListTest, DibrListsPicturesByOneName) {
  const SplitList list = Read("test_list.txt", "/data/02691156_d0-a_f_12.png\n04256520_e_0.png\n");
  ExpectSplit(list, "02691156", "d0-a_f", Split::kTest);
  ExpectSplit(list, "04256520", "e", Split::kTest);
}

// A list in a class's folder is of that class.
TEST_F(SplitListTest, NamesAlone) {
  const SplitList own = Read("03001627/softras_val.lst", "a\nb");
  ExpectSplit(own, "03001627", "b", Split::kValidation);
  ExpectSplit(own, "02958343", "b", std::nullopt);
  ExpectSplit(Read("train.lst", "a\n"), "02958343", "a", Split::kTrain);
}

TEST_F(SplitListTest, ShapeNetsTable) {
  const SplitList list = Read("all.csv",
                              "id,synsetId,subSynsetId,modelId,split\n"
                              "000001,02691156,02690373,a,train\n000002,02691156,2690373,b,val\n");
  ExpectSplit(list, "02691156", "a", Split::kTrain);
  ExpectSplit(list, "02691156", "b", Split::kValidation);
}

TEST_F(SplitListTest, JsonOfViewsAndOfNames) {
  const SplitList list = Read("splits.json", R"({"train": {"03001627": {"a": [0, 1]}},
                                                 "test": {"03001627": ["b"]}})");
  ExpectSplit(list, "03001627", "a", Split::kTrain);
  ExpectSplit(list, "03001627", "b", Split::kTest);
}

// 3D-R2N2's shapenet_1000.json: which classes, and no split.
TEST_F(SplitListTest, JsonOfClasses) {
  const SplitList list = Read("shapenet_1000.json", R"({"03001627": {"id": "03001627"}})");
  EXPECT_TRUE(list.Of("03001627", "a").used);
  EXPECT_FALSE(list.Of("03001627", "a").split);
  EXPECT_FALSE(list.Of("02958343", "a").used);
}

TEST_F(SplitListTest, WhatSaysNoSplitIsAnError) {
  const auto read = [&](const std::string& name, const std::string& text) {
    return SplitList::Read({Write(name, text)}).status();
  };
  ExpectMessage(read("models.txt", "03001627/a\n"), "models.txt: line 1");
  ExpectMessage(read("train_test.txt", "03001627/a\n"), "line 1");
  ExpectMessage(read("train.txt", "03001627/a exam\n"), "line 1");
  ExpectMessage(read("train.txt", "\n"), "lists no models");
  ExpectMessage(read("a.json", R"({"exam": {}})"), "exam");
  ExpectMessage(read("a.json", "{"), "a.json");
  ExpectMessage(SplitList::Read({folder_ / "none"}).status(), "none");
}

}  // namespace tilegrad::train::sources_test
