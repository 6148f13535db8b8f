// SPDX-License-Identifier: Apache-2.0
// Models of packages: small ones that the tests write, and those that are installed.
#include "train/data/sources/package_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "io/archive.h"
#include "io/image_file.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"

namespace tilegrad::train::package_models_test {

constexpr const char* kHead =
    "class\tshape\tname\tpackage\tlicence\tmodel\tfront\tup\twith\twithout\ttextures\twheels\n";

std::string Poly(const std::string& name, const std::string& x, const std::string& image) {
  return "OBJECT poly\nname \"" + name + "\"\ntexture \"C:\\art\\" + image + "\"\nnumvert 4\n" + x +
         " 0 0\n0 1 0\n0 0 2\n0 0 -2\nnumsurf 3\nSURF 0x20\nmat 0\nrefs 3\n0 0 0\n1 0 1\n2 1 0\n"
         "SURF 0x20\nmat 0\nrefs 3\n0 0 0\n2 1 0\n3 1 1\nSURF 0x20\nmat 0\nrefs 3\n1 0 0\n2 1 0\n3 "
         "1 "
         "1\nkids 0\n";
}

class PackageModelsTest : public TempFolderTest {
 protected:
  void SetUp() override {
    const std::string head =
        "AC3Db\nMATERIAL \"m\" rgb 1 1 1 amb 1 1 1 emis 0 0 0 spec 0 0 0 shi 0 trans 0\n"
        "OBJECT world\nkids 2\n";
    for (const char* plane : {"one", "two"}) {
      const std::string folder = std::string("flightgear/AI/Aircraft/") + plane;
      // Noses at x = -3 and -4; the blur reaches to 50.
      Write(folder + "/Models/p.ac",
            head + Poly("hull", plane == std::string("one") ? "-3" : "-4", "t.png") +
                Poly("PropBlur", "50", "b.png"));
      for (int livery = 0; livery < 3; ++livery)
        for (const char* image : {"/t.png", "/b.png"})
          Paint(folder + "/Textures/L" + std::to_string(livery) + image, livery);
    }
    ASSERT_TRUE(MakeFolder(folder_ / "flightgear/AI/Aircraft/one/Textures/Empty").ok());
  }

  static Bytes Png(int grey) {
    return io::EncodePng(ImageU8(2, 2, 3, static_cast<std::uint8_t>(grey))).value();
  }
  void Paint(const std::string& name, int grey) { Write(name, Png(grey)); }

  static std::string Row(const std::string& shape) {
    return "airplane\t" + shape + "\tPlane " + shape + "\tflightgear-data-ai\tGPL-2+\t" + shape +
           "/Models/p.ac\t-x\ty\t\t\t" + shape + "/Textures/*/t.png\t\n";
  }
  std::unique_ptr<ModelSource> Open(const std::string& rows) {
    text_ = kHead + rows;
    return Ok(PackageModels({"planes", text_, {"blur"}}, folder_)).value();
  }

  std::string text_;
};

TEST_F(PackageModelsTest, EachLiveryIsAnEntryOfItsShape) {
  const auto source = Open(Row("one") + Row("two"));
  ASSERT_EQ(source->entries().size(), 6u);
  EXPECT_EQ(source->entries()[0].id, "one-L0");
  EXPECT_EQ(source->entries()[2].name, "Plane one, L2");
  EXPECT_EQ(source->entries()[2].shape, "one");
  EXPECT_EQ(source->entries()[3].shape, "two");
  EXPECT_EQ(source->facts().credits.size(), 1u);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto model = Ok(source->Load(i));
    EXPECT_TRUE(model->warnings.empty()) << model->warnings[0];
    const Mesh& mesh = std::get<Mesh>(model->data);
    ASSERT_EQ(mesh.textures.size(), 2u);
    EXPECT_EQ(mesh.textures[0].image.pixels[0], i);
  }
}

// The nose, which the file has along -x, looks along +z; what turns is no part of the model.
TEST_F(PackageModelsTest, ModelsAreTurnedAndLeftOutPartsAreGone) {
  const auto source = Open(Row("one"));
  const auto model = Ok(source->Load(0));
  const Bounds bounds = MeshBounds(std::get<Mesh>(model->data));
  EXPECT_EQ(bounds.high, glm::vec3(2, 1, 3));
  EXPECT_EQ(bounds.low, glm::vec3(-2, 0, 0));
}

// By the name of an object or of its texture, but never the whole model.
TEST_F(PackageModelsTest, ALineMayLeaveOutMore) {
  const std::pair<const char*, std::size_t> cases[] = {
      {"propblur", 3u}, {"b.png", 3u}, {"none", 6u}, {"hull|propblur", 6u}, {".png", 6u}};
  for (const auto& [words, faces] : cases) {
    std::string row = Row("one");
    const std::string text = kHead + row.replace(row.find("\ty\t\t\t") + 4, 0, words);
    const auto source = Ok(PackageModels({"planes", text, {}}, folder_));
    const auto model = Ok((*source)->Load(0));
    EXPECT_EQ(std::get<Mesh>(model->data).faces.size(), faces) << words;
  }
}

TEST_F(PackageModelsTest, ImagesOfAListPaintAModelOfAZip) {
  const std::string obj =
      "v 0 0 0\nv 1 0 0\nv 0 3 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl none\nf 1/1 2/2 3/3\n";
  const Bytes mesh(obj.begin(), obj.end());
  ASSERT_TRUE(MakeFolder(folder_ / "trigger-rally").ok());
  Ok(io::WriteZip(
      folder_ / "trigger-rally/data.zip",
      {{"c/car.obj", mesh}, {"c/a.png", Png(10)}, {"c/b.png", Png(20)}, {"c/wheel.obj", mesh}}));
  const auto source = Open(
      "car\tcar\tCar\ttrigger-rally-data\tGPL\tc/car.obj\t+y\tz\tc/wheel.obj\t\t=c/a.png|=c/"
      "b.png\t\n");
  ASSERT_EQ(source->entries().size(), 2u);
  EXPECT_EQ(source->entries()[1].id, "car-b");
  const auto model = Ok(source->Load(1));
  const Mesh& painted = std::get<Mesh>(model->data);
  EXPECT_EQ(painted.faces.size(), 2u);
  ASSERT_EQ(painted.textures.size(), 1u);
  EXPECT_EQ(painted.textures[0].image.pixels[0], 20);
  EXPECT_EQ(MeshBounds(painted).high, glm::vec3(0, 0, 3));  // x to -x, y to z
}

// A wheel of radius 1 and width 0.5 at y = 1, whose axle lies across the file's nose.
TEST_F(PackageModelsTest, WheelsOfAListAreAdded) {
  std::string row = Row("one");
  row.insert(row.size() - 1, "0 1 5 1 0.5|0 1 -5 1 0.5");
  const auto source = Open(row);
  const auto model = Ok(source->Load(0));
  const Mesh& mesh = std::get<Mesh>(model->data);
  EXPECT_TRUE(Validate(mesh).ok());
  const Bounds bounds = MeshBounds(mesh);
  const float half = 0.25f * 1.03f;  // the rim stands out
  EXPECT_NEAR(bounds.high.x, 5 + half, 1e-5);
  EXPECT_NEAR(bounds.low.x, -5 - half, 1e-5);
  EXPECT_NEAR(bounds.high.y, 2, 1e-5);
  EXPECT_NEAR(bounds.low.z, -1, 1e-5);
}

TEST_F(PackageModelsTest, MissingPackagesAreNamed) {
  const auto expect = [](const Result<std::unique_ptr<ModelSource>>& source, const char* package) {
    ASSERT_FALSE(source.ok());
    EXPECT_EQ(source.status().code(), StatusCode::kNotFound);
    ExpectMessage(source.status(), std::string("recommends ") + package);
  };
  expect(PlanesSource(folder_), "flightgear-data-ai");
  expect(ShipsSource(folder_), "flightgear-data-models");
  expect(CarsSource(folder_), "torcs-data");
}

TEST_F(PackageModelsTest, TextureSetsByPattern) {
  const Path archive = folder_ / "flightgear/AI/Aircraft";
  const auto names = [&](const char* column) {
    std::vector<std::string> out;
    for (const TextureSet& set : FindTextureSets(column, archive))
      out.push_back(set.name + ":" + set.folder + ":" + set.image);
    return out;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names(""), Names{"::"});
  EXPECT_EQ(names(".|one/Textures/L1/t.png"), (Names{"::", ":one/Textures/L1:"}));
  EXPECT_EQ(names("*/Textures/*/t.png").size(), 6u);
  EXPECT_EQ(names("*/Textures/*/t.png")[4], "two-L1:two/Textures/L1:");
  EXPECT_EQ(names("=a/b.png"), Names{"b::a/b.png"});
  EXPECT_EQ(names("no/*/t.png"), Names{});
}

// Never by livery, whatever the share.
TEST_F(PackageModelsTest, DatasetsAreSplitByShape) {
  const auto source = Open(Row("one") + Row("two"));
  BuildOptions options;
  options.image_size = 8;
  options.views = 2;
  options.split.test_share = 0.5;
  Ok(BuildDataset(*source, options, folder_ / "out", Workers(2), {}).status());
  const auto dataset = Ok(Dataset::Open(folder_ / "out"));
  ASSERT_EQ(dataset->models().size(), 6u);
  EXPECT_EQ(CountShapes(dataset->models()), 2u);
  EXPECT_EQ(dataset->Select(Split::kTest).size(), 3u);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(dataset->models()[i].shape, i < 3 ? "one" : "two");
    EXPECT_EQ(dataset->models()[i].split, dataset->models()[i < 3 ? 0 : 3].split);
    EXPECT_EQ(dataset->models()[i].geometry, dataset->models()[i < 3 ? 0 : 3].geometry);
  }
  EXPECT_NE(dataset->LoadImages(0).value(), dataset->LoadImages(2).value());

  options.liveries = 1;  // of the files that are there
  const auto fewer = Ok(BuildDataset(*source, options, folder_ / "out", Workers(1), {}));
  EXPECT_EQ(fewer->models.size(), 2u);
  EXPECT_EQ(fewer->reused, 2);
  options.liveries = 0;
  options.per_class = 1;
  const auto one = Ok(BuildDataset(*source, options, folder_ / "out", Workers(1), {}));
  EXPECT_EQ(one->models.size(), 3u);
  EXPECT_EQ(CountShapes(one->models), 1u);
}

// Files that another list made are not kept: it may turn a model, or leave a part of it out.
TEST_F(PackageModelsTest, AnotherListIsAnotherRecipe) {
  const auto source = Open(Row("one"));
  BuildOptions options;
  options.image_size = 8;
  options.views = 1;
  ASSERT_TRUE(BuildDataset(*source, options, folder_ / "out", Workers(1), {}).ok());
  std::string row = Row("one");
  const std::string text = kHead + row.replace(row.find("\t-x\t") + 1, 2, "-z");
  auto turned = Ok(PackageModels({"planes", text, {"blur"}}, folder_));
  ExpectMessage(BuildDataset(**turned, options, folder_ / "out", Workers(1), {}).status(),
                "other settings");
  std::vector<std::unique_ptr<ModelSource>> one;
  one.push_back(std::move(*turned));
  EXPECT_NE(CombineSources("planes", std::move(one))->facts().version, source->facts().version);
}

TEST_F(PackageModelsTest, CombinedSourcesKeepTheirModels) {
  std::vector<std::unique_ptr<ModelSource>> sources;
  const std::string first = kHead + Row("one"), second = kHead + Row("two");
  for (const std::string* text : {&second, &first}) {
    auto source = Ok(PackageModels({"planes", *text, {}}, folder_));
    sources.push_back(std::move(*source));
  }
  const auto both = CombineSources("both", std::move(sources));
  EXPECT_EQ(both->facts().name, "both");
  EXPECT_EQ(both->facts().credits.size(), 1u);
  ASSERT_EQ(both->entries().size(), 6u);
  EXPECT_EQ(both->entries()[0].id, "one-L0");
  const auto model = Ok(both->Load(4));
  EXPECT_EQ(std::get<Mesh>(model->data).textures[0].image.pixels[0], 1);
}

TEST(PackageLists, AreCompiledIn) {
  const Path data = Path(TILEGRAD_SOURCE_DIR) / "data";
  EXPECT_TRUE(ReadText(data / "planes.tsv").value() == PlanesList());
  EXPECT_TRUE(ReadText(data / "ships.tsv").value() == ShipsList());
  EXPECT_TRUE(ReadText(data / "cars.tsv").value() == CarsList());
}

struct Installed {
  const char* name;
  const char* archive;
  Result<std::unique_ptr<ModelSource>> (*open)(const Path&);
  std::size_t shapes, models;  // at least
};

class PackagesTest : public testing::TestWithParam<Installed> {};

// Every model is there with all of its textures.
TEST_P(PackagesTest, EveryShapeLoads) {
  if (!std::filesystem::exists(Path(kGamesFolder) / GetParam().archive))
    GTEST_SKIP() << GetParam().archive << " is not installed";
  const auto source = GetParam().open(kGamesFolder);
  if (!source.ok() && source.status().code() == StatusCode::kNotFound)
    GTEST_SKIP() << source.status().message();
  ASSERT_TRUE(source.ok()) << source.status().message();
  std::set<std::string> shapes;
  for (std::size_t i = 0; i < (*source)->entries().size(); ++i) {
    if (!shapes.insert((*source)->entries()[i].shape).second) continue;
    Ok((*source)->Load(i).status());
  }
  EXPECT_GE(shapes.size(), GetParam().shapes);
  EXPECT_GE((*source)->entries().size(), GetParam().models);
}

INSTANTIATE_TEST_SUITE_P(
    All, PackagesTest,
    testing::Values(Installed{"planes", "flightgear/AI/Aircraft", PlanesSource, 109, 1000},
                    Installed{"ships", "flightgear/Models", ShipsSource, 24, 24},
                    Installed{"cars", "torcs", CarsSource, 33, 100}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace tilegrad::train::package_models_test
