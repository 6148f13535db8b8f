// SPDX-License-Identifier: Apache-2.0
// A dataset and a configuration for tests of whole training runs: images of noise (what they show
// does not matter there) and a network of a few thousand weights.
#pragma once

#include <cstdlib>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "base/rng.h"
#include "scene/shapes.h"
#include "train/config.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {

inline const std::string kOften = "log_every = 1\ncheckpoint_every = 3\nkeep_checkpoints = 2\n";

inline const std::string kTinyConfig = R"(name = "tiny"
[network]
channels = 4
code = 16
hidden1 = 16
hidden2 = 16
template_level = 1
fc_deviation = 0.0
[render]
sharpness = 500
sharpness_start = 100
[schedule]
batch = 8
views = 2
sample_every = 10
)" + kOften;

inline const std::string kTinyTextured = R"(name = "tiny"
[task]
kind = "textured_image"
[network]
base = 4
most = 8
levels = 2
latent = 12
hidden = 12
light_width = 8
template_level = 1
lookup = true
lookup_width = 4
[render]
sharpness = 500
sharpness_start = 100
[schedule]
batch = 4
sample_every = 10
)" + kOften;

inline const std::string kTinyClassifier = R"(name = "tiny"
[task]
kind = "classify"
[network]
channels = 4
most = 8
levels = 3
[schedule]
batch = 8
sample_every = 10
)" + kOften;

inline const std::string kTinyGan = R"(name = "tiny"
[task]
kind = "gan"
[network]
noise = 6
shape_noise = 4
hidden = 8
template_level = 1
texture_size = 32
texture_base = 2
texture_most = 4
[critic]
base = 2
halvings = 2
updates = 2
[stages]
shape = 6
[textures]
count = 40
[render]
sharpness = 500
[optimizer]
average = 0.5
[score]
every = 4
count = 8
[schedule]
steps = 12
batch = 4
sample_every = 12
)" + kOften;

// Of a miniature of photographs.
inline const std::string kTinyPhotographs = R"(name = "tiny"
[task]
kind = "photographs"
[network]
base = 4
most = 8
levels = 2
latent = 12
template_level = 1
[photographs]
size = 16
[render]
sharpness = 500
sharpness_start = 100
[optimizer]
learning_rate = 2e-3
average = 0.5
[schedule]
steps = 12
batch = 4
sample_every = 10
)" + kOften;

// A training of some task, for tests of all of them.
struct TinyKind {
  const char* name;
  std::string config;
  std::vector<std::string> settings = {};
  const char* data = "data";  // a folder
};

inline void PrintTo(const TinyKind& kind, std::ostream* out) { *out << kind.name; }

inline const std::vector<std::string> kTinyCritic = {
    "adversarial.weight=0.5",        "adversarial.features=1", "adversarial.base=4",
    "adversarial.halvings=2",        "adversarial.updates=2",  "adversarial.learning_rate=1e-3",
    "adversarial.place=interpolates"};

// The value behind a key of a configuration.
template <class T>
T& ValueOf(TrainConfig& config, const std::string& key) {
  for (const ConfigField& field : config.Fields()) {
    if (field.key == key) return *std::get<T*>(field.target);
  }
  std::abort();
}

enum class Meshes { kNone, kBoxes };

// Models of all classes in turn, four views each.
struct NoiseData {
  Meshes meshes = Meshes::kNone;
  std::vector<std::string> classes = {"noise"};
  int size = 32, train = 10, test = 2;
  // Paints a byte of a channel, 0 to 3, of a picture of a class.
  std::function<int(int class_index, int channel, Rng& rng)> paint = [](int, int, Rng& rng) {
    return static_cast<int>(rng.Below(256));
  };
};

inline Status WriteNoiseData(const Path& folder, const NoiseData& noise) {
  constexpr int kViews = 4;
  DatasetInfo info;
  info.source = noise.meshes == Meshes::kNone ? "nmr" : "folder";
  info.image_size = info.camera.lens.width = info.camera.lens.height = noise.size;
  info.views = kViews;
  info.classes = noise.classes;
  info.recipe = "0000000000000000";
  const auto pixels = static_cast<std::size_t>(noise.size * noise.size);
  ModelData data;
  data.images.resize(kViews * 4 * pixels);
  data.occupancy.resize(std::size_t{kOccupancyResolution} * kOccupancyResolution *
                        kOccupancyResolution);
  if (noise.meshes == Meshes::kBoxes) {
    data.mesh = Box(glm::vec3(0), {0.9f, 0.4f, 0.6f});
    data.mesh.colors.assign(data.mesh.positions.size(), {0.8f, 0.3f, 0.2f, 1.0f});
    data.points.resize(kTruthPoints);
  }
  std::vector<ModelInfo> models;
  Rng rng(3);
  for (int m = 0; m < noise.train + noise.test; ++m) {
    ModelInfo model;
    model.id = model.name = "m" + std::to_string(m);
    model.class_index = m % static_cast<int>(noise.classes.size());
    model.split = m < noise.train ? Split::kTrain : Split::kTest;
    for (std::size_t i = 0; i < data.images.size(); ++i) {
      const int channel = static_cast<int>(i / pixels) % 4;
      data.images[i] = static_cast<std::uint8_t>(noise.paint(model.class_index, channel, rng));
    }
    const Path file =
        ModelFilePath(folder, info.classes[static_cast<std::size_t>(model.class_index)], model.id);
    std::filesystem::create_directories(file.parent_path());
    TILEGRAD_TRY(SaveModelFile(file, info, data, {info.recipe, 0, 0}));
    models.push_back(model);
  }
  TILEGRAD_TRY(WriteDatasetInfo(folder, info));
  return WriteModels(folder, info, models);
}

inline Status WriteNoiseDataset(const Path& folder, Meshes meshes = Meshes::kNone, int classes = 1,
                                int size = 32) {
  NoiseData noise{.meshes = meshes, .size = size};
  for (int c = 1; c < classes; ++c) noise.classes.push_back("noise" + std::to_string(c));
  return WriteNoiseData(folder, noise);
}

}  // namespace tilegrad::train
