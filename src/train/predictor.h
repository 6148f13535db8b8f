// SPDX-License-Identifier: Apache-2.0
// A trained network of any task, ready to predict: the only entry point for eval, predict and
// reports.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"
#include "train/config.h"
#include "train/data/dataset.h"
#include "train/run/checkpoint.h"

namespace tilegrad::train {

class Predictor {
 public:
  // `path`: a run folder (uses its newest complete checkpoint), a checkpoint, a file of weights or
  // the name of installed weights. Errors name the file and what is wrong.
  static Result<Predictor> Load(const Path& path, const Workers& workers);

  // Writes the weights that predict (WriteWeights), with the credits of the training data and the
  // CarriedFiles of the run.
  Status ExportWeights(const Path& file, const std::string& credits, nn::StoredFloats floats) const;

  // Newer checkpoints of the run folder that could not be read.
  const std::vector<std::string>& warnings() const { return all_->found.warnings; }
  const Path& checkpoint() const { return all_->found.file; }
  int image_size() const { return static_cast<int>(info().image_size); }  // pixels
  double half_extent() const { return info().half_extent; }  // of predictions, world units
  std::int64_t step() const { return info().step; }          // training steps taken
  // InvalidArgument with the dataset's folder if its images are not of that size.
  Status CheckImageSize(const Dataset& dataset) const;
  std::string description() const;  // "quick network, 3,214,902 parameters, step 3000"
  const Mesh& template_mesh() const { return all_->model->template_mesh(); }
  Task& task() const { return *all_->config.task; }  // with the configuration of the run
  Model& model() const { return *all_->model; }      // as the task loads it

  // images: [N][4][size][size] planar RGBA bytes, RGB over black. Returns N valid meshes with
  // smooth normals; unlit: the light of the training images is baked into their colours.
  Result<std::vector<Mesh>> Predict(std::span<const std::uint8_t> images) const;

 private:
  Predictor() = default;
  const CheckpointInfo& info() const { return all_->found.checkpoint.info; }

  struct Loaded {  // each refers to those before it
    explicit Loaded(const Workers& workers) : context(workers) {}
    nn::Context context;
    FoundCheckpoint found;  // without its tensors
    TrainConfig config;
    std::unique_ptr<Model> model;
  };
  std::unique_ptr<Loaded> all_;
};

}  // namespace tilegrad::train
