// SPDX-License-Identifier: Apache-2.0
// What critics see as real: pictures of training objects, and texture maps extracted from pictures.
#pragma once

#include <array>
#include <atomic>
#include <span>
#include <vector>

#include "base/file.h"
#include "nn/context.h"
#include "nn/tape.h"
#include "train/data/batches.h"
#include "train/data/stream/textured_stream.h"
#include "train/models/shape_texture_generator.h"
#include "train/tasks/next_batch.h"

namespace tilegrad::train {

inline constexpr std::int64_t kMostViews = 6;
// From the front, the side, the back and from above, then from between front and side and between
// side and back: the first `count` of these, OrbitCameras at the distance of `rule`.
std::vector<Camera> PrimaryCameras(const CameraRule& rule, std::int64_t count);

// Of B objects in V views, averaged from `stream.samples` samples a side of each pixel.
struct ObjectViews {
  nn::Tensor colors;  // [B, 3 V, size, size]: RGB over black of each view
  nn::Tensor cover;   // [B, V, size, size]: the covered share
};

// Half axes (x, y, z) of an ellipsoid about as large as these objects, from the bounding boxes of
// their silhouettes in the front and side views, as if each object were at the origin.
std::array<double, 3> MeanHalfAxes(const ObjectViews& views, const CameraRule& rule);

// Unlit training objects in a few fixed views, so that generated objects must have the pose of
// training objects. A pure function of (seed, place in the run).
class RealPictures {
 public:
  struct Job {
    TexturedStreamConfig config;
    CameraRule camera;
    std::int64_t views = 4;
    int size = 64;
    std::uint64_t seed = 0;
  };
  RealPictures(nn::Context& context, const Job& job, MeshCache meshes);

  struct Batch {
    std::uint64_t number = 0;
    int count = 0;  // objects, each a new draw
  };
  Result<ObjectViews> Draw(const Batch& batch);
  // As NextBatch::Take. `batch_of`: BatchIndex -> Batch.
  template <class BatchOf>
  Result<ObjectViews> Take(const UpdateIndex& at, const BatchOf& batch_of) {
    return next_.Take(at, [&](const BatchIndex& of) { return Work(batch_of(of)); });
  }
  void Settle() { next_.Settle(); }
  // Processor time since the last call.
  double TakeSeconds() { return seconds_.exchange(0); }
  Result<ImageU8> Sheet(int objects, int views) { return stream_.Sheet(objects, views); }

 private:
  struct Drawing;
  BatchWork<ObjectViews> Work(const Batch& batch);
  Result<std::span<const float>> DrawOne(int model, std::uint64_t position, std::size_t lane);

  nn::Context& context_;
  Job job_;
  TexturedStream stream_;
  BatchOrder order_;
  std::vector<TexturedView> views_;
  std::atomic<double> seconds_ = 0;
  NextBatch<ObjectViews> next_;  // last: ends before what it uses is destroyed
};

// The textures that the network of sections 5.2 and 5.3 extracts from pictures of the training
// objects: no other textures have the sphere's layout.
class TextureBank {
 public:
  struct Job {
    Path run;          // of the network
    int count = 2000;  // pictures, each of a new draw of an object
    std::uint64_t seed = 0;
    TexturedStreamConfig stream;  // of objects; cameras and lights are those of the run
    GeneratorConfig maps;
  };
  struct Data {
    const Dataset& dataset;
    const MeshCache& meshes;  // of training
  };
  // Errors name the run: it is missing, of another task, or has images or textures of another size.
  static Result<TextureBank> Extract(const Job& job, const Data& data, const Workers& workers,
                                     const Watch& watch);

  // `count` maps, chosen by `number`: [count, 3, texture_size, map_width] in [0, 1].
  nn::Tensor Draw(nn::Context& context, std::uint64_t number, int count) const;
  // Combines the fingerprint `with` with that of the textures.
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
