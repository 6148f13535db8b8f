// SPDX-License-Identifier: Apache-2.0
// Train() itself: resuming to the same bits, what it refuses, and what it survives.
#include "train/trainer.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <limits>

#include "base/file.h"
#include "nn/nn.h"
#include "same_run.h"
#include "support/temp_folder.h"
#include "tiny_run.h"
#include "train/data/trained_models.h"
#include "train/run/checkpoint.h"
#include "train/run/log.h"
#include "train/step_profile.h"

namespace tilegrad::train::trainer_test {

// While it lives no file can grow beyond `bytes`: writes fail as on a full disk.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit now = {bytes, before_.rlim_max};
    EXPECT_EQ(::setrlimit(RLIMIT_FSIZE, &now), 0);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_;
};

class TrainerTest : public TempFolderTest {
 protected:
  TrainerTest() : workers_(1), context_(workers_) {
    Ok(WriteNoiseDataset(folder_ / "data"));
    auto config = Ok(ParseConfig(kTinyConfig, "tiny"));
    job_ = {.config = std::move(config).value(), .data = folder_ / "data", .run = folder_ / "run"};
    job_.config.schedule.steps = 12;
  }

  Result<RunOutcome> Run(const ProgressSink& progress, int workers = 1) {
    const Workers count(workers);
    return Train(job_, count, {progress, &stop_});
  }
  Result<RunOutcome> Run(int workers = 1) {
    return Run([](const Progress&) {}, workers);
  }
  // Stops by the flag once `step` steps are done.
  void StopAfter(std::uint64_t step) {
    const auto outcome = Run([&](const Progress& p) {
      if (std::string_view(p.stage) == "training" && p.done >= step) stop_ = true;
    });
    stop_ = false;
    ASSERT_EQ(outcome.status().code(), StatusCode::kCancelled) << outcome.status().message();
    ExpectMessage(outcome.status(), "everything is saved");
  }
  // Starts anew in `name`, undisturbed.
  void RunWhole(const std::string& name, int workers) {
    const Path before = std::exchange(job_.run, folder_ / name);
    const auto outcome = Ok(Run(workers));
    EXPECT_TRUE(outcome->finished);
    job_.run = before;
  }
  void ExpectFinishes() {
    job_.existing = ExistingRun::kContinue;
    const auto outcome = Ok(Run());
    EXPECT_TRUE(outcome->finished);
  }
  void ExpectSameBits(const std::string& a, const std::string& b) {
    train::ExpectSameBits(context_, folder_ / a, folder_ / b, 12);
  }

  static void CutInHalf(const Path& file) {
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  }

  Workers workers_;
  nn::Context context_;
  StopFlag stop_{false};
  TrainJob job_;
};

TEST_F(TrainerTest, ANewRunKeepsItsPicturesAndWarnsOfFewModels) {
  int warnings = 0;
  job_.warn = [&](const std::string& text) {
    ++warnings;
    EXPECT_TRUE(text.starts_with("10 training shapes are few")) << text;
  };
  StopAfter(4);
  EXPECT_EQ(warnings, 1);
  const Path pictures = folder_ / "run" / "thumbnails.npz";
  const Bytes kept = ReadFile(pictures).value();
  std::filesystem::remove(pictures);  // as in a run of an earlier version
  ExpectFinishes();
  EXPECT_EQ(warnings, 1);
  EXPECT_EQ(ReadFile(pictures).value(), kept);
}

TEST_F(TrainerTest, WithoutMeshesNothingCanBeStreamed) {
  ValueOf<double>(job_.config, "stream.share") = 0.5;
  ExpectMessage(Run().status(), "stream.share");
}

TEST_F(TrainerTest, TheAverageOfTheWeightsPredicts) {
  ValueOf<double>(job_.config, "optimizer.average") = 0.9;
  RunWhole("run", 1);
  auto newest = Ok(LoadNewestCheckpoint(context_, folder_ / "run"));
  for (nn::NamedTensor& t : newest->checkpoint.tensors) {
    if (t.name.starts_with("ema.") || t.value.dtype() != nn::DType::kF32) continue;
    for (float& x : t.value.span<float>()) x = std::numeric_limits<float>::quiet_NaN();
  }
  auto model = Ok(job_.config.task->LoadModel(context_, newest->checkpoint));
  const auto side = static_cast<std::size_t>(newest->checkpoint.info.image_size);
  const std::vector<std::uint8_t> image(4 * side * side, 128);
  std::vector<Mesh> meshes;
  const Status predicted = (*model)->Predict(image, &meshes);  // an error if the mesh is not finite
  EXPECT_TRUE(predicted.ok()) << predicted.message();
  EXPECT_EQ(meshes.size(), 1u);
}

TEST_F(TrainerTest, HalfACheckpointFallsBackToTheOneBefore) {
  RunWhole("whole", 1);
  StopAfter(8);
  CutInHalf(ListCheckpoints(job_.run).back());
  job_.existing = ExistingRun::kContinue;
  std::vector<std::string> warnings;
  job_.warn = [&](const std::string& warning) { warnings.push_back(warning); };
  const auto outcome = Ok(Run());
  EXPECT_EQ(outcome->first_step, 6);
  ExpectOnly(warnings, "step_00000008");
  ExpectSameBits("whole", "run");
}

TEST_F(TrainerTest, ABrokenCheckpointIsToldOfAndPushesOutNoNewOnes) {
  StopAfter(8);
  CutInHalf(ListCheckpoints(job_.run).back());
  job_.existing = ExistingRun::kContinue;
  job_.config.schedule.keep_checkpoints = 1;
  std::vector<std::string> warnings;
  job_.warn = [&](const std::string& warning) { warnings.push_back(warning); };
  StopAfter(7);
  ExpectOnly(warnings, "skipped: ");
  EXPECT_EQ(LoadNewestCheckpoint(context_, job_.run)->checkpoint.info.step, 7);
}

TEST_F(TrainerTest, CheckpointsAloneAreARun) {
  StopAfter(2);
  std::filesystem::remove(job_.run / "config.toml");
  ExpectMessage(Run().status(), "--resume");
  job_.existing = ExistingRun::kContinue;
  ValueOf<double>(job_.config, "optimizer.learning_rate") *= 2;
  const Status refusal = Run().status();
  ExpectMessage(refusal, "learning_rate", "another configuration");
  ExpectNotIn(refusal.message(), "  ");
  EXPECT_EQ(LoadNewestCheckpoint(context_, job_.run)->checkpoint.info.step, 2);
  ValueOf<double>(job_.config, "optimizer.learning_rate") /= 2;
  ExpectFinishes();
}

TEST_F(TrainerTest, ARunWithoutItsCheckpointsDoesNotStartAnew) {
  job_.config.schedule.steps = 7;
  ExpectFinishes();
  std::filesystem::remove_all(job_.run / "checkpoints");
  const auto gone = LoadNewestCheckpoint(context_, job_.run);
  ExpectMessage(gone.status(), job_.run.string() + ": there is no checkpoint");
  const std::string curves = ReadText(job_.run / "metrics.jsonl").value();
  job_.config.schedule.checkpoint_every = 100;  // however often they were saved
  ExpectMessage(Run().status(), job_.run.string(), "up to step 7", "--out", "--force");
  EXPECT_EQ(ReadText(job_.run / "metrics.jsonl").value(), curves);
  // As if it was killed while the first of them was saved.
  Write("run/metrics.jsonl", curves.substr(0, curves.find("{\"step\":2")));
  EXPECT_EQ(Ok(Run())->first_step, 0);
  EXPECT_EQ(ReadLog(job_.run)->size(), 7u);
}

TEST_F(TrainerTest, ADivergedNetworkIsToldWhatMayHelp) {
  ValueOf<double>(job_.config, "optimizer.learning_rate") = 1;
  ValueOf<double>(job_.config, "optimizer.beta2") = 0;
  ValueOf<double>(job_.config, "loss.iou") = 1e12;
  ExpectMessage(Run().status(), "cannot be rendered", "optimizer.learning_rate");
}

TEST_F(TrainerTest, TheFirstStepIsSaved) {
  job_.config.schedule.checkpoint_every = 100;
  job_.config.schedule.keep_checkpoints = 3;
  RunWhole("run", 1);
  const std::vector<Path> files = ListCheckpoints(folder_ / "run");
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[0].filename(), "step_00000001.safetensors");
}

TEST_F(TrainerTest, ARunThatCannotWriteItsFirstFilesIsOneToResume) {
  Write("run/training_models.txt/in_the_way", "x");
  ExpectMessage(Run().status(), "training_models.txt");
  EXPECT_TRUE(PathExists(job_.run / "run.json"));
  std::filesystem::remove_all(job_.run / "training_models.txt");
  ExpectFinishes();
}

TEST_F(TrainerTest, RefusesOtherTrainingModels) {
  StopAfter(2);
  job_.existing = ExistingRun::kContinue;
  const Path list = ModelsPath(job_.data);
  const std::string models = ReadText(list).value();
  std::string other = models;
  other.replace(other.find("\"train\""), 7, "\"test\"");
  Write("data/models.jsonl", other);
  ExpectMessage(Run().status(), "noise/m0", "other training models");
  // What it was trained on is not held out then; runs without a list cannot tell.
  const Dataset split_anew = Dataset::Open(job_.data).value();
  ExpectMessage(CheckHeldOut(job_.run, split_anew), "1 of the 3 held-out models", "noise/m0");
  EXPECT_TRUE(CheckHeldOut(folder_ / "other", split_anew).ok());
  Write("data/models.jsonl", models);
  EXPECT_TRUE(CheckHeldOut(job_.run, Dataset::Open(job_.data).value()).ok());
  ExpectFinishes();
}

// A mesh that was trained on in one livery is not held out in another.
TEST_F(TrainerTest, OtherColoursOfATrainedMeshAreNotHeldOut) {
  const Dataset dataset = Dataset::Open(job_.data).value();
  auto models = dataset.models();
  const int test = dataset.Select(Split::kTest)[0], train = dataset.Select(Split::kTrain)[0];
  const auto remember = [&](std::uint64_t geometry) {
    models[static_cast<std::size_t>(train)].geometry = 77;
    models[static_cast<std::size_t>(test)].geometry = geometry;
    EXPECT_TRUE(WriteModels(job_.data, dataset.info(), models).ok());
    const Dataset changed = Dataset::Open(job_.data).value();
    EXPECT_TRUE(MakeFolder(job_.run).ok());
    EXPECT_TRUE(RememberTrainedModels(job_.run, changed, 0).ok());
    return CheckHeldOut(job_.run, changed);
  };
  EXPECT_TRUE(remember(78).ok());
  ExpectMessage(remember(77), "1 of the ", models[static_cast<std::size_t>(test)].id);
}

TEST_F(TrainerTest, RefusesOtherCamerasAndImages) {
  StopAfter(2);
  job_.existing = ExistingRun::kContinue;
  const auto expect = [&](const std::string& file, const Bytes& other, const char* says) {
    const Bytes before = ReadFile(folder_ / file).value();
    Write(file, other);
    ExpectMessage(Run().status(), "other training models, cameras or model files", says);
    Write(file, before);
  };
  DatasetInfo info = ReadDatasetInfo(job_.data).value();
  const Path index = DatasetInfoPath(job_.data);
  const std::string text = ReadText(index).value();
  for (const char* key :
       {"\"distance\": ", "\"fov_y\": ", "\"azimuth_step\": ", "\"elevation\": "}) {
    std::string changed = text;
    const auto at = changed.find(key) + std::strlen(key);
    changed.replace(at, changed.find_first_of(",\n", at) - at, "11.5");
    expect("data/dataset.json", Bytes(changed.begin(), changed.end()), "camera fov_y");
  }
  const Bytes sound = ReadFile(ModelFilePath(job_.data, "noise", "m4")).value();
  expect("data/models/noise/m3.npz", sound, "noise/m3");
  // Lists of earlier versions, which end before the cameras, are taken, and get them.
  const std::string list = ReadText(job_.run / "training_models.txt").value();
  Write("run/training_models.txt", list.substr(0, list.find("camera ")));
  StopAfter(3);
  EXPECT_EQ(ReadText(job_.run / "training_models.txt").value(), list);
  ExpectFinishes();
}

TEST_F(TrainerTest, OneProcessAtATimeInARun) {
  EXPECT_FALSE(FolderLock::IsHeld(job_.run));
  {
    const auto lock = Ok(FolderLock::Take(job_.run));
    EXPECT_TRUE(FolderLock::IsHeld(job_.run));
    ExpectMessage(Run().status(), "another process", "run");
  }
  EXPECT_FALSE(FolderLock::IsHeld(job_.run));
  ExpectFinishes();
}

TEST_F(TrainerTest, FullDiskLosesNothingThatWasSaved) {
  RunWhole("whole", 1);
  StopAfter(6);
  job_.existing = ExistingRun::kContinue;
  {
    // Room for the small files, not for a checkpoint.
    const auto checkpoint = std::filesystem::file_size(ListCheckpoints(job_.run).back());
    const FullDisk full(checkpoint / 2);
    const auto outcome = Run();
    ASSERT_EQ(outcome.status().code(), StatusCode::kIo) << outcome.status().message();
    ExpectMessage(outcome.status(), "checkpoints", "File too large");
  }
  for (const auto& file : std::filesystem::directory_iterator(job_.run / "checkpoints"))
    EXPECT_EQ(file.path().extension(), ".safetensors");  // no half of one
  EXPECT_EQ(LoadNewestCheckpoint(context_, job_.run)->checkpoint.info.step, 6);
  ExpectFinishes();
  ExpectSameBits("whole", "run");
  EXPECT_EQ(ReadLog(job_.run)->size(), 12u);
}

TEST_F(TrainerTest, BadDatasetsAreNamed) {
  job_.data = folder_ / "nothing";
  ExpectMessage(Run().status(), "nothing");
  job_.data = folder_ / "data";
  ValueOf<std::int64_t>(job_.config, "schedule.views") = 5;
  ExpectMessage(Run().status(), "schedule.views", "4 views");
  ValueOf<std::int64_t>(job_.config, "schedule.views") = 2;
  CutInHalf(ModelFilePath(job_.data, "noise", "m3"));
  ExpectMessage(Run().status(), "m3.npz");
}

TEST_F(TrainerTest, ARecordedRunHasTheSameBits) {
  RunWhole("one", 1);
  LoopTrace trace;
  trace.Begin();
  job_.run = folder_ / "recorded";
  EXPECT_TRUE(Ok(Train(job_, Workers(16, &trace), {}))->finished);
  EXPECT_GT(trace.End().loops.size(), 100u);
  ExpectSameBits("one", "recorded");
}

TEST_F(TrainerTest, AProfilePredictsForEachNumberOfWorkersAndWritesNothing) {
  const auto profile = Ok(ProfileSteps(job_, {.steps = 2, .workers = {2, 16}}, {}));
  EXPECT_GT(profile->one, 0);
  EXPECT_GT(profile->all, 0);
  ASSERT_EQ(profile->forecasts.size(), 2u);
  for (const LoopForecast& forecast : profile->forecasts) {
    double taken = 0;
    bool draws = false;
    for (const HeldBack& place : forecast.places) {
      taken += place.taken;
      draws = draws || place.place.starts_with("render/pipeline/pipeline.cc:");
    }
    EXPECT_NEAR(taken, forecast.seconds, 1e-9);
    EXPECT_TRUE(draws);
  }
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) files += entry.exists();
  EXPECT_EQ(files, 1u);  // the dataset
}

TEST_F(TrainerTest, AProfileStops) {
  const StopFlag stop{true};
  EXPECT_EQ(ProfileSteps(job_, {.steps = 2, .workers = {2}}, {nullptr, &stop}).status().code(),
            StatusCode::kCancelled);
}

}  // namespace tilegrad::train::trainer_test
