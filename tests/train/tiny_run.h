// SPDX-License-Identifier: Apache-2.0
// A dataset and a configuration for tests of whole training runs: images of noise (what they show
// does not matter there) and a network of a few thousand weights.
#pragma once

#include <cstdlib>
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

// The value behind a key of a configuration.
template <class T>
T& ValueOf(TrainConfig& config, const std::string& key) {
  for (const ConfigField& field : config.Fields()) {
    if (field.key == key) return *std::get<T*>(field.target);
  }
  std::abort();
}

enum class Meshes { kNone, kBoxes };

inline Status WriteNoiseDataset(const Path& folder, Meshes meshes = Meshes::kNone, int classes = 1,
                                int size = 32) {
  constexpr int kModels = 12, kViews = 4;
  DatasetInfo info;
  info.source = meshes == Meshes::kNone ? "nmr" : "folder";
  info.image_size = info.camera.lens.width = info.camera.lens.height = size;
  info.views = kViews;
  for (int c = 0; c < classes; ++c)
    info.classes.push_back("noise" + (c > 0 ? std::to_string(c) : std::string()));
  info.recipe = "0000000000000000";
  ModelData data;
  data.images.resize(std::size_t{kViews} * 4 * static_cast<std::size_t>(size * size));
  data.occupancy.resize(std::size_t{kOccupancyResolution} * kOccupancyResolution *
                        kOccupancyResolution);
  if (meshes == Meshes::kBoxes) {
    data.mesh = Box(glm::vec3(0), {0.9f, 0.4f, 0.6f});
    data.mesh.colors.assign(data.mesh.positions.size(), {0.8f, 0.3f, 0.2f, 1.0f});
    data.points.resize(kTruthPoints);
  }
  std::vector<ModelInfo> models;
  Rng rng(3);
  for (int m = 0; m < kModels; ++m) {
    ModelInfo model;
    model.id = model.name = "m" + std::to_string(m);
    model.class_index = m % classes;
    model.split = m < 10 ? Split::kTrain : Split::kTest;
    for (std::uint8_t& byte : data.images) byte = static_cast<std::uint8_t>(rng.Below(256));
    const Path file =
        ModelFilePath(folder, info.classes[static_cast<std::size_t>(model.class_index)], model.id);
    std::filesystem::create_directories(file.parent_path());
    if (Status status = SaveModelFile(file, info, data, {info.recipe, 0, 0}); !status.ok()) {
      return status;
    }
    models.push_back(model);
  }
  if (Status status = WriteDatasetInfo(folder, info); !status.ok()) return status;
  return WriteModels(folder, info, models);
}

}  // namespace tilegrad::train
