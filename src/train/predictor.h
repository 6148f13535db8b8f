// SPDX-License-Identifier: Apache-2.0
// What a run has trained, ready to predict, whatever its task: the one way in for eval, predict and
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
#include "train/data/dataset.h"

namespace tilegrad::train {

class Model;
class Task;

class Predictor {
 public:
  // `path`: a run folder (its newest whole checkpoint is taken) or one checkpoint. Errors name the
  // file and what is wrong.
  static Result<Predictor> Load(const Path& path, const Workers& workers);
  ~Predictor();
  Predictor(Predictor&&) noexcept;
  Predictor& operator=(Predictor&&) noexcept;

  // Newer checkpoints of the run folder that could not be read.
  const std::vector<std::string>& warnings() const;
  const Path& checkpoint() const;  // the file
  int image_size() const;          // pixels
  std::int64_t step() const;       // steps that it has learned for
  // InvalidArgument with the dataset's folder if its images are not of that size.
  Status CheckImageSize(const Dataset& dataset) const;
  std::string description() const;    // "quick network, 3,214,902 parameters, step 3000"
  const Mesh& template_mesh() const;  // Model::template_mesh
  Task& task() const;                 // with the configuration of the run
  Model& model() const;               // as the task loads it

  // images: [N][4][size][size] planar RGBA bytes, RGB over black. Returns N valid meshes with
  // smooth normals; unlit: their colours hold the light of the training images.
  Result<std::vector<Mesh>> Predict(std::span<const std::uint8_t> images) const;

 private:
  Predictor();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad::train
