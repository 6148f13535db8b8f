// SPDX-License-Identifier: Apache-2.0
// Miniatures of ShapeNetCore in the layouts of its two versions, through the whole program.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "io/image_file.h"
#include "io/npz.h"
#include "support/run_program.h"

namespace tilegrad::shapenet_test {

constexpr int kSize = 16, kViews = 24;

struct Layout {
  const char *folder, *file, *images;  // of the model; from its folder; from the file's
  // The views from the file's +x, -x, +z and -z. Cameras stand at azimuth -15 i: 0 is +x, 90 is
  // +z, where models of datasets face.
  int red, green, white, blue;
  std::size_t longest;  // axis of the dataset, of the file's z
};
constexpr Layout kV1 = {"", "model", "./images", 18, 6, 12, 0, 0};                     // faces +x
constexpr Layout kV2 = {"models/", "model_normalized", "../images", 12, 0, 6, 18, 2};  // faces -z

class ShapeNetTest : public ProgramTest {
 protected:
  // A box of 2 x 2 x 6, far from the origin, one of whose texture's quarters is on each pair of
  // sides: +x red, -x green, all others blue, and +z white.
  void WriteModel(const Layout& layout, const std::string& model, float height = 2) const {
    std::string obj = fmt::format("mtllib {}.mtl\nusemtl painted\n", layout.file);
    for (int v = 0; v < 8; ++v)
      obj += fmt::format("v {} {} {}\n", v & 1 ? 11 : 9, v & 2 ? height : 0, v & 4 ? 6 : 0);
    obj += "vt 0.25 0.75\nvt 0.75 0.75\nvt 0.25 0.25\nvt 0.75 0.25\n";  // red green blue white
    const auto side = [&](int a, int b, int c, int d, int color) {
      obj += fmt::format("f {0}/{4} {1}/{4} {2}/{4} {3}/{4}\n", a, b, c, d, color);
    };
    side(2, 4, 8, 6, 1);
    side(1, 5, 7, 3, 2);
    side(1, 2, 6, 5, 3);
    side(3, 7, 8, 4, 3);
    side(1, 3, 4, 2, 3);
    side(5, 6, 8, 7, 4);
    Write(model + "/" + layout.folder + layout.file + ".obj", obj);
    Write(model + "/" + layout.folder + layout.file + ".mtl",
          fmt::format("newmtl painted\nKd 0 0 0\nmap_Kd {}/texture0.png\n", layout.images));
    Ok(io::SavePng(folder_ / model / "images/texture0.png", Texture()));
  }
  static ImageU8 Texture() {
    constexpr std::uint8_t kColors[4][3] = {{200, 0, 0}, {0, 200, 0}, {0, 0, 200}, {200, 200, 200}};
    ImageU8 image(8, 8, 3);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) std::copy_n(kColors[y / 4 * 2 + x / 4], 3, image.at(x, y));
    }
    return image;
  }
  // Two classes of six models, an empty one, and what archives have beside them.
  void WriteSet(const Layout& layout) const {
    for (const char* synset : {"02958343", "03001627"}) {
      for (int m = 0; m < 6; ++m)
        WriteModel(layout, fmt::format("net/{}/{}{}", synset, synset[1], m), 1.5f + 0.1f * m);
    }
    Write("net/02958343.csv", "fullId\n");
    Write("net/taxonomy.json", "[]\n");
    std::filesystem::create_directories(folder_ / "net/04256520");
  }
  std::string Dataset(const std::string& options = "") const {
    return "dataset --source shapenet --input " + In("net") + " --out " + In("data") +
           fmt::format(" --size {} --views {} ", kSize, kViews) + options;
  }
  void TrainAndEval(const std::string& settings) const {
    ExpectDone("train --config texture_quick --data " + In("data") + " --out " + In("run") +
               " --set schedule.steps=20 --set schedule.batch=4 --set schedule.portions=2 --set "
               "network.base=4 --set "
               "network.most=8 --set network.levels=2 --set network.latent=12 --set "
               "network.hidden=12 --set network.light_width=8 --set network.lookup_width=4 " +
               settings);
    ExpectIn(ExpectDone("eval --run " + In("run")), "Carved IoU");
  }
  // The mean colour of what is covered in one view of a model; shares of the covered brightness.
  std::array<double, 3> ColorOf(const std::string& model, int view) const {
    const auto images =
        Ok(io::LoadNpzArray(folder_ / "data/models" / model, "images"))->As<std::uint8_t>().value();
    std::array<double, 3> sum = {};
    constexpr std::size_t kPlane = kSize * kSize;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t p = 0; p < kPlane; ++p)
        sum[c] += images[(static_cast<std::size_t>(view) * 4 + c) * kPlane + p];
    }
    const double all = sum[0] + sum[1] + sum[2];
    return {sum[0] / all, sum[1] / all, sum[2] / all};
  }
  // From above, the blue top is seen, too.
  void ExpectAxes(const Layout& layout, const std::string& model) const {
    EXPECT_GT(ColorOf(model, layout.red)[0], 0.5);
    EXPECT_GT(ColorOf(model, layout.green)[1], 0.5);
    EXPECT_GT(ColorOf(model, layout.blue)[2], 0.95);
    EXPECT_GT(ColorOf(model, layout.white)[0], 0.1);
    EXPECT_NEAR(ColorOf(model, layout.white)[0], ColorOf(model, layout.white)[1], 0.02);
  }
  // Of the mesh for reports: the longest half axis is 0.45, and it is centred.
  void ExpectScale(const Layout& layout, const std::string& model) const {
    const auto positions = Ok(io::LoadNpzArray(folder_ / "data/models" / model, "mesh_positions"))
                               ->As<float>()
                               .value();
    float low = 1, high = -1, widest = 0;
    for (std::size_t i = 0; i < positions.size(); i += 3) {
      widest = std::max(widest, std::abs(positions[i + 2 - layout.longest]));
      low = std::min(low, positions[i + layout.longest]);
      high = std::max(high, positions[i + layout.longest]);
    }
    EXPECT_NEAR(low, -0.45, 1e-5);
    EXPECT_NEAR(high, 0.45, 1e-5);
    EXPECT_NEAR(widest, 0.15, 1e-5);
  }
  void CheckLayout(const Layout& layout) const {
    WriteSet(layout);
    ExpectIn(ExpectDone(Dataset()), "12 models", "04256520: holds no model");
    for (const std::string model : {"car/20.npz", "chair/35.npz"}) {
      ExpectAxes(layout, model);
      ExpectScale(layout, model);
    }
    TrainAndEval("");  // from where dataset.json says
  }
};

TEST_F(ShapeNetTest, VersionOne) { CheckLayout(kV1); }
TEST_F(ShapeNetTest, VersionTwo) { CheckLayout(kV2); }

TEST_F(ShapeNetTest, ClassesByNameOrNumber) {
  WriteSet(kV2);
  ExpectIn(ExpectDone(Dataset("--classes 03001627")), "6 models");
  EXPECT_FALSE(Exists("data/models/car"));
  ExpectError(Dataset("--classes chair,boat"), "\"boat\"", "car, chair");
}

TEST_F(ShapeNetTest, BrokenModelsCostThemselves) {
  WriteSet(kV2);
  const std::string car = "net/02958343/", obj = "/models/model_normalized.obj";
  Write(car + "20" + obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  Write(car + "21" + obj, "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  std::filesystem::remove(folder_ / (car + "22" + obj));
  std::filesystem::remove(folder_ / (car + "23/images/texture0.png"));
  const Path picture = folder_ / (car + "24/images/texture0.png");
  std::filesystem::resize_file(picture, std::filesystem::file_size(picture) / 2);
  std::filesystem::remove(folder_ / (car + "25/models/model_normalized.mtl"));
  ExpectRefused(Dataset(), 2, "6 of 12", "--allow-broken", "car/20");
  ExpectIn(ExpectDone(Dataset("--allow-broken --force")), "6 models", "6 models could not be used",
           "(car/20)", "(car/21)", "(car/22)", "no such texture (car/23)", "(car/24)",
           "no such material library (car/25)");
  EXPECT_FALSE(Exists("data/models/car"));
  TrainAndEval("--set stream.cache=10K");
}

}  // namespace tilegrad::shapenet_test
