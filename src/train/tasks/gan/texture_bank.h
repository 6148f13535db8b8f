// SPDX-License-Identifier: Apache-2.0
// What the critic of texture maps takes for true: the textures that the network of sections 5.2 and
// 5.3 extracts from pictures of the training objects. There are no others that fit on a sphere.
#pragma once

#include <span>
#include <vector>

#include "base/file.h"
#include "nn/context.h"
#include "train/data/stream/textured_stream.h"
#include "train/models/shape_texture_generator.h"

namespace tilegrad::train {

class TextureBank {
 public:
  struct Job {
    Path run;          // of the network
    int count = 2000;  // pictures, each of an object drawn anew
    std::uint64_t seed = 0;
    TexturedStreamConfig stream;  // of objects; cameras and lights are those of the run
    GeneratorConfig maps;
  };
  struct Data {
    const Dataset& dataset;
    const MeshCache& meshes;  // of training
  };
  // Errors name the run: it is not there, is of another task, or has images or textures of another
  // size.
  static Result<TextureBank> Extract(const Job& job, const Data& data, const Workers& workers,
                                     const ProgressSink& progress, const StopFlag& stop);

  // Maps of `count`, drawn by `number`: [count, 3, texture_size, map_width] in [0, 1].
  nn::Tensor Draw(nn::Context& context, std::uint64_t number, int count) const;
  // Of the textures, and of a fingerprint that they belong to.
  std::string Fingerprint(const std::string& with) const;
  std::vector<float> Mean() const;  // [3, texture_size, map_width]
  std::size_t size() const { return bytes_.size() / map_bytes_; }

 private:
  std::uint64_t seed_ = 0;
  std::int64_t rows_ = 0, columns_ = 0;
  std::size_t map_bytes_ = 1;
  std::vector<std::uint8_t> bytes_;  // [count][3][rows][columns]
};

}  // namespace tilegrad::train
