// SPDX-License-Identifier: Apache-2.0
#include "io/camera_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "support/temp_folder.h"

namespace tilegrad::camera_file_test {

using io::CameraView;

class CameraFiles : public TempFolderTest {
 protected:
  std::vector<CameraView> Views() {
    std::vector<CameraView> views;
    for (int i = 0; i < 3; ++i) {
      Camera64 c = CameraCast<double>(OrbitCamera({}, 100.0 * i, 20, 2));
      c.fx = 500.25 + i;
      c.fy = 400.5;
      c.cx = 300.75;
      c.cy = 200.125;
      views.push_back({"image " + std::to_string(i) + ".png", c, {640, 480 + i}});
    }
    return views;
  }
  // Files hold the shortest decimals that give the same doubles. What is left: the conversion,
  // through a quaternion for COLMAP, of a rotation that is one to a float's 1e-7.
  void ExpectSame(const Result<std::vector<CameraView>>& got, double tolerance) {
    ASSERT_TRUE(got.ok()) << got.status().message();
    const auto expected = Views();
    ASSERT_EQ(got->size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const CameraView &a = (*got)[i], &b = expected[i];
      EXPECT_EQ(a.name, b.name);
      EXPECT_EQ(a.size.width, b.size.width);
      EXPECT_EQ(a.size.height, b.size.height);
      for (int k = 0; k < 9; ++k)
        EXPECT_NEAR(a.camera.rotation[k], b.camera.rotation[k], tolerance);
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(a.camera.translation[k], b.camera.translation[k], 2 * tolerance);
      EXPECT_EQ(a.camera.fx, b.camera.fx);
      EXPECT_EQ(a.camera.cy, b.camera.cy);
    }
  }
  void ExpectRefused(const std::string& name, const std::string& text, const std::string& part) {
    const auto got = io::LoadCameras(Write(name, text), {});
    ASSERT_FALSE(got.ok()) << text;
    ExpectMessage(got.status(), name, part);
  }
};

TEST_F(CameraFiles, RoundTrips) {
  ASSERT_TRUE(io::SaveNerfCameras(folder_ / "transforms.json", Views()).ok());
  ExpectSame(io::LoadCameras(folder_ / "transforms.json", {}), 1e-6);
  ASSERT_TRUE(io::SaveOpenCvCameras(folder_ / "cv.json", Views()).ok());
  ExpectSame(io::LoadCameras(folder_ / "cv.json", {}), 1e-15);
  ASSERT_TRUE(io::SaveColmapCameras(folder_, Views()).ok());
  ExpectSame(io::LoadCameras(folder_, {}), 1e-6);
}

template <class... T>
void Put(std::string* out, const T&... values) {
  const auto put = [&](const auto& v) {
    out->append(reinterpret_cast<const char*>(&v), sizeof(v));
  };
  (put(values), ...);
}

std::string BinaryCameras() {
  std::string out;
  Put(&out, std::uint64_t{1}, std::uint32_t{7}, std::int32_t{1}, std::uint64_t{640},
      std::uint64_t{480}, 500.0, 510.0, 320.0, 240.0);
  return out;
}
std::string BinaryImages() {
  std::string out;
  Put(&out, std::uint64_t{1}, std::uint32_t{3}, 1.0, 0.0, 0.0, 0.0, 0.5, 0.25, 4.0,
      std::uint32_t{7});
  out += std::string("a.jpg", 6);
  Put(&out, std::uint64_t{2}, std::array<double, 6>{});
  return out;
}

TEST_F(CameraFiles, ColmapBinary) {
  Write("cameras.bin", BinaryCameras());
  Write("images.bin", BinaryImages());
  const auto got = Ok(io::LoadColmapCameras(folder_));
  ASSERT_EQ(got->size(), 1u);
  const CameraView& view = got->front();
  EXPECT_EQ(view.name, "a.jpg");
  EXPECT_EQ(view.size.width, 640);
  EXPECT_EQ(view.camera.fy, 510);
  EXPECT_EQ(view.camera.cx, 320);  // centres at +0.5, as here
  EXPECT_EQ(view.camera.translation[1], -0.25);
  EXPECT_EQ(view.camera.rotation[8], -1);
  for (const auto& [name, whole] :
       {std::pair("cameras.bin", BinaryCameras()), std::pair("images.bin", BinaryImages())}) {
    ExpectCutsRefused(Bytes(whole.begin(), whole.end()), "", [&, name = name](const Bytes& cut) {
      Write(name, cut);
      return io::LoadColmapCameras(folder_).status();
    });
    Write(name, whole);
  }
}

// Of two points, seen by one image and by none.
TEST_F(CameraFiles, ColmapPointsHaveAMeanError) {
  EXPECT_FALSE(io::ColmapPointError(folder_).has_value());
  std::string points;
  Put(&points, std::uint64_t{2}, std::uint64_t{5}, std::array<double, 3>{1, 2, 3},
      std::array<std::uint8_t, 3>{9, 9, 9}, 0.25, std::uint64_t{1}, std::uint32_t{3},
      std::uint32_t{0});
  Put(&points, std::uint64_t{8}, std::array<double, 3>{}, std::array<std::uint8_t, 3>{}, 0.75,
      std::uint64_t{0});
  Write("points3D.bin", points);
  EXPECT_EQ(io::ColmapPointError(folder_), 0.5);
  Write("points3D.bin", points.substr(0, points.size() - 1));
  EXPECT_FALSE(io::ColmapPointError(folder_).has_value());
}

TEST_F(CameraFiles, BrokenColmapText) {
  const auto refused = [&](const std::string& cameras, const std::string& images,
                           const std::string& part) {
    Write("cameras.txt", cameras);
    Write("images.txt", images);
    ExpectMessage(io::LoadColmapCameras(folder_).status(), part);
  };
  const std::string good = "1 PINHOLE 640 480 500 500 320 240\n", pose = "1 1 0 0 0 0 0 1 ";
  refused("1 PINHOLE 640 480 500\n", "", "cameras.txt: line 1");
  refused("# head\n1 THIN_PRISM_FISHEYE 4 4\n", "", "line 2");
  refused("1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n", pose + "1 a.png\n\n", "undistort");
  refused("1 PINHOLE 0 480 500 500 320 240\n", pose + "1 a.png\n\n", "0 x 480");
  refused(good, "", "no images");
  refused(good, pose + "2 a.png\n\n", "camera 2");
  refused(good, "1 0 0 0 0 0 0 1 1 a.png\n\n", "quaternion");
  refused(good, "1 1 0 0\n", "images.txt: line 1");
  Write("images.txt", pose + "1 my image.png\n\n");
  EXPECT_EQ(io::LoadColmapCameras(folder_).value()[0].name, "my image.png");
  EXPECT_FALSE(io::LoadColmapCameras(folder_ / "none").ok());
}

// With a line of points after each image, without, and with it for some.
TEST_F(CameraFiles, ColmapImagesWithoutPoints) {
  Write("cameras.txt", std::string("1 PINHOLE 640 480 500 500 320 240\n"));
  const std::string a = "1 1 0 0 0 0 0 0 1 a.png\n", b = "2 1 0 0 0 1 0 0 1 b c.png\n",
                    c = "3 1 0 0 0 2 0 0 1 0003\n", points = "1.5 2.5 -1 3 4 17\n";
  for (const std::string& text :
       {a + "\n" + b + "\n" + c + "\n", a + b + c, a + points + b + points + c + points,
        a + b + points + c, a + points + b + c, "# head\n" + a + "# aside\n" + b + "\n" + c,
        "\n\n" + a + "\n\n" + b + points + "\n" + c, a + "\r\n" + b + "  \n" + c}) {
    Write("images.txt", text);
    const auto got = io::LoadColmapCameras(folder_);
    ASSERT_TRUE(got.ok()) << text << got.status().message();
    ASSERT_EQ(got->size(), 3u) << text;
    EXPECT_EQ((*got)[1].name, "b c.png");
    EXPECT_EQ((*got)[2].name, "0003");
    EXPECT_EQ((*got)[2].camera.translation[0], 2);
  }
  Write("images.txt", a + "1.5 2.5\n" + b);
  ExpectMessage(io::LoadColmapCameras(folder_).status(), "images.txt: line 2", "CAMERA_ID NAME");
  Write("images.txt", a + "\n2 1 0 0 0 1 0 0 1\n");
  ExpectMessage(io::LoadColmapCameras(folder_).status(), "images.txt: line 3", "NAME");
}

// Where COLMAP and what calls it put models; the outermost one counts.
TEST_F(CameraFiles, ColmapProjects) {
  const std::string images = "1 1 0 0 0 0 0 0 1 a.png\n\n";
  int width = 700;
  for (const std::string place :
       {"colmap/sparse", "colmap/sparse/0", "colmap", "sparse", "sparse/0", "."}) {
    Write(place + "/images.txt", images);
    Write(place + "/cameras.txt", fmt::format("1 SIMPLE_PINHOLE {} 480 500 320 240\n", ++width));
    const auto got = Ok(io::LoadCameras(folder_, {}));
    EXPECT_EQ(got->at(0).size.width, width) << place;
  }
  std::filesystem::create_directories(folder_ / "empty");
  ExpectMessage(io::LoadCameras(folder_ / "empty", {}).status(), "empty", "cameras.txt", "sparse");
}

constexpr const char* kPose = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]])";

TEST_F(CameraFiles, LensesThatBendRays) {
  const std::string head = R"({"w":4,"h":4,"fl_x":3,)", frame = std::string("{") + kPose + "}";
  for (const std::string lens :
       {R"("camera_model":"OPENCV_FISHEYE","k1":0)", R"("camera_model":"opencv_fisheye")",
        R"("camera_model":"EQUIRECTANGULAR")", R"("camera_model":"VR180_L")",
        R"("camera_model":"FISHEYE624")", R"("camera_model":5)", R"("is_fisheye":true)",
        R"("equirectangular":1)", R"("k1":0.1)", R"("k4":-1e-9)", R"("p2":"a")", R"("k6":1)"}) {
    ExpectRefused("a.json", head + lens + R"(,"frames":[)" + frame + "]}", "undistort");
    // In one frame only.
    const std::string bent = std::string("{") + lens + "," + kPose + "}";
    ExpectRefused("a.json", head + R"("frames":[)" + frame + "," + bent + "]}", "frame 1");
  }
  for (const std::string lens :
       {R"("camera_model":"PINHOLE")", R"("camera_model":"OPENCV","k1":0,"k2":0.0,"p1":0)",
        R"("camera_model":"SIMPLE_PINHOLE")", R"("camera_model":null)", R"("is_fisheye":false)",
        R"("camera_model":"perspective")"}) {
    const auto got =
        io::LoadCameras(Write("a.json", head + lens + R"(,"frames":[)" + frame + "]}"), {});
    EXPECT_TRUE(got.ok()) << lens << got.status().message();
  }
  // A frame's own word counts.
  EXPECT_TRUE(io::LoadCameras(Write("a.json", head + R"("is_fisheye":true,"frames":[{)" +
                                                  R"("is_fisheye":false,)" + kPose + "}]}"),
                              {})
                  .ok());
}

// Kept for who undistorts the images (tilegrad fit), in OpenCV's order.
TEST_F(CameraFiles, ColmapLensesAreGivenToWhoAsks) {
  using Model = LensDistortion::Model;
  const auto lens = [&](const std::string& camera) {
    Write("cameras.txt", "1 " + camera + "\n");
    Write("images.txt", std::string("1 1 0 0 0 0 0 1 1 a.png\n\n"));
    const auto got = io::LoadColmapCameras(folder_, {.bent = true});
    EXPECT_TRUE(got.ok()) << got.status().message();
    return got.ok() ? got->at(0).lens : LensDistortion();
  };
  using K = std::array<double, 8>;
  EXPECT_TRUE(lens("SIMPLE_RADIAL 640 480 500 320 240 0").straight());
  EXPECT_EQ(lens("SIMPLE_RADIAL 640 480 500 320 240 0.1").k, (K{0.1}));
  EXPECT_EQ(lens("RADIAL 640 480 500 320 240 0.1 0.2").k, (K{0.1, 0.2}));
  const LensDistortion brown = lens("FULL_OPENCV 640 480 500 510 320 240 1 2 3 4 5 6 7 8");
  EXPECT_EQ(brown.model, Model::kBrown);
  EXPECT_EQ(brown.k, (K{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(lens("OPENCV 640 480 500 510 320 240 1 2 3 4").k, (K{1, 2, 3, 4}));
  const LensDistortion fisheye = lens("OPENCV_FISHEYE 640 480 500 510 320 240 0 0 0 0");
  EXPECT_EQ(fisheye.model, Model::kFisheye);
  EXPECT_EQ(lens("RADIAL_FISHEYE 640 480 500 320 240 1 2").k, (K{1, 2}));
  EXPECT_EQ(lens("RADIAL_FISHEYE 640 480 500 320 240 1 2").model, Model::kFisheye);
  Write("cameras.txt", std::string("1 OPENCV 640 480 500 510 320 240 1 2 3 4\n"));
  ExpectMessage(io::LoadColmapCameras(folder_).status(), "a.png", "undistort");
}

TEST_F(CameraFiles, OfSeveralColmapModelsTheLargestIsRead) {
  const std::string image = "1 1 0 0 0 0 0 0 1 a.png\n\n", more = "2 1 0 0 0 0 0 0 1 b.png\n\n";
  for (const auto& [name, images] : {std::pair("0", image), {"1", image + more}, {"10", image}}) {
    Write(std::string("sparse/") + name + "/cameras.txt",
          std::string("1 SIMPLE_PINHOLE 640 480 500 320 240\n"));
    Write(std::string("sparse/") + name + "/images.txt", images);
  }
  std::string told;
  const auto got =
      Ok(io::LoadCameras(folder_, {.warn = [&](const std::string& note) { told = note; }}));
  EXPECT_EQ(got->size(), 2u);
  ExpectIn(told, "sparse/1: taken for its 2 images", "0 (1), 10 (1)");
  // What a broken file claims to have, but has no room for, does not count.
  std::string broken = BinaryImages();
  broken[0] = broken[3] = 100;
  Write("sparse/2/cameras.bin", BinaryCameras());
  Write("sparse/2/images.bin", broken);
  EXPECT_EQ(io::LoadCameras(folder_, {}).value().size(), 2u);
}

TEST_F(CameraFiles, BackslashesOfWindows) {
  const std::string text = R"({"w":4,"h":4,"fl_x":3,"frames":[{"file_path":".\\images\\0 1.png",)";
  const auto got = Ok(io::LoadCameras(Write("a.json", text + kPose + "}]}"), {}));
  EXPECT_EQ(got->front().name, "./images/0 1.png");
}

TEST_F(CameraFiles, SyntheticNerfSaysOnlyTheAngle) {
  const std::string text = R"({"camera_angle_x": 0.6911112, "frames": [{"file_path": "./r_0",
    "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]})";
  const Path file = Write("transforms.json", text);
  ExpectMessage(io::LoadCameras(file, {}).status(), "size", "frame 0");
  const auto got = Ok(io::LoadCameras(file, {.size = {800, 800}}));
  EXPECT_NEAR(got->front().camera.fx, 1111.111, 1e-3);  // the number that these datasets quote
  EXPECT_EQ(got->front().camera.translation[2], -4);
}

TEST_F(CameraFiles, OpenCvPosesAndCentres) {
  const std::string text = R"({"width": 640, "height": 480, "rvec": [0,0,0], "tvec": [1,2,3],
    "K": [[500,0,319.5],[0,500,239.5],[0,0,1]], "dist": [0,0,0,0,0]})";
  const Path file = Write("cv.json", text);
  EXPECT_EQ(io::LoadCameras(file, {}).value()[0].camera.cx, 320);
  EXPECT_EQ(io::LoadCameras(file, {.opencv_centre = PixelCentre::kHalf}).value()[0].camera.cx,
            319.5);
  Write("cv.json",
        R"({"width": 4, "height": 4, "K": [[1,0,0],[0,1,0],[0,0,1]],
            "world_to_camera": [[1,0,0,1],[0,1,0,2],[0,0,1,3]]})");
  EXPECT_EQ(io::LoadCameras(file, {}).value()[0].camera.translation[2], -3);
}

TEST_F(CameraFiles, BrokenJson) {
  ExpectRefused("a.json", "{", "JSON");
  ExpectRefused("a.json", "[]", "object");
  ExpectRefused("a.json", "{\"frames\": []}", "frames");
  ExpectRefused("a.json", "{\"frames\": [3]}", "frame 0");
  ExpectRefused("a.json", "{\"w\": 4, \"h\": 0.5, \"frames\": [{}]}", "pixels");
  ExpectRefused("a.json", "{\"w\": 4, \"h\": 4, \"frames\": [{}]}", "transform_matrix");
  ExpectRefused("a.json", "{\"w\": 4, \"h\": 4, \"k1\": 0.1, \"frames\": [{}]}",
                "transform_matrix");
  for (const char* angle : {"0", "-0.7", "40", "3.15"}) {
    ExpectRefused("a.json",
                  fmt::format("{{\"w\": 4, \"h\": 4, \"camera_angle_x\": {}, {}}}", angle, kPose),
                  "radians");
  }
  ExpectRefused("a.json", R"({"w": 4, "h": 4, "fl_x": "x", "transform_matrix":
    [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]})",
                "fl_x");
  ExpectRefused("a.json", R"({"w": 4, "h": 4, "fl_x": 3, "transform_matrix":
    [[2,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]})",
                "rotation");
  ExpectRefused("a.json", R"({"width": 4, "height": 4, "K": [[1,0],[0,1]]})", "9");
  ExpectRefused("a.json", R"({"width": 4, "height": 4, "K": {}})", "K");
  EXPECT_FALSE(io::LoadCameras(folder_ / "none.json", {}).ok());
}

using Spoil = std::function<void(std::vector<CameraView>&)>;
struct Unreadable {
  const char* name;
  Spoil spoil;
};

// What was written and is then refused is lost.
TEST_F(CameraFiles, WhatCannotBeReadIsNotWritten) {
  const Unreadable cases[] = {
      {"no views", [](auto& views) { views.clear(); }},
      {"width 0", [](auto& views) { views[1].size.width = 0; }},
      {"height -5", [](auto& views) { views[2].size.height = -5; }},
      {"a huge side", [](auto& views) { views[0].size.width = (1 << 20) + 1; }},
      {"a focal length of 0", [](auto& views) { views[1].camera.fx = 0; }},
      {"an infinite translation", [](auto& views) { views[1].camera.translation[0] = INFINITY; }},
      {"a mirror", [](auto& views) { views[1].camera.rotation[0] *= -1; }},
  };
  for (const Unreadable& c : cases) {
    SCOPED_TRACE(c.name);
    std::vector<CameraView> views = Views();
    c.spoil(views);
    EXPECT_EQ(io::SaveNerfCameras(folder_ / "nerf.json", views).code(),
              StatusCode::kInvalidArgument);
    EXPECT_EQ(io::SaveOpenCvCameras(folder_ / "cv.json", views).code(),
              StatusCode::kInvalidArgument);
    EXPECT_EQ(io::SaveColmapCameras(folder_ / "colmap", views).code(),
              StatusCode::kInvalidArgument);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(CameraFiles, NamesComeBackOrAreRefused) {
  for (const std::string& name :
       {std::string("a b.png"), std::string("a\nb"), std::string(" a"), std::string("a\r"),
        std::string("a\0b", 3), std::string("\xff"), std::string("\"\\<\x1b"), std::string()}) {
    SCOPED_TRACE(name);
    std::vector<CameraView> views = Views();
    views[1].name = name;
    const auto check = [&](const Status& saved, const Path& path) {
      EXPECT_TRUE(saved.ok() || saved.code() == StatusCode::kInvalidArgument) << saved.message();
      if (!saved.ok()) return;
      const auto back = Ok(io::LoadCameras(path, {}));
      ASSERT_EQ(back->size(), 3u);
      EXPECT_EQ((*back)[1].name, name);
    };
    check(io::SaveNerfCameras(folder_ / "nerf.json", views), folder_ / "nerf.json");
    check(io::SaveOpenCvCameras(folder_ / "cv.json", views), folder_ / "cv.json");
    check(io::SaveColmapCameras(folder_ / "colmap", views), folder_ / "colmap");
  }
}

}  // namespace tilegrad::camera_file_test
