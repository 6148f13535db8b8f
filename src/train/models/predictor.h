// SPDX-License-Identifier: Apache-2.0
// A trained 5.1 network, ready to predict: the one way in for eval, predict and reports.
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
  int image_size() const;  // pixels
  // InvalidArgument with the dataset's folder if its images are not of that size.
  Status CheckImageSize(const Dataset& dataset) const;
  std::string description() const;    // "quick network, 3,214,902 parameters, step 3000"
  const Mesh& template_mesh() const;  // the sphere, normalised as predictions are

  // images: [N][4][size][size] planar RGBA bytes, RGB over black. Returns N meshes: the template's
  // faces, predicted positions (largest half-extent 0.45, centred) and vertex colours in [0, 1].
  // Batch statistics are those of training (eval mode).
  Result<std::vector<Mesh>> Predict(std::span<const std::uint8_t> images) const;

 private:
  Predictor();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tilegrad::train
