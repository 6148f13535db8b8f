// SPDX-License-Identifier: Apache-2.0
// Textured pictures, each view under a light of its own: lights are drawn from where they should,
// the same position gives the same bits, and what is shown is lit texture.
#include "train/data/stream/textured_stream.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "scene/topology.h"
#include "support/temp_folder.h"
#include "train/data/build/build.h"

namespace tilegrad::train::textured_stream_test {

constexpr int kSize = 24;

// A ball whose upper half is red and whose lower one is blue.
Mesh Ball() {
  Mesh ball = Icosphere(2, 0.45f);
  ball.corner_uvs = SphereUvs(ball);
  ImageU8 image(32, 16, 3);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 32; ++x) image.at(x, y)[y < 8 ? 0 : 2] = 200;
  }
  ball.textures = {{"halves", image}};
  ball.materials = {{.name = "", .base_color = glm::vec4(1), .base_color_texture = 0}};
  return ball;
}

constexpr std::size_t kRoom = 1 << 30;

MeshCache Balls(std::size_t count) {
  return {count, kRoom, [](std::size_t) { return Result<TexturedMesh>(TexturedMesh(Ball())); }};
}

// Nothing is left to chance but azimuth and light.
TexturedStream::Job Still(const std::string& model) {
  TexturedStream::Job job;
  job.config = WithoutChanges({});
  StreamConfig& draw = job.config.draw;
  draw.roll = draw.jitter = 0;
  draw.elevation_low = draw.elevation_high = 27;
  draw.fov_low = draw.fov_high = Lens{}.fov_y;
  job.light.model = model;
  job.camera.lens.width = job.camera.lens.height = job.size = kSize;
  return job;
}

TEST(LightDraw, ComesFromTheCapAroundTheCamera) {
  for (const double spread : {20.0, 90.0}) {
    LightConfig config;
    config.spread = spread;
    Rng rng(1);
    double lowest = 1, side = 0;
    for (int k = 0; k < 2000; ++k) {
      const DrawnLight light = DrawLight(config, rng);
      const auto& d = light.direction;
      EXPECT_NEAR(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-6);
      lowest = std::min(lowest, static_cast<double>(d[2]));
      side += d[0];
      EXPECT_GE(light.shininess, 2.999f);
      EXPECT_LE(light.shininess, 30.001f);
    }
    const double edge = std::cos(spread * 3.14159265358979 / 180);
    EXPECT_GE(lowest, edge - 1e-6);
    EXPECT_LT(lowest, edge + 0.01);
    EXPECT_LT(std::abs(side / 2000), 0.05);
  }
  const DrawnLight mean = MeanLight({});
  EXPECT_GT(mean.direction[2], 0.999f);
}

double DegreesBetween(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  const double dot =
      double{a[0]} * double{b[0]} + double{a[1]} * double{b[1]} + double{a[2]} * double{b[2]};
  return std::acos(std::clamp(dot, -1.0, 1.0)) * 180 / 3.14159265358979;
}

// What is known of the paper's lights, and what a constant scores on them. Means of 4000 angles of
// a deviation of some 10 degrees: within half a degree.
TEST(LightDraw, ComesFromWhereThePapersLightsDo) {
  struct Case {
    const char* from;
    double nearest, farthest, mean, constant;  // degrees, the first three from the axis
  };
  for (const Case& c : {Case{"front", 0, 54.74, 22, 22}, Case{"above", 26, 64, 45, 31.7}}) {
    LightConfig config;
    config.from = c.from;
    EXPECT_NEAR(WidestAngle(config), c.farthest, 0.01);
    const std::array<float, 3> constant = MeanLight(config).direction;
    Rng rng(3);
    double off = 0, error = 0;
    for (int k = 0; k < 4000; ++k) {
      const std::array<float, 3> d = DrawLight(config, rng).direction;
      const double angle = DegreesBetween(d, {0, 0, 1});
      EXPECT_GE(angle, c.nearest - 0.01);
      EXPECT_LE(angle, c.farthest + 0.01);
      EXPECT_TRUE(c.nearest == 0 || d[1] >= -1e-6f);
      off += angle / 4000;
      error += DegreesBetween(d, constant) / 4000;
    }
    EXPECT_NEAR(off, c.mean, 0.8) << c.from;
    EXPECT_NEAR(error, c.constant, 0.8) << c.from;
  }
}

// Harmonics are brightest where their light comes from, and that is what is read back.
TEST(LightDraw, HarmonicsHaveTheDirection) {
  Rng rng(2);
  for (int k = 0; k < 100; ++k) {
    const DrawnLight light = DrawLight({}, rng);
    const std::array<float, 3> read = DirectionOf(light.sh);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(read[i], light.direction[i], 1e-5);
  }
}

TEST(LightDraw, WordsAndRangesAreChecked) {
  LightConfig config;
  config.model = "neon";
  ExpectMessage(CheckConfig(config), "light.model is \"neon\"");
  config = {};
  config.from = "below";
  ExpectMessage(CheckConfig(config), "light.from is \"below\"");
  config = {};
  config.shininess_low = 40;
  EXPECT_FALSE(CheckConfig(config).ok());
  EXPECT_TRUE(CheckConfig(LightConfig()).ok());
}

// The same object in the views of another, and back.
TEST(TexturedStream, ViewsCanBeChanged) {
  const Workers workers(1);
  const MeshCache meshes = Balls(1);
  TexturedStream stream(Still("phong"), meshes, workers);
  std::vector<TexturedView> first(2), other(2);
  const auto drawn = Ok(stream.Render(0, 4, 0, first));
  const std::vector<float> before(drawn->begin(), drawn->end());
  ASSERT_TRUE(stream.Render(0, 5, 0, other).ok());
  ASSERT_TRUE(stream.Render(0, 4, 0, other).ok());
  std::swap(other[0], other[1]);
  ASSERT_TRUE(stream.Change(0, other).ok());
  const auto swapped = Ok(stream.Again(0, Appearance::kLit));
  const std::size_t image = before.size() / 2;
  EXPECT_EQ(std::memcmp(swapped->data(), before.data() + image, image * sizeof(float)), 0);
  EXPECT_NE(std::memcmp(swapped->data(), before.data(), image * sizeof(float)), 0);
  ExpectMessage(stream.Change(0, std::span(other).first(1)), "2 views were drawn");
}

// An object that is set up in given views is the one that Render draws at that position.
TEST(TexturedStream, SetsUpWhatRenderDraws) {
  const Workers workers(1);
  const MeshCache meshes = Balls(1);
  TexturedStream::Job job = Still("lambert");
  job.config = {};
  TexturedStream one(job, meshes, workers), other(job, meshes, workers);
  std::vector<TexturedView> views(2);
  const auto drawn = Ok(one.Render(0, 9, 0, views));
  EXPECT_NE(views[0].light.direction, views[1].light.direction);
  ASSERT_TRUE(other.SetUp(0, 9, 0, views).ok());
  const auto again = Ok(other.Again(0, Appearance::kLit));
  ASSERT_EQ(again->size(), drawn->size());
  EXPECT_EQ(std::memcmp(again->data(), drawn->data(), drawn->size_bytes()), 0);
}

// Of Lambert light without ambient, a picture is texture times light in every pixel that one face
// covers wholly; at supersampled edges it is a mean of products.
TEST(TexturedStream, LitIsTextureTimesLight) {
  const Workers workers(1);
  const MeshCache meshes = Balls(1);
  TexturedStream::Job job = Still("lambert");
  job.config.draw.samples = 1;
  TexturedStream stream(job, meshes, workers);
  std::vector<TexturedView> views(1);
  const auto copy = [](const auto& pictures) {
    return std::vector<float>(pictures->begin(), pictures->end());
  };
  const auto lit = copy(stream.Render(0, 3, 0, views));
  const auto texture = copy(stream.Again(0, Appearance::kTexture));
  const auto light = copy(stream.Again(0, Appearance::kLight));
  double brightest = 0, reddest = 0;
  for (std::size_t i = 0; i < 3 * kSize * kSize; ++i) {
    EXPECT_NEAR(lit[i], texture[i] * light[i], 1e-6);
    brightest = std::max(brightest, static_cast<double>(light[i]));
    reddest = std::max(reddest, static_cast<double>(texture[i]));
  }
  EXPECT_GT(brightest, 0.8);
  EXPECT_NEAR(reddest, 200.0 / 255, 0.01);
}

// Under harmonics, normals are smooth on a ball with creases of 60 degrees, and flat on one
// without.
TEST(TexturedStream, CreasesDecideWhatIsSmooth) {
  const Workers workers(1);
  Mesh smooth = Ball();
  SplitAtCreases(60, &smooth);
  EXPECT_EQ(smooth.positions.size(), Ball().positions.size());
  const MeshCache meshes(2, kRoom, [&](std::size_t i) -> Result<TexturedMesh> {
    return i == 0 ? TexturedMesh(Ball()) : TexturedMesh(smooth, NormalSource::kSmooth);
  });
  TexturedStream::Job job = Still("lambert");
  job.config.draw.samples = 1;
  TexturedStream stream(job, meshes, workers);
  std::vector<TexturedView> views(1);
  const auto normals = [&](int model) {
    EXPECT_TRUE(stream.Render(model, 3, 0, views).ok());
    const auto planes = stream.Again(0, Appearance::kNormals);
    std::set<std::array<float, 3>> different;
    constexpr std::size_t kPlane = std::size_t{kSize} * kSize;
    for (std::size_t p = 0; p < kPlane; ++p) {
      const std::array<float, 3> n = {(*planes)[p], (*planes)[kPlane + p],
                                      (*planes)[2 * kPlane + p]};
      const double length = std::hypot(n[0], n[1], n[2]);
      EXPECT_NEAR(length, (*planes)[3 * kPlane + p], 1e-5);  // 0 beside the ball
      different.insert(n);
    }
    return different.size();
  };
  const std::size_t flat = normals(0), round = normals(1);
  EXPECT_LT(flat, 162u);  // at most half of the 320 faces are seen
  EXPECT_GT(round, 1.3 * static_cast<double>(flat));
}

class TexturedMeshes : public TempFolderTest {
 protected:
  TexturedMeshes() {
    std::filesystem::create_directories(folder_ / "models" / "ball");
    for (const char* name : {"a", "b"})
      EXPECT_TRUE(
          io::SaveGlb(folder_ / "models" / "ball" / (std::string(name) + ".glb"), Ball()).ok());
    auto source = Ok(FolderSource(folder_ / "models"));
    BuildOptions options;
    options.image_size = 16;
    options.views = 2;
    Ok(BuildDataset(**source, options, folder_ / "data", workers_, {}).status());
  }
  Result<MeshCache> Load(const std::string& folder) {
    dataset_ = Ok(Dataset::Open(folder_ / "data")).value();
    return OpenTexturedMeshes(*dataset_, {1, 0}, {folder, 8}, workers_, {});
  }

  std::optional<Dataset> dataset_;
  Workers workers_{2};
};

TEST_F(TexturedMeshes, AreReadAgainFromTheirFolder) {
  const auto meshes = Ok(Load((folder_ / "models").string()));
  ASSERT_EQ(meshes->size(), 2u);
  const auto mesh = Ok(meshes->Get(0)).value();
  ASSERT_EQ(mesh->scene().textures.size(), 1u);
  EXPECT_EQ(mesh->scene().textures[0].width, 8);
  EXPECT_GT(mesh->bytes(), 1000u);
}

TEST_F(TexturedMeshes, WithoutAFolderColoursOfTheDatasetStandIn) {
  const auto meshes = Ok(Load(""));
  const auto mesh = Ok(meshes->Get(0)).value();
  EXPECT_TRUE(mesh->scene().textures.empty());
  EXPECT_FALSE(mesh->scene().colors.values.empty());
}

TEST_F(TexturedMeshes, ChangesSinceThenAreErrors) {
  Mesh box = Box(glm::vec3(0), glm::vec3(1));
  ASSERT_TRUE(io::SaveGlb(folder_ / "models" / "ball" / "a.glb", box).ok());
  ExpectMessage(Load((folder_ / "models").string()).status(), "ball/a", "has another shape");
  std::filesystem::remove(folder_ / "models" / "ball" / "a.glb");
  ExpectMessage(Load((folder_ / "models").string()).status(), "ball/a", "no longer exists");
}

}  // namespace tilegrad::train::textured_stream_test
