// SPDX-License-Identifier: Apache-2.0
// Whole fits on a few small images of a box.
#include "fit/run.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "fit/frames.h"
#include "fit/quarter_turn.h"
#include "fit/views_fixture.h"
#include "io/image_file.h"
#include "nn/context.h"
#include "train/report/html.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train::run_test {

class Fit : public ViewsTest {
 protected:
  void SetUp() override { Views(ColoredBox(), {.views = 8, .held_out = 2, .size = 64}); }
  FitJob Job(const std::string& out) {
    FitJob job;
    job.input = Input();
    job.out = folder_ / out;
    job.config.steps = 60;
    job.config.template_level = 2;
    job.config.texture_size = 32;
    job.config.checkpoint_every = 20;
    job.config.timelapse = 3;
    return job;
  }
  Bytes Read(const Path& path) { return Ok(ReadFile(path)).value(); }
};

// The mesh to turn, its size, and settings with what they mean.
void CheckReport(const std::string& page, const Mesh& mesh) {
  ExpectIn(
      page, "<th scope=\"row\">lighting</th><td>none</td><td>lighting model</td>",
      "<th scope=\"row\">views_per_step</th><td>4</td><td>images per step</td>",
      fmt::format("<th scope=\"row\">faces</th><td>{}</td>", WithCommas(std::ssize(mesh.faces))),
      fmt::format("<td>{} × {} texels</td>", mesh.textures[0].image.width,
                  mesh.textures[0].image.height),
      "\"texture\":{\"image\":\"data:image/png;base64,");
  ExpectNotIn(page, "{{", "src=\"http");
}

TEST_F(Fit, FindsShapeAndTextureAndWritesThem) {
  FitJob job = Job("run");
  job.config.steps = 400;
  job.config.template_level = 3;
  job.truth = Truth();
  const auto outcome = Ok(Run(job));
  EXPECT_EQ(outcome->held_out.size(), 2u);
  // The sphere itself: 13.5 dB, 0.78 and 0.69.
  EXPECT_GT(MeanPsnr(outcome->held_out), 16.5);
  EXPECT_GT(MeanIou(outcome->held_out), 0.86);
  EXPECT_GT(outcome->voxel_iou.value_or(0), 0.78);
  const auto mesh = Ok(io::LoadMesh(job.out / "mesh.glb"));
  EXPECT_EQ(mesh->mesh.textures.size(), 1u);
  for (const char* name : {"report.html", "timelapse.png", "transforms_fitted.json"}) {
    EXPECT_TRUE(std::filesystem::exists(job.out / name)) << name;
  }
  CheckReport(ReadText(job.out / "report.html").value(), mesh->mesh);
  const auto first = Ok(io::LoadMesh(job.out / "timelapse/00000000.glb"));
  EXPECT_EQ(first->mesh.textures.size(), 1u);
}

// In the words of the options, not as numbers.
TEST(FitConfigText, HasTheNamesOfChoices) {
  FitConfig config;
  const auto has = [&](const std::string& line) {
    EXPECT_NE(DescribeConfig(config).find("\n" + line + "\n"), std::string::npos) << line;
  };
  for (const auto& [lighting, name] :
       {std::pair(Lighting::kNone, "none"), std::pair(Lighting::kLambert, "lambert"),
        std::pair(Lighting::kPhong, "phong"), std::pair(Lighting::kSphericalHarmonics, "sh")}) {
    config.lighting = lighting;
    has(std::string("lighting = ") + name);
  }
  config.filter = Filter::kTrilinear;
  has("filter = trilinear");
  config.filter = Filter::kBilinear;
  has("filter = bilinear");
  config.parameters[Parameter::kTexture] = config.parameters[Parameter::kPositions] = true;
  has("parameters = positions,texture");
}

TEST_F(Fit, StoppedAndResumedEndsInTheSameBitsForAnyWorkers) {
  ExpectSameInParts(Job("whole"), {27});
}

TEST_F(Fit, ABrokenCheckpointIsToldOfEvenIfTheFitIsStopped) {
  FitJob job = Job("run");
  job.config.checkpoint_every = 5;
  StopAt(job, 12);
  EXPECT_EQ(Run(job).status().code(), StatusCode::kInvalidArgument);  // refuses without resume
  const Path newest = ListCheckpoints(job.out).back();
  std::filesystem::resize_file(newest, std::filesystem::file_size(newest) / 2);
  std::vector<std::string> warnings;
  job.warn = [&](const std::string& warning) { warnings.push_back(warning); };
  job.existing = ExistingRun::kContinue;
  StopAt(job, 13);
  ExpectOnly(warnings, newest.filename().string());
}

// Going on from an older checkpoint would throw away what a newer version did.
TEST_F(Fit, AnotherVersionsCheckpointStopsIt) {
  FitJob job = Job("run");
  job.config.steps = 12;
  job.config.checkpoint_every = 5;
  ASSERT_TRUE(Run(job).ok());
  const Workers workers(1);
  nn::Context context(workers);
  const auto files = ListCheckpoints(job.out);
  nn::TensorFile newest = nn::ReadSafetensors(context, files.back()).value();
  newest.metadata["format"] = "tilegrad-checkpoint-2";
  ASSERT_TRUE(nn::WriteSafetensors(files.back(), newest).ok());
  job.existing = ExistingRun::kContinue;
  ExpectMessage(Run(job).status(), files.back().filename().string(), "another version",
                "nothing was changed");
  EXPECT_EQ(ListCheckpoints(job.out), files);
}

// Of one that was killed before its first checkpoint pictures are all that is there.
TEST_F(Fit, PicturesOfAnEarlierFitAreNotShown) {
  FitJob job = Job("whole");
  job.config.steps = 6;
  ASSERT_TRUE(Run(job).ok());
  job.out = folder_ / "again";
  for (const char* name : {"00000001.png", "00000100.png"}) {
    ASSERT_TRUE(io::SavePng(job.out / "timelapse" / name, ImageU8(64, 64, 3)).ok());
  }
  ASSERT_TRUE(Run(job).ok());
  EXPECT_EQ(Read(job.out / "timelapse.png"), Read(folder_ / "whole" / "timelapse.png"));
}

TEST_F(Fit, ResumingWithOtherSettingsNamesTheFirst) {
  FitJob job = Job("run");
  ASSERT_TRUE(Run(job).ok());
  job.existing = ExistingRun::kContinue;
  job.config.smoothing = 3;
  ExpectMessage(Run(job).status(), "smoothing = 10", "smoothing = 3");
}

// As an earlier version wrote them, which had no edge_length.
TEST_F(Fit, SettingsInAnotherOrderAndWithoutALaterKeyAreTheSame) {
  FitJob job = Job("run");
  ASSERT_TRUE(Run(job).ok());
  const Workers workers(1);
  nn::Context context(workers);
  Checkpoint newest = LoadNewestCheckpoint(context, job.out)->checkpoint;
  std::istringstream lines(newest.info.config);
  ExpectIn(newest.info.config, "\nedge_length = 0\n");
  newest.info.config.clear();
  for (std::string line; std::getline(lines, line);) {
    if (line != "edge_length = 0") newest.info.config = line + "\n" + newest.info.config;
  }
  ASSERT_TRUE(SaveCheckpoint(job.out, newest.info, std::move(newest.tensors)).ok());
  job.existing = ExistingRun::kContinue;
  const auto continued = Ok(Run(job));
  EXPECT_EQ(continued->first_step, job.config.steps);
}

TEST_F(Fit, ResumingWithOtherImagesIsRefused) {
  FitJob job = Job("run");
  job.config.steps = 20;
  ASSERT_TRUE(Run(job).ok());
  job.existing = ExistingRun::kContinue;
  job.input.images.color[5] += 0.1f;
  ExpectMessage(Run(job).status(), "checksum of images, cameras and mesh = ");
  job.input.images.color[5] -= 0.1f;
  job.input.cameras[1].translation[2] += 1;
  ExpectMessage(Run(job).status(), "checksum of images, cameras and mesh = ");
  // Nor is a wish passed over that contradicts the files.
  ExpectMessage(ReadFitFolder(folder_ / "views", 3).status(), "transforms_test.json", "--hold-out");
}

// Held-out views of another mesh would judge the fit.
TEST_F(Fit, ViewsMadeAnewLeaveNoneOfTheOldOnes) {
  const auto make = [&](int held_out, const Path& folder, bool force = true) {
    return MakeViews(Icosphere(1, 1), {.views = 3, .held_out = held_out, .size = 16}, folder,
                     OutputGuard(force), {}, stop_);
  };
  ASSERT_TRUE(make(0, folder_ / "views").ok());
  const auto input = Ok(ReadFitFolder(folder_ / "views", 3));
  EXPECT_EQ(input->images.width, 16);
  EXPECT_EQ(input->held_out.size(), 1u);
  stop_ = true;  // a call that is stopped leaves no cameras for images of two meshes
  EXPECT_EQ(make(1, folder_ / "views").code(), StatusCode::kCancelled);
  EXPECT_FALSE(ReadFitFolder(folder_ / "views", 0).ok());
  stop_ = false;
  EXPECT_TRUE(make(1, folder_ / "views").ok());
  for (const std::string name : {"transforms.json", "transforms_train.json"}) {
    const Path file = Write("photos_" + name + "/" + name, std::string("{}"));
    ExpectMessage(make(1, file.parent_path(), false), name, "another folder");
    EXPECT_EQ(ReadText(file).value(), "{}");
  }
}

// Those of a longer call would be taken for views of the new mesh, by whoever looks. What no call
// made stays; and without a word nothing is replaced.
TEST_F(Fit, FewerViewsLeaveNoImagesOfMoreViews) {
  const auto make = [&](int views, bool force) {
    return MakeViews(Icosphere(1, 1), {.views = views, .held_out = 1, .size = 16}, folder_ / "few",
                     OutputGuard(force), {}, stop_);
  };
  ASSERT_TRUE(make(6, false).ok());
  ExpectMessage(make(2, false), "few", "--force");
  const Path images = folder_ / "few" / "images";
  Write("few/images/photo.png", std::string("mine"));
  Write("few/images/007.png", std::string("mine"));
  // No process has that number.
  for (const std::string name : {"001.png", "photo.png", "copy"}) {
    Write("few/images/" + name + ".99999999.tmp", std::string("half"));
  }
  ASSERT_TRUE(make(2, true).ok());
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(images)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  const std::vector<std::string> expected = {"000.png",
                                             "001.png",
                                             "002.png",
                                             "007.png",
                                             "copy.99999999.tmp",
                                             "photo.png",
                                             "photo.png.99999999.tmp"};
  EXPECT_EQ(names, expected);
}

TEST_F(Fit, RefinesCameras) {
  FitJob job = Job("run");
  job.start = Truth();
  job.config.parameters[Parameter::kCamera] = true;
  job.config.perturb_cameras = 5;
  job.config.steps = 200;
  const auto outcome = Ok(Run(job));
  EXPECT_NEAR(outcome->camera_error_before.value_or(0), 5, 1e-2);
  EXPECT_LT(outcome->camera_error_after.value_or(90), 2.5);
}

// Every parameter moves, under the light that it needs.
TEST_F(Fit, EveryParameterCanBeFitted) {
  const std::pair<Parameter, Lighting> cases[] = {{Parameter::kColors, Lighting::kNone},
                                                  {Parameter::kTexture, Lighting::kLambert},
                                                  {Parameter::kUv, Lighting::kNone},
                                                  {Parameter::kLight, Lighting::kLambert},
                                                  {Parameter::kSh, Lighting::kSphericalHarmonics},
                                                  {Parameter::kMaterial, Lighting::kPhong}};
  for (const auto& [parameter, lighting] : cases) {
    FitJob job = Job(NameOf(parameter));
    job.config.parameters[parameter] = true;
    job.config.parameters[Parameter::kPositions] = parameter == Parameter::kUv;
    if (parameter == Parameter::kUv) job.config.parameters[Parameter::kTexture] = true;
    job.config.lighting = lighting;
    job.config.steps = 30;
    job.config.views_per_step = 8;
    job.config.levels = 1;  // every step sees the same
    job.config.vertex_colors = parameter == Parameter::kColors;
    const bool sphere = parameter == Parameter::kTexture || parameter == Parameter::kUv;
    if (!sphere) job.start = Truth();
    const auto outcome = Run(job);
    ASSERT_TRUE(outcome.ok()) << NameOf(parameter) << ": " << outcome.status().message();
    const auto log = Ok(ReadText(job.out / "metrics.jsonl"));
    const auto color_of = [&](std::size_t line) {
      std::size_t at = 0;
      for (std::size_t i = 0; i < line; ++i) at = log->find('\n', at) + 1;
      return std::stod(log->substr(log->find("\"color\":", at) + 8));
    };
    EXPECT_LT(color_of(2), 1.001 * color_of(0)) << NameOf(parameter);
  }
}

TEST_F(Fit, ThePageSaysWhichViewsItShows) {
  FitJob job = Job("run");
  job.config.steps = 1;
  ASSERT_TRUE(Run(job).ok());
  ExpectIn(*ReadText(job.out / "report.html"), ">Held-out views<");
  job = Job("fitted");
  job.config.steps = 1;
  job.input.held_out.clear();
  ASSERT_TRUE(Run(job).ok());
  ExpectIn(*ReadText(job.out / "report.html"), ">Fitted views, the first 6 of 8<");
}

TEST_F(Fit, ErrorsNameTheCure) {
  const auto refused = [&](const auto& change, const auto&... parts) {
    FitJob job = Job("run");
    change(job);
    ExpectMessage(Run(job).status(), parts...);
  };
  refused([](FitJob& job) { job.config.parameters[Parameter::kSh] = true; }, "sh cannot be fitted",
          "spherical harmonics");
  refused([](FitJob& job) { job.input.masked = false; }, "mask");
  refused([](FitJob& job) { job.config.steps = 0; }, "steps is 0");
  refused([](FitJob& job) { job.config.perturb_cameras = NAN; }, "perturb_cameras is nan");
  refused([](FitJob& job) { job.config.timelapse = -1; }, "timelapse is -1");
  refused(
      [](FitJob& job) {
        job.config.lighting = Lighting::kLambert;
        job.config.light_direction = {0, 0, 0};
      },
      "light_direction is 0 0 0");
  EXPECT_EQ(ReadFitFolder(folder_ / "none", 0).status().code(), StatusCode::kNotFound);
  Write("broken/transforms.json", std::string("{\"frames\": [{\"file_path\": \"a.png\"}]}"));
  ExpectMessage(ReadFitFolder(folder_ / "broken", 0).status(), "frame 0", "camera_angle_x");
}

TEST_F(Fit, WildTransforms) {
  const auto error = [this](const std::string& fields) {
    Write("wild/transforms.json",
          R"({"camera_angle_x": 0.7, "frames": [{"file_path": "a.png", )" + fields + "}]}");
    const auto frames = ReadTransforms(folder_ / "wild/transforms.json");
    return frames.ok() ? CameraOfFrame(frames->at(0), {8, 8}).status() : frames.status();
  };
  const auto matrix = [](const std::string& number) {
    return R"("transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,)" + number + "],[0,0,0,1]]";
  };
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  EXPECT_TRUE(error(matrix("4")).ok());
  EXPECT_TRUE(error(R"("w": "x", "w": 8, "h": 8, )" + matrix("4")).ok());  // the last counts
  ExpectMessage(error(matrix("1e999")), "transforms.json", "1e999");
  ExpectMessage(error(matrix("null")), "transforms.json", "frame 0", "transform_matrix");
  ExpectMessage(error(R"("transform_matrix": )" + deep), "transforms.json", "nested");
  for (const std::string field : {"\"w\": 1e300", "\"h\": -1", "\"fl_x\": []", "\"k5\": 1e-320",
                                  "\"mask_path\": 1", "\"file_path\": null"}) {
    ExpectMessage(error(field + ", " + matrix("4")), "transforms.json", "frame 0");
  }
}

// Black and white saved as RGBA has an alpha that says nothing; a cut-out has one that says all.
TEST_F(Fit, MasksAreWhiteOrCutOut) {
  ImageU8 opaque(8, 8, 4, 255), cut(8, 8, 4, 0), grey(8, 8, 1, 0);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      for (int c = 0; c < 3; ++c) opaque.at(x, y)[c] = x < 4 ? 255 : 0;
      cut.at(x, y)[3] = grey.at(x, y)[0] = x < 4 ? 255 : 0;
    }
  }
  const std::string pose = R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]})";
  Write("masks/transforms.json", R"({"camera_angle_x":0.7,"frames":[{"file_path":"a.png",)"
                                 R"("mask_path":"mask.png",)" +
                                     pose + "]}");
  ASSERT_TRUE(io::SavePng(folder_ / "masks/a.png", ImageU8(8, 8, 3, 99)).ok());
  for (const ImageU8& mask : {opaque, cut, grey}) {
    ASSERT_TRUE(io::SavePng(folder_ / "masks/mask.png", mask).ok());
    const auto input = Ok(ReadFitFolder(folder_ / "masks", 0));
    for (std::size_t p = 0; p < 64; ++p) {
      EXPECT_EQ(input->images.alpha[p], p % 8 < 4 ? 1.0f : 0.0f) << mask.channels << ", " << p;
    }
  }
}

// Cameras that are turned about the world's origin would lose an object that stands elsewhere.
TEST_F(Fit, PerturbedCamerasStillSeeTheObject) {
  FitJob job = Job("run");
  job.start = Icosphere(1, 0.1f);
  for (glm::vec3& p : job.start->positions) p += glm::vec3(50, 0, 0);
  for (Camera& camera : job.input.cameras) {
    for (int r = 0; r < 3; ++r) camera.translation[r] -= 50 * camera.rotation[3 * r];
  }
  job.config.perturb_cameras = 10;
  const auto start = Ok(PrepareFit(job, Workers(1)));
  for (std::size_t i = 0; i < job.input.cameras.size(); ++i) {
    const Camera &before = job.input.cameras[i], &after = start->scene.cameras[i];
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(after.rotation[3 * r] * 50 + after.translation[r],
                  before.rotation[3 * r] * 50 + before.translation[r], 1e-4);
    }
  }
}

TEST_F(Fit, TransformsRoundTrip) {
  const Camera camera = OrbitCamera({50, 40, 30}, 20, 30, 2);
  const Path file = folder_ / "cameras.json";
  ASSERT_TRUE(WriteTextAtomic(
                  file, WriteTransforms(
                            {{"a.png", camera}, {"b.png", camera, 1, ImageSize{30, 40}}}, {40, 30}))
                  .ok());
  const auto frames = Ok(ReadTransforms(file));
  EXPECT_EQ(frames->at(1).camera.size->height, 40);
  // Half the size: everything in pixels halves.
  const auto half = Ok(CameraOfFrame(frames->at(0), {20, 15}));
  EXPECT_NEAR(half->fx, camera.fx / 2, 1e-4);
  EXPECT_NEAR(half->cy, camera.cy / 2, 1e-4);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(half->rotation[i], camera.rotation[i], 1e-5);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(half->translation[i], camera.translation[i], 1e-5);
}

// Edges of masks are soft.
TEST_F(Fit, ScoresTheTruthHighlyAndTurnedViewsAlike) {
  FitInput input = Input();
  const FitScene truth = Ok(SceneOfMesh(Truth())).value();
  const auto scores = [&] {
    const std::span cameras(input.cameras);
    return Ok(ScoreViews(truth, input, std::array{0, 1}, cameras.first(2), Workers(1))).value();
  };
  const std::vector<ViewScore> upright = scores();
  EXPECT_GT(MeanIou(upright), 0.98);
  const ImageSize size{64, 64};
  const auto turn = [&](std::span<float> planes) {
    std::ranges::copy(TurnedPlanes(planes, size), planes.begin());
  };
  turn(std::span(input.images.color).subspan(3 * 4096, 3 * 4096));
  turn(std::span(input.images.alpha).subspan(4096, 4096));
  input.cameras[1] = TurnedCamera(input.cameras[1], size.height);
  input.turned = {1};
  const std::vector<ViewScore> turned = scores();
  EXPECT_NEAR(turned[1].psnr, upright[1].psnr, 0.05);
  EXPECT_NEAR(turned[1].iou, upright[1].iou, 0.005);
  EXPECT_EQ(turned[1].truth.pixels, upright[1].truth.pixels);
}

TEST(FitScore, SaysWhichMaskOrCameraIsInDoubt) {
  FitInput input;
  input.names = {"a", "b", "c", "d"};
  input.masked = true;
  std::vector<ViewScore> scores(4);
  const auto doubt = [&](std::initializer_list<double> ious) {
    int view = 0;
    for (const double iou : ious) {
      scores[static_cast<std::size_t>(view)].iou = iou;
      scores[static_cast<std::size_t>(view)].view = view;
      ++view;
    }
    return DoubtOf(scores, input);
  };
  EXPECT_EQ(doubt({0.9, 0.95, 0.8, 0.97}), "");
  ExpectIn(doubt({0.9, 0.95, 0.5, 0.97}), "c: mesh and mask agree to 50 %", "all views to 83 %");
  ExpectIn(doubt({0.4, 0.5, 0.3, 0.4}), "mesh and masks agree to 40 % only");
  input.masked = false;  // every pixel counts as the object
  EXPECT_EQ(doubt({0.4, 0.5, 0.3, 0.4}), "");
}

TEST(FitScore, AlignmentFindsASimilarity) {
  Similarity truth;
  const double angle = 0.4;
  truth.scale = 1.3;
  truth.rotation[0] = truth.rotation[4] = std::cos(angle);
  truth.rotation[1] = -std::sin(angle);
  truth.rotation[3] = std::sin(angle);
  truth.offset[0] = 0.2;
  truth.offset[2] = -0.5;
  std::vector<Camera> from, to;
  for (int i = 0; i < 5; ++i) {
    from.push_back(OrbitCamera({50, 40, 30}, 70 * i, 10 * i, 2));
    to.push_back(Moved(from.back(), truth));
  }
  const Similarity found = AlignCameras(from, to);
  EXPECT_NEAR(found.scale, truth.scale, 1e-5);
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(found.rotation[i], truth.rotation[i], 1e-5);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(found.offset[i], truth.offset[i], 1e-5);
  EXPECT_NEAR(AngleBetween(from[0], to[0]), angle * 180 / M_PI, 1e-2);
}

// Half turns about three axes: their sum is -1, and the orthogonal matrix nearest to it a
// reflection.
TEST(FitScore, AlignmentIsARotationWhateverTheCameras) {
  std::vector<Camera> from(3), to(3);
  const double half_turns[3][9] = {
      {1, 0, 0, 0, -1, 0, 0, 0, -1}, {-1, 0, 0, 0, 1, 0, 0, 0, -1}, {-1, 0, 0, 0, -1, 0, 0, 0, 1}};
  for (int i = 0; i < 3; ++i) {
    from[i] = to[i] = OrbitCamera({50, 40, 30}, 0, 0, 2);
    Similarity turn;
    std::copy_n(half_turns[i], 9, turn.rotation.begin());
    to[i] = Moved(from[i], turn);
  }
  const Similarity found = AlignCameras(from, to);
  const auto& r = found.rotation;
  const double determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) -
                             r[1] * (r[3] * r[8] - r[5] * r[6]) +
                             r[2] * (r[3] * r[7] - r[4] * r[6]);
  EXPECT_NEAR(determinant, 1, 1e-12);
}

}  // namespace tilegrad::train::run_test
