// SPDX-License-Identifier: Apache-2.0
// Readers of what a run, a dataset or a fit is made of.
#include <cmath>
#include <nlohmann/json.hpp>

#include "fit/frames.h"
#include "fuzz/target.h"
#include "io/image_file.h"
#include "train/config.h"
#include "train/data/dataset_files.h"
#include "train/data/photographs/photographs.h"
#include "train/eval/evaluation.h"
#include "train/run/checkpoint.h"
#include "train/run/log.h"

namespace tilegrad::fuzz::run_targets {

constexpr int kPictures = 9;

void Config(Input input) {
  const std::string text(input.begin(), input.end());
  const auto config = train::ParseConfig(text, "config.toml");
  if (!Accepted(config)) return;
  const std::string written = train::WriteConfig(*config);
  const auto again = train::ParseConfig(written, "again.toml");
  Require(again.ok(), "what was written can be read");
  Require(train::WriteConfig(*again) == written, "and is the same");
}

std::vector<Bytes> ConfigSeeds() {
  std::vector<Bytes> out;
  for (const char* kind : {"single_image", "textured_image", "classify"}) {
    const auto text = std::string("name = \"a\"\n[task]\nkind = \"") + kind + "\"\n";
    const auto config = train::ParseConfig(text, "seed.toml");
    Require(config.ok(), "a seed can be read");
    out.push_back(ToBytes(text));
    out.push_back(ToBytes(train::WriteConfig(*config)));
  }
  return out;
}

void Transforms(Input input) {
  const MemoryFile file(input);
  const auto frames = train::ReadTransforms(file.path());
  if (!Accepted(frames)) return;
  for (const train::InputFrame& frame : *frames) {
    (void)Accepted(train::CameraOfFrame(frame, {64, 48}));
  }
}

void Checkpoint(Input input) {
  static const Workers one(1);
  nn::Context context(one);
  const MemoryFile file(input);
  const auto checkpoint = train::LoadCheckpoint(context, file.path());
  if (Accepted(checkpoint)) Require(checkpoint->info.step >= 0, "a step is not negative");
}

std::vector<Bytes> CheckpointSeeds() {
  const Workers one(1);
  nn::Context context(one);
  const Path run = ScratchFolder() / "run";
  const train::CheckpointInfo info{12, 64, "name = \"a\"\n", 3.5};
  Require(train::SaveCheckpoint(run, info, {{"w", context.Full({2, 2}, 0.25)}}).ok(), "a seed");
  const auto files = train::ListCheckpoints(run);
  Require(files.size() == 1, "a seed is there");
  const auto bytes = ReadFile(files[0]);
  Require(bytes.ok(), "a seed can be read");
  std::filesystem::remove_all(run);
  return {*bytes};
}

// The curves, which a run that goes on writes anew.
void Log(Input input) {
  PutFile("log/metrics.jsonl", input);
  const Path run = ScratchFolder() / "log";
  const auto entries = train::ReadLog(run);
  if (Accepted(entries) && entries->size() < 10) {
    const auto log = train::RunLog::Open(run, INT64_MAX);
    (void)Accepted(log);
    const auto again = train::ReadLog(run);
    Require(log.ok() && again.ok() && again->size() == entries->size(), "the log stays");
  }
  std::filesystem::remove_all(run);
}

std::vector<Bytes> LogSeeds() {
  return {ToBytes("{\"step\":1,\"loss\":0.5,\"loss/a\":1e-3}\n{\"step\":2,\"loss\":0.25}\n{\"st")};
}

// dataset.json and models.jsonl.
void Dataset(Input input) {
  const auto files = SplitFiles(input);
  const Path folder = ScratchFolder() / "dataset";
  PutFile("dataset/dataset.json", files[0]);
  PutFile("dataset/models.jsonl", files.size() > 1 ? files[1] : Input());
  const auto dataset = train::Dataset::Open(folder);
  if (Accepted(dataset)) {
    const auto classes = static_cast<int>(dataset->info().classes.size());
    for (const train::ModelInfo& model : dataset->models()) {
      Require(model.class_index >= 0 && model.class_index < classes, "a model has its class");
      Require(model.id.find('/') == std::string::npos, "an id is a file name");
    }
  }
  std::filesystem::remove_all(folder);
}

std::vector<Bytes> DatasetSeeds() {
  train::DatasetInfo info;
  info.source = "folder";
  info.classes = {"chair", "table"};
  info.credits = {"c"};
  info.recipe = "0123456789abcdef";
  const Path folder = ScratchFolder() / "seed";
  const std::vector<train::ModelInfo> models = {
      {"a", "A", 0, train::Split::kTrain, "CC0", "x", 12, 7},
      {"b", "B", 1, train::Split::kTest, "", "", 3, 9}};
  Require(
      train::WriteDatasetInfo(folder, info).ok() && train::WriteModels(folder, info, models).ok(),
      "a seed can be written");
  const auto first = ReadText(train::DatasetInfoPath(folder)),
             second = ReadText(train::ModelsPath(folder));
  Require(first.ok() && second.ok(), "a seed can be read");
  std::filesystem::remove_all(folder);
  return {ToBytes(*first + std::string(kNextFile) + *second)};
}

void Evaluation(Input input) {
  PutFile("eval/eval.json", input);
  const auto evaluation = train::ReadEvaluation(ScratchFolder() / "eval");
  if (Accepted(evaluation) && evaluation->has_value()) {
    (void)train::FormatTable(**evaluation);
    (void)train::FormatMarkdown(**evaluation);
  }
}

std::vector<Bytes> EvaluationSeeds() {
  train::Evaluation e;
  train::Score score;
  score.iou = 0.5;
  score.f_score = 0.25;
  e.predictor = "p";
  e.split = "test";
  e.dataset_source = "folder";
  e.views_per_model = 2;
  e.classes = {"chair"};
  e.class_models = {1};
  e.rows = {{"tilegrad", {score}, score}};
  e.models = {{"chair", "a", score}};
  return {ToBytes(train::EvaluationJson(e).dump())};
}

// keypoints.json beside nine pictures, and behind it, where there is more, transforms.json.
const Path& PhotoFolder() {
  static const Path folder = [] {
    const Path path = ScratchFolder() / "photographs";
    std::filesystem::create_directories(path);
    for (int i = 0; i < kPictures; ++i) {
      const ImageU8 picture(8, 8, 4, 255);
      Require(io::SavePng(path / (std::to_string(i) + ".png"), picture).ok(), "a picture");
    }
    return path;
  }();
  return folder;
}

void Photographs(Input input) {
  const auto files = SplitFiles(input);
  const Path& folder = PhotoFolder();
  PutFile("photographs/keypoints.json", files[0]);
  std::filesystem::remove(folder / "transforms.json");
  if (files.size() > 1) PutFile("photographs/transforms.json", files[1]);
  const auto set = train::OpenPhotoFolder(folder);
  if (!Accepted(set)) return;
  for (const train::Photograph& photo : (**set).photographs) {
    Require(photo.keypoints.size() == (**set).keypoint_names.size(), "every keypoint has a place");
    Require(photo.camera.has_value(), "keypoints give cameras");
    Require(std::isfinite(photo.camera->scale), "a camera is finite");
    for (const double x : photo.camera->translation) Require(std::isfinite(x), "a finite shift");
  }
  for (const auto& place : (**set).mean_keypoints) {
    for (const double x : place) Require(std::isfinite(x), "a mean keypoint is finite");
  }
}

const Registration kTargets[] = {
    Registration({"photographs", Photographs}),
    Registration({"config", Config, ConfigSeeds}),
    Registration({"transforms", Transforms}),
    Registration({"checkpoint", Checkpoint, CheckpointSeeds}),
    Registration({"log", Log, LogSeeds}),
    Registration({"dataset", Dataset, DatasetSeeds}),
    Registration({"evaluation", Evaluation, EvaluationSeeds}),
};

}  // namespace tilegrad::fuzz::run_targets
