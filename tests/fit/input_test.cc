// SPDX-License-Identifier: Apache-2.0
// What a fit reads of other programs' projects.
#include "fit/input.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/text.h"
#include "fit/frames.h"
#include "fit/masks/start_masks.h"
#include "fit/quarter_turn.h"
#include "io/image_file.h"
#include "support/temp_folder.h"

namespace tilegrad::train::input_test {

constexpr const char* kPose = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]])";

// A cut-out of 8 x 6 pixels; the object is its first `columns`.
ImageU8 CutOut(int columns) {
  ImageU8 image(8, 6, 4, 77);
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 8; ++x) image.at(x, y)[3] = x < columns ? 255 : 0;
  return image;
}

// Ten frames of images/0.png to 9.png; `more` stands in the given one.
std::string TenFrames(int which, const std::string& more) {
  std::string frames;
  for (int i = 0; i < 10; ++i) {
    frames += std::string(i == 0 ? "" : ",") + R"({"file_path":"images/)" + std::to_string(i) +
              R"(.png",)" + (i == which ? more : "") + kPose + "}";
  }
  return R"({"fl_x":10,"frames":[)" + frames + "]}";
}

class Input : public TempFolderTest {
 protected:
  // 8 x 6 pixels of one grey.
  void Image(const std::string& name, int grey) {
    Ok(io::SavePng(folder_ / name, ImageU8(8, 6, 3, static_cast<std::uint8_t>(grey))));
  }
  // The left half is the object.
  void Mask(const std::string& name) {
    ImageU8 mask(8, 6, 1);
    for (int y = 0; y < 6; ++y) {
      for (int x = 0; x < 4; ++x) mask.at(x, y)[0] = 255;
    }
    ASSERT_TRUE(io::SavePng(folder_ / name, mask).ok());
  }
  // Cameras of images twice as large; the second image has no line of points.
  void Model(const std::string& folder) {
    Write(folder + "/cameras.txt", std::string("1 PINHOLE 16 12 20 22 9 5\n"));
    Write(folder + "/images.txt",
          std::string("1 0 1 0 0 0 0 4 1 a.png\n3.5 4.5 -1\n2 0 1 0 0 1 0 4 1 deep/b.png\n"));
  }
  // Of one frame, with further keys of the file and of the frame.
  void Transforms(const std::string& folder, const std::string& image, const std::string& keys,
                  const std::string& of_frame = "") {
    Write(folder + "/transforms.json",
          "{" + keys + R"("frames":[{"file_path":")" + image + "\"," + of_frame + kPose + "}]}");
  }
  void Images(const std::string& folder) {
    Image(folder + "/a.png", 51);
    Image(folder + "/deep/b.png", 102);
  }
  void ExpectTwoViews(const std::string& folder, bool masked) {
    const auto input = Ok(ReadFitFolder(folder_ / folder, 0));
    ASSERT_EQ(input->cameras.size(), 2u);
    const Camera& camera = input->cameras[1];
    EXPECT_EQ(camera.fx, 10);
    EXPECT_EQ(camera.fy, 11);
    EXPECT_EQ(camera.cx, 4.5f);
    EXPECT_EQ(camera.cy, 2.5f);
    EXPECT_EQ(camera.translation[0], 1);
    EXPECT_EQ(camera.translation[2], -4);
    EXPECT_NEAR(input->images.color[0], 0.2, 1e-6);
    EXPECT_NEAR(input->images.color[3 * 48], 0.4, 1e-6);
    EXPECT_EQ(input->masked, masked);
    EXPECT_EQ(input->images.alpha[48 + 3], 1);
    EXPECT_EQ(input->images.alpha[48 + 4], masked ? 0 : 1);
  }
};

TEST_F(Input, ColmapProjects) {
  Model("p/sparse/0");
  Images("p/images");
  ExpectTwoViews("p", false);
  ExpectTwoViews("p/sparse/0", false);
  Mask("p/masks/a.png.png");  // COLMAP's names
  ExpectMessage(ReadFitFolder(folder_ / "p", 0).status(), "b.png: has no mask", "a.png.png");
  Mask("p/masks/deep/b.png.png");
  ExpectTwoViews("p", true);
  EXPECT_EQ(ReadFitFolder(folder_ / "p", 2).value().held_out, std::vector<int>{1});
}

TEST_F(Input, ColmapModelsOfOtherLayouts) {
  Model("flat");
  Images("flat");
  Mask("mask/a.png");
  Mask("mask/deep/b.png");
  ExpectTwoViews("flat", true);
  Model("nerfstudio/colmap/sparse/0");
  Images("nerfstudio/images");
  ExpectTwoViews("nerfstudio", false);
  Model("undistorted/sparse");
  Images("undistorted/images");
  ExpectTwoViews("undistorted", false);
}

TEST_F(Input, ColmapImagesThatAreNotThere) {
  Model("p/sparse/0");
  ExpectMessage(ReadFitFolder(folder_ / "p", 0).status(), "a.png", "images");
  Image("p/images/a.png", 51);
  ExpectMessage(ReadFitFolder(folder_ / "p", 0).status(), "deep/b.png: no such file");
  std::filesystem::remove(folder_ / "p/images/a.png");
  Image("p/images/deep/b.png", 51);
  ExpectMessage(ReadFitFolder(folder_ / "p", 0).status(), "images/a.png: no such file");
  Write("p/sparse/0/cameras.txt", std::string("1 FOV 16 12 20 22 9 5 0.5\n"));
  ExpectMessage(ReadFitFolder(folder_ / "p", 0).status(), "cameras.txt: line 1", "undistort");
}

TEST_F(Input, ImagesThatTransformsNameAndThatAreNotThere) {
  Image("g/images/0.png", 51);
  Write("g/transforms.json", TenFrames(-1, ""));
  ExpectMessage(ReadFitFolder(folder_ / "g", 0).status(),
                "transforms.json: frame 1: ", "images/1.png: no such file");
  Transforms("g", "images/0.png", R"("fl_x":10,)", R"("mask_path":"masks/0.png",)");
  ExpectMessage(ReadFitFolder(folder_ / "g", 0).status(),
                "transforms.json: frame 0: ", "masks/0.png: no such file");
}

// As COLMAP projects and images alone have them.
TEST_F(Input, MasksBesideTheImagesOfTransforms) {
  Image("k/images/0.png", 51);
  Mask("k/masks/0.png");
  Transforms("k", "images/0.png", R"("fl_x":10,)");
  EXPECT_TRUE(ReadFitFolder(folder_ / "k", 0)->masked);
  // Where some are named, so must be the others.
  Image("k/images/1.png", 51);
  Mask("k/masks/1.png");
  Write("k/transforms.json", R"({"fl_x":10,"frames":[{"file_path":"images/0.png",)" +
                                 std::string(kPose) + R"(},{"file_path":"images/1.png",)" +
                                 R"("mask_path":"masks/1.png",)" + kPose + "}]}");
  ExpectMessage(ReadFitFolder(folder_ / "k", 0).status(), "0.png: has no mask");
  Image("k/train/0.png", 51);  // one of several folders with the same names
  Transforms("k", "train/0.png", R"("fl_x":10,)");
  EXPECT_FALSE(ReadFitFolder(folder_ / "k", {.background = Background::kMask})->masked);
}

TEST_F(Input, LargeImagesAreReduced) {
  Image("l/images/0.png", 51);
  Transforms("l", "images/0.png", R"("fl_x":10,"cx":4,"cy":2,)");
  Mask("l/mine/0.png");  // of the image as it is
  const InputOptions options{.masks = folder_ / "l/mine", .image_side = 7};
  const auto input = Ok(ReadFitFolder(folder_ / "l", options));
  EXPECT_EQ(input->images.width, 4);
  EXPECT_EQ(input->images.height, 3);
  EXPECT_EQ(input->cameras[0].fx, 5);
  EXPECT_EQ(input->cameras[0].cx, 2);
  EXPECT_EQ(input->cameras[0].cy, 1);
  for (std::size_t p = 0; p < 12; ++p) {
    EXPECT_NEAR(input->images.color[p], 0.2, 1e-6);
    EXPECT_EQ(input->images.alpha[p], p % 4 < 2 ? 1 : 0);
  }
  ExpectOnly(input->notes, "2 times smaller", "4 x 3 pixels");
  for (const int side : {8, 0})
    EXPECT_EQ(ReadFitFolder(folder_ / "l", {.image_side = side})->images.width, 8);
  // What is left over is cut off: 2 x 2 of 3 x 3 pixels, and of 8 x 6.
  const auto third = Ok(ReadFitFolder(folder_ / "l", {.image_side = 3}));
  EXPECT_EQ(third->images.width, 2);
  EXPECT_EQ(third->images.height, 2);
  EXPECT_NEAR(third->cameras[0].fx, 10.0 / 3, 1e-5);
  EXPECT_NEAR(third->cameras[0].cx, 4.0 / 3, 1e-5);
}

TEST_F(Input, ColmapCamerasThatAreNotThere) {
  Image("q/images/a.png", 51);
  Write("q/sparse/0/images.bin", std::string("x"));
  ExpectMessage(ReadFitFolder(folder_ / "q", 0).status(), "sparse/0/cameras.bin");
}

// Cameras that are upside down in COLMAP's world, as its first one is.
TEST_F(Input, AWorldThatColmapMadeIsTurnedLevel) {
  Model("p/colmap/sparse/0");
  Write("p/colmap/sparse/0/images.txt",
        std::string("1 1 0 0 0 0 0 4 1 a.png\n\n2 1 0 0 0 1 0 4 1 deep/b.png\n\n"));
  Images("p/images");
  const FitInput given = ReadFitFolder(folder_ / "p", 0).value();
  Write("p/colmap/pictures.txt", std::string("a.png\n"));
  const FitInput turned = ReadFitFolder(folder_ / "p", 0).value();
  for (std::size_t v = 0; v < 2; ++v) {
    EXPECT_EQ(given.cameras[v].rotation[4], -1);
    EXPECT_NEAR(turned.cameras[v].rotation[4], 1, 1e-5);
    for (int i = 0; i < 3; ++i)
      EXPECT_EQ(turned.cameras[v].translation[i], given.cameras[v].translation[i]);
  }
  InputOptions as_it_is;
  as_it_is.up = UpAxis::kY;
  EXPECT_EQ(ReadFitFolder(folder_ / "p", as_it_is)->cameras[0].rotation[4],
            given.cameras[0].rotation[4]);
}

TEST_F(Input, TransformsOfWindows) {
  Image("w/images/0.png", 51);
  Mask("w/masks/0.png");
  for (const std::string path : {R"(images\\0.png)", R"(.\\images\\0.png)", R"(images\\0)"}) {
    Transforms("w", path, R"("fl_x":10,)", R"("mask_path":"masks\\0.png",)");
    const auto input = Ok(ReadFitFolder(folder_ / "w", 0));
    EXPECT_TRUE(input->masked);
  }
  Image("w/odd\\name.png", 51);  // a name that has one is found as it is
  Transforms("w", R"(odd\\name.png)", R"("fl_x":10,)");
  EXPECT_TRUE(ReadFitFolder(folder_ / "w", 0).ok());
}

TEST_F(Input, TransformsOfOtherLenses) {
  Image("f/0.png", 51);
  const std::string image = R"("file_path":"0.png",)" + std::string(kPose);
  for (const std::string lens :
       {R"("camera_model":"EQUIRECTANGULAR")", R"("orthographic":true)", R"("k4":0.1)",
        R"("camera_model":"OPENCV_FISHEYE","p1":0.1)", R"("k1":"wide")"}) {
    Transforms("f", "0.png", R"("fl_x":10,)" + lens + ",");
    ExpectMessage(ReadFitFolder(folder_ / "f", 0).status(), "transforms.json: frame 0",
                  "undistort");
    Write("f/transforms.json",
          R"({"fl_x":10,"frames":[{)" + image + "},{" + lens + "," + image + "}]}");
    ExpectMessage(ReadFitFolder(folder_ / "f", 0).status(), "transforms.json: frame 1",
                  "undistort");
  }
}

// What a frame says goes before what the file says, 0 is a number, null is nothing.
TEST_F(Input, TransformsSayWhatTheySay) {
  Image("t/0.png", 51);
  const auto camera = [&](const std::string& file, const std::string& frame) {
    Transforms("t", "0.png", file, frame);
    const auto input = ReadFitFolder(folder_ / "t", 0);
    EXPECT_TRUE(input.ok()) << input.status().message();
    return input.ok() ? input->cameras[0] : Camera();
  };
  Camera c = camera(R"("fl_x":10,"cx":0,"cy":0.0,)", "");
  EXPECT_EQ(c.cx, 0);
  EXPECT_EQ(c.cy, 0);
  c = camera(R"("fl_x":10,"cx":null,"cy":null,"w":null,"h":null,"fl_y":null,"k1":null,)",
             R"("mask_path":null,)");
  EXPECT_EQ(c.cx, 4);
  EXPECT_EQ(c.cy, 3);
  EXPECT_EQ(c.fy, 10);
  c = camera(R"("fl_x":10,"fl_y":12,"cx":1,)", R"("camera_angle_x":1.5707963267948966,"cx":2,)");
  EXPECT_NEAR(c.fx, 4, 1e-6);  // half of 8 pixels at 45 degrees
  EXPECT_NEAR(c.fy, 4, 1e-6);
  EXPECT_EQ(c.cx, 2);
  c = camera(R"("camera_angle_x":0.7,)", R"("fl_x":null,"fl_y":20,)");
  EXPECT_EQ(c.fx, 20);
  c = camera(R"("fl_x":10,"fl_y":12,)", R"("camera_angle_x":null,)");
  EXPECT_EQ(c.fy, 12);
  Transforms("t", "0.png", R"("fl_x":0,)");
  ExpectMessage(ReadFitFolder(folder_ / "t", 0).status(), "0.png", "focal lengths are 0");
}

TEST_F(Input, ColmapCamerasThatNoImageUsesMayBeOfAnyKind) {
  Model("p/sparse/0");
  Images("p/images");
  const std::string used = ReadText(folder_ / "p/sparse/0/cameras.txt").value();
  Write("p/sparse/0/cameras.txt", used + "2 FOV 16 12 20 22 9 5 0.5\n3 NEVER_HEARD_OF 1 2 3\n" +
                                      "4 THIN_PRISM_FISHEYE 4 4 1 1 1 1 0 0 0 0 0 0 0 0\n");
  ExpectTwoViews("p", false);
  Write("p/sparse/0/cameras.txt", std::string("1 NEVER_HEARD_OF 1 2 3\n"));
  ExpectMessage(ReadFitFolder(folder_ / "p", 0).status(), "cameras.txt: line 1", "NEVER_HEARD_OF");
}

TEST_F(Input, IsTurnedAsUpSays) {
  Model("u/sparse/0");
  Images("u/images");
  const auto given = Ok(ReadFitFolder(folder_ / "u", {.up = UpAxis::kY}));
  const auto turned = Ok(ReadFitFolder(folder_ / "u", {.up = UpAxis::kZ}));
  const Camera expected = UprightCamera(UpAxis::kZ, given->cameras[1]);
  EXPECT_TRUE(std::ranges::equal(turned->cameras[1].rotation, expected.rotation));
  EXPECT_FALSE(std::ranges::equal(turned->cameras[1].rotation, given->cameras[1].rotation));
}

TEST_F(Input, EitherAllViewsHaveAMaskOrNone) {
  for (int i = 0; i < 10; ++i) {
    const ImageU8 image = i == 7 ? ImageU8(8, 6, 3, 77) : CutOut(4);
    ASSERT_TRUE(io::SavePng(folder_ / "m/images" / (std::to_string(i) + ".png"), image).ok());
  }
  Write("m/transforms.json", TenFrames(-1, ""));
  ExpectMessage(ReadFitFolder(folder_ / "m", 0).status(), "images/7.png: has no mask",
                "images/0.png has one (its alpha channel)");
  EXPECT_TRUE(ReadFitFolder(folder_ / "m", {.background = Background::kNone}).ok());
  Mask("m/seven.png");
  Write("m/transforms.json", TenFrames(7, R"("mask_path":"seven.png",)"));
  const auto input = Ok(ReadFitFolder(folder_ / "m", 0));
  EXPECT_TRUE(input->warnings.empty());
  // Bare pictures, and those of a test file, go the same way.
  std::filesystem::remove(folder_ / "m/transforms.json");
  ExpectMessage(ReadFitFolder(folder_ / "m", 0).status(), "images/7.png: has no mask");
  Transforms("m", "images/0.png", R"("fl_x":10,)");
  Write("m/transforms_test.json",
        R"({"fl_x":10,"frames":[{"file_path":"images/7.png",)" + std::string(kPose) + "}]}");
  ExpectMessage(ReadFitFolder(folder_ / "m", 0).status(), "images/7.png: has no mask");
  // An alpha that is 1 everywhere may be right.
  ASSERT_TRUE(io::SavePng(folder_ / "m/images/7.png", CutOut(8)).ok());
  const auto full = ReadFitFolder(folder_ / "m", 0);
  ExpectOnly(full->warnings, "7.png: its mask is full");
}

TEST_F(Input, FramesOfTheTestFileAreNotFitted) {
  for (int i = 0; i < 10; ++i) Image("t/images/" + std::to_string(i) + ".png", 51);
  Write("t/transforms.json", TenFrames(-1, ""));
  Write("t/transforms_test.json",
        R"({"fl_x":10,"frames":[{"file_path":"images/7.png",)" + std::string(kPose) + "}]}");
  const auto input = Ok(ReadFitFolder(folder_ / "t", 0));
  EXPECT_EQ(input->names.size(), 10u);
  EXPECT_EQ(input->names[9], "7.png");
  EXPECT_EQ(input->held_out, std::vector<int>{9});
  ExpectOnly(input->warnings, "transforms_test.json", "1 image");
}

TEST_F(Input, ImagesOfSeveralSizesAreRefused) {
  for (int i = 0; i < 10; ++i) Image("z/images/" + std::to_string(i) + ".png", 51);
  Ok(io::SavePng(folder_ / "z/images/4.png", ImageU8(6, 7, 3, 51)));
  Write("z/transforms.json", TenFrames(-1, ""));
  ExpectMessage(ReadFitFolder(folder_ / "z", 0).status(), "4.png: has 6 x 7 pixels",
                "0.png has 8 x 6", "crop or resize");
}

TEST_F(Input, PortraitsAmongLandscapesAreRotatedWithTheirCameras) {
  for (int i = 0; i < 10; ++i)
    Ok(io::SavePng(folder_ / "a/images" / (std::to_string(i) + ".png"), CutOut(4)));
  ImageU8 across(6, 8, 4, 255);
  for (std::size_t p = 24; p < 48; ++p)
    across.pixels[4 * p + 3] = 0;  // the upper half is the object
  across.at(1, 2)[0] = 0;
  Ok(io::SavePng(folder_ / "a/images/4.png", across));
  Write("a/transforms.json", TenFrames(4, R"("fl_x":10,"fl_y":11,"cx":2,"cy":3,)"));
  auto input = Ok(ReadFitFolder(folder_ / "a", 0));
  EXPECT_EQ(input->turned, std::vector<int>{4});
  const float* const red = &input->images.color[3 * 4 * 48];
  EXPECT_EQ(std::find(red, red + 48, 0.0f) - red, 8 + 5);
  EXPECT_EQ(input->images.alpha[4 * 48 + 3], 0);
  EXPECT_EQ(input->images.alpha[4 * 48 + 4], 1);
  const Camera& camera = input->cameras[4];
  EXPECT_EQ(camera.fx, 11);
  EXPECT_EQ(camera.cx, 5);
  EXPECT_EQ(camera.cy, 2);
  EXPECT_EQ(camera.rotation[1], 1);  // what was up is to the right
  const Camera held = HeldCameras(*input, input->cameras)[4];
  EXPECT_EQ(held.fx, 10);
  EXPECT_EQ(held.cx, 2);
  EXPECT_EQ(held.cy, 3);
  EXPECT_EQ(held.rotation[0], 1);
  // Masks are written as images are, and read back.
  const auto alpha = input->images.alpha;
  Ok(WriteMasks(folder_ / "masks", *input));
  EXPECT_EQ(Ok(io::LoadImage(folder_ / "masks/4.png.png"))->height, 8);
  std::ranges::fill(input->images.alpha, 0.5f);
  Ok(ReadMasks(folder_ / "masks", &*input));
  EXPECT_EQ(input->images.alpha, alpha);
}

TEST_F(Input, CamerasOfImagesOfAnotherShapeAreRefused) {
  Image("s/a.png", 51);
  Transforms("s", "a.png", R"("fl_x":10,"w":40,"h":10,)");
  ExpectMessage(ReadFitFolder(folder_ / "s", 0).status(), "a.png", "40 x 10", "8 x 6");
  Transforms("s", "a.png", R"("fl_x":10,"w":33,"h":25,)");
  EXPECT_TRUE(ReadFitFolder(folder_ / "s", 0).ok());
}

TEST_F(Input, ViewsThatShowNothingAreNamedAndLeftOut) {
  for (int i = 0; i < 10; ++i) {
    const ImageU8 image = CutOut(i == 2 || i == 3 ? 0 : i == 9 ? 5 : 4);
    ASSERT_TRUE(io::SavePng(folder_ / "e/images" / (std::to_string(i) + ".png"), image).ok());
  }
  Write("e/transforms.json", TenFrames(-1, ""));
  const auto input = Ok(ReadFitFolder(folder_ / "e", 4));  // views 3 and 7 are held out
  EXPECT_EQ(input->names, (std::vector<std::string>{"0.png", "1.png", "4.png", "5.png", "6.png",
                                                    "7.png", "8.png", "9.png"}));
  EXPECT_EQ(input->held_out, std::vector<int>{5});
  EXPECT_EQ(input->training, (std::vector<int>{0, 1, 2, 3, 4, 6, 7}));
  EXPECT_EQ(input->cameras.size(), 8u);
  EXPECT_EQ(input->images.alpha.size(), 8u * 48);
  EXPECT_EQ(input->images.alpha[7 * 48 + 4], 1);
  EXPECT_EQ(input->images.color.size(), 3u * 8 * 48);
  ASSERT_EQ(input->warnings.size(), 2u);
  ExpectIn(input->warnings[0], "2.png: its mask is empty");
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(io::SavePng(folder_ / "e/images" / (std::to_string(i) + ".png"), CutOut(0)).ok());
  }
  ExpectMessage(ReadFitFolder(folder_ / "e", 0).status(), "all masks are empty");
  // Of programs that write 1 for white.
  ASSERT_TRUE(io::SavePng(folder_ / "e/ones.png", ImageU8(8, 6, 1, 1)).ok());
  Transforms("e", "images/0.png", R"("fl_x":10,)", R"("mask_path":"ones.png",)");
  ExpectMessage(ReadFitFolder(folder_ / "e", 0).status(), "must be white, 255", "more than 1");
}

TEST_F(Input, BarePicturesThatAreNotReadAreNamed) {
  Image("b/0.png", 51);
  Image("b/1.PNG", 51);
  Write("b/notes.txt", std::string("mine"));
  Write("b/._0.png", std::string("of macOS"));
  EXPECT_TRUE(Ok(ReadFitFolder(folder_ / "b", 0))->warnings.empty());
  std::filesystem::remove(folder_ / "b/._0.png");
  for (const char* name : {"b/2.heic", "b/3.TIF", "b/4.bmp"}) Write(name, std::string("x"));
  const auto input = Ok(ReadFitFolder(folder_ / "b", 0));
  EXPECT_EQ(input->names.size(), 2u);
  ExpectOnly(input->warnings, "left out 3 pictures", "2.heic, 3.TIF, 4.bmp");
  std::filesystem::remove(folder_ / "b/0.png");
  std::filesystem::remove(folder_ / "b/1.PNG");
  ExpectMessage(ReadFitFolder(folder_ / "b", 0).status(), "no pictures", "2.heic");
  std::filesystem::create_directories(folder_ / "c");
  std::filesystem::rename(folder_ / "b", folder_ / "c/images");
  ExpectMessage(ReadFitFolder(folder_ / "c", 0).status(), "no pictures", "c/images", "2.heic");
}

// A disk from before UTF-8, in all that names files.
TEST_F(Input, NamesNeedNotBeUtf8) {
  const std::string name = "caf\xe9.png";
  Image("n/images/" + name, 51);
  const auto bare = Ok(ReadFitFolder(folder_ / "n", 0));
  EXPECT_EQ(bare->names[0], name);
  Write("n/sparse/0/cameras.txt", std::string("1 PINHOLE 16 12 20 22 9 5\n"));
  Write("n/sparse/0/images.txt", "1 0 1 0 0 0 0 4 1 " + name + "\n\n");
  const auto colmap = Ok(ReadFitFolder(folder_ / "n", 0));
  // What a fit writes is JSON, and names the same file.
  const std::string text = WriteTransforms({{"images/" + name, colmap->cameras[0]}}, {8, 6});
  EXPECT_TRUE(IsUtf8(text));
  Write("n/transforms.json", text);
  const auto frames = Ok(ReadTransforms(folder_ / "n/transforms.json"));
  EXPECT_EQ(frames->at(0).image, folder_ / "n/images" / name);
  EXPECT_TRUE(ReadFitFolder(folder_ / "n", 0).ok());
}

}  // namespace tilegrad::train::input_test
