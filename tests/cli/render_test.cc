// SPDX-License-Identifier: Apache-2.0
// `tilegrad render` as a person starts it.
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "io/camera_file.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::render_test {

class Render : public ProgramTest {
 protected:
  void SetUp() override {
    Mesh sphere = Icosphere(2, 1);
    SetColor(sphere, {1, 0, 0, 1});
    ASSERT_TRUE(io::SaveGlb(folder_ / "ball.glb", sphere).ok());
  }
  void ExpectDone(const std::string& arguments) {
    ProgramTest::ExpectDone("render " + In("ball.glb") + " " + arguments);
  }
  void ExpectRefused(const std::string& arguments, int code, const std::string& part) {
    ProgramTest::ExpectRefused("render " + In("ball.glb") + " " + arguments, code, part);
  }
  std::vector<float> Floats(const std::string& name) const {
    return io::LoadNpy(folder_ / name).value().As<float>().value();
  }
};

// `mesh` as near.obj, and as far.obj with every vertex at (431000, 4600000, 300) more.
void WriteNearAndFar(const Path& folder, const Mesh& mesh) {
  const auto far = [](glm::vec3 p) { return glm::dvec3(431000, 4600000, 300) + glm::dvec3(p); };
  Ok(WriteTextAtomic(folder / "near.obj", ObjText(mesh, [](glm::vec3 p) { return p; })));
  Ok(WriteTextAtomic(folder / "far.obj", ObjText(mesh, far)));
}

class RenderFar : public Render {
 protected:
  std::vector<std::uint8_t> Picture(const std::string& arguments, const std::string& name) const {
    ProgramTest::ExpectDone("render " + arguments + " --out " + In(name));
    return io::LoadImage(folder_ / name).value().pixels;
  }
  // Digits of 5e-7 move edges by less than 1e-4 pixels.
  static void ExpectSame(const std::vector<std::uint8_t>& got,
                         const std::vector<std::uint8_t>& want) {
    ASSERT_EQ(got.size(), want.size());
    for (std::size_t i = 0; i < want.size(); ++i) ASSERT_NEAR(got[i], want[i], 1) << i;
  }
  // The same, but samples may lie on an edge, where a pixel that is nearly transparent has a colour
  // or none: some of 40 x 40 x 4 numbers. Another axis or side changes hundreds.
  static void ExpectAlike(const std::vector<std::uint8_t>& got,
                          const std::vector<std::uint8_t>& want) {
    ASSERT_EQ(got.size(), want.size());
    int differ = 0;
    for (std::size_t i = 0; i < want.size(); ++i) differ += std::abs(got[i] - want[i]) > 1;
    EXPECT_LE(differ, 24);
  }
};

// Cameras given and written are those of the world, where the mesh is too far away for float.
TEST_F(RenderFar, IsSeenByCamerasOfTheWorld) {
  WriteNearAndFar(folder_, Icosphere(2, 1));
  const auto want = Picture(In("near.obj") + " --size 48 --eye 1 0.5 3", "near.png");
  const auto by_eye = Picture(In("far.obj") +
                                  " --size 48 --eye 431001 4600000.5 303 --target 431000 "
                                  "4600000 300 --write-cameras " +
                                  In("c.json"),
                              "eye.png");
  ExpectSame(by_eye, want);
  ExpectSame(Picture(In("far.obj") + " --cameras " + In("c.json"), "file.png"), by_eye);
}

// Whatever axis is up: framed, around, from a point, as a written camera, and in other commands.
TEST_F(RenderFar, WithAnotherAxisUp) {
  Mesh mesh = Box({-0.1f, -0.3f, -1}, {0.2f, 0.2f, 1});
  Append(mesh, Box({0.2f, -0.1f, 0.5f}, {0.6f, 0.1f, 0.8f}));  // an arm, so that no view is another
  WriteNearAndFar(folder_, mesh);
  for (const std::string up : {"z", "x"}) {
    const std::string near = In("near.obj") + " --size 40 --force --up " + up,
                      far = In("far.obj") + " --size 40 --force --up " + up;
    const auto want = Picture(near, "near.png");
    for (const std::string& cameras : {In("c.json"), In("colmap")}) {
      ExpectAlike(Picture(far + " --write-cameras " + cameras, "far.png"), want);
      ExpectAlike(Picture(In("far.obj") + " --force --cameras " + cameras, "c.png"), want);
    }
    ExpectAlike(Picture(far + " --eye 431003 4600002 301 --target 431000 4600000 300", "far.png"),
                Picture(near + " --eye 3 2 1 --target 0 0 0", "near.png"));
    for (const std::string name : {"near", "far"}) {
      ProgramTest::ExpectDone("views " + In(name + ".obj") + " --up " + up +
                              " --views 2 --size 24 --out " + In(name + up));
    }
    for (const std::string view : {"/images/000.png", "/images/001.png"}) {
      ExpectAlike(io::LoadImage(In("far" + up + view)).value().pixels,
                  io::LoadImage(In("near" + up + view)).value().pixels);
    }
  }
}

TEST_F(Render, FramesTheWholeMeshByItself) {
  ExpectDone("--out " + In("a.png") + " --size 64x48");
  const ImageU8 image = io::LoadImage(folder_ / "a.png").value();
  ASSERT_EQ(image.width, 64);
  ASSERT_EQ(image.height, 48);
  ASSERT_EQ(image.channels, 4);
  EXPECT_EQ(image.at(0, 0)[3], 0);
  EXPECT_EQ(image.at(32, 24)[3], 255);
  EXPECT_GT(image.at(32, 24)[0], 100);  // red
  EXPECT_EQ(image.at(32, 24)[1], 0);
  int top = 48, bottom = -1;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      if (image.at(x, y)[3] > 0) {
        top = std::min(top, y);
        bottom = std::max(bottom, y);
      }
    }
  }
  // A margin of 5 % of half the image is 1.2 pixels on each side.
  EXPECT_GE(top, 1);
  EXPECT_LE(top, 3);
  EXPECT_LE(bottom, 46);
}

// A sphere of radius 1 seen from 4 away: its nearest point is 3 away and faces the eye.
TEST_F(Render, ExactImagesAsNumbers) {
  ExpectDone("--out " + In("a.npy") +
             " --size 65 --eye 0 0 4 --outputs color,alpha,depth,normals,uv,faces");
  const auto depth = Floats("a_depth.npy"), alpha = Floats("a_alpha.npy"),
             normals = Floats("a_normals.npy");
  ASSERT_EQ(depth.size(), 65u * 65u);
  const std::size_t middle = 32 * 65 + 32;
  EXPECT_NEAR(depth[middle], 3, 0.05);  // the facets lie a little inside
  EXPECT_GT(normals[3 * middle + 2], 0.95f);
  EXPECT_EQ(alpha[middle], 1);
  EXPECT_TRUE(std::isinf(depth[0]));
  EXPECT_EQ(alpha[0], 0);
  EXPECT_EQ(Floats("a.npy").size(), 65u * 65u * 4u);
  EXPECT_EQ(Floats("a_uv.npy").size(), 65u * 65u * 2u);
  const auto faces = io::LoadNpy(folder_ / "a_faces.npy").value().As<std::int32_t>().value();
  EXPECT_EQ(faces[0], -1);
  EXPECT_GE(faces[middle], 0);
}

TEST_F(Render, ExrIsOneFile) {
  ExpectDone("--out " + In("a.exr") + " --size 16 --outputs color,depth,normals");
  EXPECT_EQ(ReadFile(folder_ / "a.exr").value()[0], 0x76);  // OpenEXR's magic number
  EXPECT_FALSE(Exists("a_depth.exr"));
}

// A flat bar along the axis that is up, red; the picture shows it upright, as high as it can be.
TEST_F(Render, MeshesWithAnotherAxisUp) {
  const auto bar = [&](const std::string& name, glm::vec3 half) {
    Mesh mesh = Box(-half, half);
    SetColor(mesh, {1, 0, 0, 1});
    ASSERT_TRUE(io::SaveGlb(folder_ / name, mesh).ok());
  };
  bar("y.glb", {0.1f, 1, 0.2f});
  bar("z.glb", {0.1f, 0.2f, 1});
  bar("x.glb", {1, 0.1f, 0.2f});
  const auto picture = [&](const std::string& mesh, const std::string& options) {
    const std::string out = In(mesh + "_" + std::to_string(options.size()) + ".png");
    ProgramTest::ExpectDone("render " + In(mesh + ".glb") + " --size 32 --force " + options +
                            " --out " + out);
    return io::LoadImage(out).value();
  };
  const ImageU8 upright = picture("y", "");
  EXPECT_EQ(picture("z", "--up z").pixels, upright.pixels);
  EXPECT_EQ(picture("x", "--up X").pixels, upright.pixels);
  EXPECT_NE(picture("z", "--up y").pixels, upright.pixels);
  // The sky turns with it.
  const std::string sky = " --shading sh";
  EXPECT_EQ(picture("z", "--up z" + sky).pixels, picture("y", sky).pixels);
  EXPECT_EQ(picture("x", "--up x" + sky).pixels, picture("y", sky).pixels);
  // By hand: a word or three numbers.
  const std::string eye = "--eye 0 -4 0 ";
  EXPECT_EQ(picture("z", eye + "--up z").pixels, picture("z", eye + "--up 0 0 2").pixels);
  // Other sides of the bar stand in for each other, and rounding decides at pixels of their edges.
  const ImageU8 a = picture("z", eye + "--up z"), b = picture("y", "--eye 0 0 4");
  int differ = 0;
  for (std::size_t p = 0; p < a.pixels.size(); ++p) differ += a.pixels[p] != b.pixels[p];
  EXPECT_LE(differ, 8) << "of " << a.pixels.size();
  // Cameras are those of the file: its turntable goes around z.
  ExpectRefused("--up 0 0 1", 2, "--up 0,0,1");
  ExpectRefused("--up w", 2, "--up w");
  ExpectRefused("--gltf-camera 0 --up z", 2, "--up has no effect with cameras");
  ProgramTest::ExpectDone("render " + In("z.glb") +
                          " --up z --size 8 --turntable 4 --elevation 0 " + "--out " + In("t") +
                          " --write-cameras " + In("t.json"));
  const auto views = Ok(io::LoadCameras(folder_ / "t.json", {}));
  for (const auto& view : *views)
    EXPECT_NEAR(view.camera.rotation[5], 1, 1e-6);  // the picture's up is z
}

TEST_F(Render, TexturesByHand) {
  ImageU8 blue(1, 1, 3);
  blue.pixels = {0, 0, 255};
  ASSERT_TRUE(io::SavePng(folder_ / "blue.png", blue).ok());
  const std::string faces = "vt 0 0\nf 1/1 2/1 3/1\n", corners = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\n";
  Write("plain.obj", corners + faces);
  Write("kd.mtl", "newmtl m\nKd 0.5 0.5 0.5\n");
  Write("kd.obj", "mtllib kd.mtl\nusemtl m\n" + corners + faces);
  Write("bare.obj", corners + "f 1 2 3\n");
  Write("map.mtl", "newmtl m\nmap_Kd blue.png\n");
  Write("map.obj", "mtllib map.mtl\nusemtl m\n" + corners + faces);
  Write("uv.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\nproperty float s\n"
        "property float t\nelement face 1\nproperty list uchar int "
        "vertex_indices\nend_header\n-1 -1 0 0 0\n1 -1 0 0 0\n0 1 0 0 0\n"
        "3 0 1 2\n");
  const auto render = [&](const std::string& mesh, const std::string& texture) {
    return "render --size 16 --eye 0 0 4 --shading none --force " + In(mesh) + " --texture " +
           In(texture) + " --out " + In("a.png");
  };
  for (const char* mesh : {"plain.obj", "kd.obj", "uv.ply"}) {
    ProgramTest::ExpectDone(render(mesh, "blue.png"));
    const ImageU8 image = io::LoadImage(folder_ / "a.png").value();
    EXPECT_EQ(std::vector<int>(image.at(8, 8), image.at(8, 8) + 4),
              (std::vector<int>{0, 0, 255, 255}))
        << mesh;
  }
  const auto refused = [&](const std::string& mesh, const std::string& texture, int code,
                           const std::string& part) {
    ProgramTest::ExpectRefused(render(mesh, texture), code, part);
  };
  refused("bare.obj", "blue.png", 2, "no texture coordinates");
  refused("map.obj", "blue.png", 2, "has a texture already");
  refused("plain.obj", "none.png", 3, "none.png");
  refused("plain.obj", "kd.mtl", 3, "kd.mtl");
}

TEST_F(Render, EveryShadingModel) {
  for (const char* model : {"none", "lambert", "phong", "sh"}) {
    const std::string file = std::string(model) + ".png";
    ExpectDone("--out " + In(file) + " --size 32 --shading " + model);
    const ImageU8 image = io::LoadImage(folder_ / file).value();
    EXPECT_GT(image.at(16, 16)[0], 60) << model;
  }
  EXPECT_EQ(io::LoadImage(folder_ / "none.png").value().at(16, 16)[0], 255);
}

// The light of the world stays where it is; that side is brighter.
TEST_F(Render, LightComesFromWhereItIsSaid) {
  ExpectDone("--out " + In("a.png") + " --size 32 --eye 0 0 4 --light 1 0 0 1 --ambient 0");
  const ImageU8 image = io::LoadImage(folder_ / "a.png").value();
  EXPECT_GT(image.at(24, 16)[0], 150);
  EXPECT_LT(image.at(8, 16)[0], 10);
}

TEST_F(Render, TurntableNumbersItsPicturesAndCamerasComeBack) {
  ExpectDone("--out " + folder_.string() + " --size 24 --turntable 3 --write-cameras " +
             In("transforms.json"));
  for (const char* name : {"ball_0000.png", "ball_0001.png", "ball_0002.png"})
    EXPECT_TRUE(Exists(name)) << name;
  const auto views = Ok(io::LoadCameras(folder_ / "transforms.json", {}));
  ASSERT_EQ(views->size(), 3u);
  EXPECT_EQ((*views)[1].name, "ball_0001.png");
  // The same pictures again from the file of cameras.
  ExpectDone("--out " + In("again") + " --cameras " + In("transforms.json"));
  const auto a = io::LoadImage(folder_ / "ball_0001.png").value();
  const auto b = io::LoadImage(folder_ / "again/ball_ball_0001.png").value();
  ASSERT_EQ(b.width, 24);
  int differing = 0;  // float rounding of the pose may move an edge sample
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    differing += std::abs(a.pixels[i] - b.pixels[i]) > 32;
  EXPECT_LE(differing, 4);
}

TEST_F(Render, ManyMeshesOneOfThemBroken) {
  Write("bad.obj", "f 1 2 3\n");
  ASSERT_TRUE(io::SaveGlb(folder_ / "box.glb", Box({0, 0, 0}, {1, 1, 1})).ok());
  ExpectRefused(In("bad.obj") + " " + In("box.glb") + " --size 16 --out " + In("out"), 3,
                "bad.obj");
  EXPECT_TRUE(Exists("out/ball.png"));
  EXPECT_TRUE(Exists("out/box.png"));
}

TEST_F(Render, ViewsOfOneNameDoNotOverwriteEachOther) {
  const std::string camera = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]})";
  std::string frames;
  for (const std::string name : {"a_2.png", "a.png", "a.jpg"})
    frames += (frames.empty() ? "" : ",") + ("{\"file_path\":\"" + name + "\"," + camera);
  Write("views.json", "{\"camera_angle_x\":0.7,\"frames\":[" + frames + "]}");
  ExpectDone("--cameras " + In("views.json") + " --size 16 --out " + In("out"));
  int pictures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "out"))
    pictures += entry.path().extension() == ".png";
  EXPECT_EQ(pictures, 3);
}

// The depth of "ball" and the colours of "ball_depth".
TEST_F(Render, PicturesOfOneNameAreRefused) {
  ASSERT_TRUE(io::SaveGlb(folder_ / "ball_depth.glb", Icosphere(1, 1)).ok());
  const std::string rest = "--size 8 --outputs color,depth --out " + In("out");
  ExpectRefused(In("ball_depth.glb") + " " + rest, 2, "ball_depth.png: two images have this name");
}

TEST_F(Render, ExplainSaysWhatWasDone) {
  ExpectIn(
      RunProgram("render " + In("ball.glb") + " --size 16 --explain --out " + In("a.png")).output,
      "ms");
}

TEST_F(Render, SoftAlphaReachesBeyondTheSilhouette) {
  ExpectDone("--out " + In("a.npy") + " --size 32 --outputs alpha --soft-delta 0.1");
  ExpectDone("--out " + In("b.npy") + " --size 32 --outputs alpha");
  double soft = 0, hard = 0;
  for (const float a : Floats("a_alpha.npy")) soft += a;
  for (const float a : Floats("b_alpha.npy")) hard += a;
  EXPECT_GT(soft, 1.1 * hard);
}

TEST_F(Render, WrongCommandLines) {
  ExpectRefused("--out " + In("a.jpg"), 2, ".png, .exr or .npy");
  EXPECT_FALSE(Exists("a.jpg"));
  ExpectRefused("--elevation nan", 2, "--elevation");
  ExpectRefused("--size 0", 2, "--size");
  ExpectRefused("--size 10x", 2, "--size");
  ExpectRefused("--size 16000 --supersample 3", 2, "samples");
  ExpectRefused("--eye 0 0 0", 2, "same point");
  ExpectRefused("--eye 0 0 4 --turntable 3", 2, "");
  ExpectRefused("--target 0 0 4", 2, "");
  ExpectRefused("--fov 180", 2, "--fov");
  ExpectRefused("--margin 1", 2, "margin");
  ExpectRefused("--distance -1", 2, "distance");
  ExpectRefused("--outputs colour", 2, "colour");
  ExpectRefused("--gltf-camera 0", 2, "no perspective camera");
  ExpectRefused("--turntable 2 --out " + In("a.png"), 2, "folder");
  ExpectRefused("--format exr --out " + In("a.png"), 2, "disagree");
}

TEST_F(Render, EndingsInCapitalsAreTheSameFormats) {
  ExpectDone("--size 16 --outputs color,depth --out " + In("a.PNG"));
  EXPECT_TRUE(io::LoadImage(folder_ / "a.PNG").ok());
  EXPECT_TRUE(Exists("a_depth.PNG"));
  ExpectRefused("--out " + In("a.JPG"), 2, ".png, .exr or .npy");
  ExpectRefused("--out " + In("a.PNG") + " --format npy", 2, "disagree");
}

TEST_F(Render, OptionsThatWouldDoNothing) {
  ExpectRefused("--sh 1 0 0 0 0 0 0 0 0", 2, "--shading sh");
  ExpectRefused("--shading none --light 0 0 1 1", 2, "--light has no effect without --shading");
  ExpectRefused("--shading sh --ambient 0.3", 2, "--ambient has no effect without --shading");
  ExpectRefused("--specular 0.3", 2, "--shading phong");
  ExpectRefused("--shininess 3", 2, "--shading phong");
  ExpectRefused("--light-at-camera", 2, "without --light");
  ExpectRefused("--light 0 0 0 1", 2, "towards the light");
  ExpectRefused("--opencv-centre half", 2, "--cameras");
  ExpectRefused("--eye 0 0 4 --azimuth 30", 2, "--azimuth has no effect without automatic framing");
  ExpectRefused("--gltf-camera 0 --fov 30", 2, "--fov has no effect with cameras");
  ExpectRefused("--background 1 1 1 --out " + In("a.exr"), 2, "--background");
  ExpectDone("--size 8 --fov 30 --azimuth 9 --elevation 9 --distance 9 --out " + In("a.png"));
  ExpectDone(
      "--size 8 --eye 0 0 4 --fov 30 --shading phong --specular 1 --shininess 3 --light 1 1 "
      "1 1 --light-at-camera --ambient 0 --out " +
      In("b.png"));
}

TEST_F(Render, WarnsOfImagesThatShowNothing) {
  const std::string ball = "render " + In("ball.glb") + " --size 8 --force --out " + In("b.png");
  ExpectIn(ProgramTest::ExpectDone(ball + " --quiet --eye 0 0 9 --target 0 0 10"),
           "ball.glb: is not seen in 1 of 1 image, such as b.png");
  ExpectNotIn(ProgramTest::ExpectDone(ball + " --eye 0 0 9"), "not seen");
  Write("line.obj", "v 0 0 0\nv 1 1 0\nv 2 2 0\nf 1 2 3\n");
  const std::string line = "render " + In("line.obj") + " --size 8 --out " + In("line.png");
  ExpectIn(ProgramTest::ExpectDone(line), "line.obj: is not seen", "or have no area");
}

TEST_F(Render, BrokenFiles) {
  ExpectRefused("--cameras " + In("none"), 3, "none");
  ExpectRefused("--cameras " + folder_.string(), 3, "cameras.txt");
  ExpectRefused("--cameras " + Write("c.json", "{").string(), 3, "c.json");
  ProgramTest::ExpectRefused("render " + In("none.glb"), 3);
  Write("in_the_way", "x");
  ExpectError("render " + In("ball.glb") + " --size 16 --out " + In("in_the_way/a.png"),
              "in_the_way");
}

}  // namespace tilegrad::render_test
