// SPDX-License-Identifier: Apache-2.0
// Pictures rendered during training: each object is a deformed, recoloured copy of a training
// model, seen by random cameras, each view under its own light or all under that of datasets. A
// pure function of (seed, position of the object in the run), so that checkpoints store nothing of
// it.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "scene/image.h"
#include "tilegrad/renderer.h"
#include "train/data/batches.h"
#include "train/data/stream/light_draw.h"
#include "train/data/stream/stream_config.h"
#include "train/data/stream/textured_meshes.h"

namespace tilegrad::train {

struct TexturedStreamConfig {
  StreamConfig draw;  // of it `share`, `max_faces` and `light` are for Job::dataset_light
  TexturedMeshRequest meshes;
  double mirrored = 0.5;  // share of the objects that are shown mirrored at x = 0
};

// All of [stream] that means something.
ConfigFields FieldsOf(TexturedStreamConfig* config);

// Without stretch, taper, mirror, and other colours: what scores are taken on.
TexturedStreamConfig WithoutChanges(TexturedStreamConfig config);

// A view of an object.
struct TexturedView {
  Camera camera;
  DrawnLight light;  // in the camera's axes
};

// How an object is shown; light: on white; normals: instead of colours, unit, in world axes.
enum class Appearance { kLit, kTexture, kLight, kNormals };
constexpr bool IsLit(Appearance a) { return a == Appearance::kLit || a == Appearance::kLight; }
// What AverageSamples needs.
inline Outputs OutputsOf(Appearance appearance) {
  const bool normals = appearance == Appearance::kNormals;
  return {.color = !normals, .alpha = false, .attributes = false, .normals = normals};
}

// Image n of a square frame, samples x samples of its pixels to one of [4][size][size]: the mean of
// colours, cut to [0, 1], over black, and the covered share. Of a frame without colours unit means
// of normals, 0 where nothing is.
void AverageSamples(const Images& images, std::size_t n, int samples, std::span<float> to);

class TexturedStream {
 public:
  // `seed` also decides which pictures these are: two streams of one seed show the same.
  struct Job {
    TexturedStreamConfig config;
    LightConfig light;
    CameraRule camera;
    int size = 64;
    std::uint64_t seed = 0;
    // Not `light` but the key and fill light of datasets, drawn once for all views of an object;
    // the views after the first have elevations of their own, and no object is mirrored.
    bool dataset_light = false;
  };
  // Calls with different numbers of `lanes` may overlap.
  TexturedStream(const Job& job, MeshCache meshes, std::size_t lanes);
  TexturedStream(const Job& job, MeshCache meshes, const Workers& workers)
      : TexturedStream(job, std::move(meshes), static_cast<std::size_t>(workers.count())) {}
  ~TexturedStream();
  TexturedStream(TexturedStream&&) noexcept;

  // How many of `batch` objects are streamed: the first ones.
  std::size_t Count(std::size_t batch) const;
  // These objects come next: their meshes are read meanwhile.
  void Expect(std::span<const Sample> objects) const;
  // The object at `position` of the run, step * batch + slot, made from mesh `model`, from as many
  // views as there are `views`, which are chosen: [views][4][size][size], planar, RGB over black
  // and the covered share of each pixel, in [0, 1]. Valid until the next call with the same
  // `worker`, in [0, lanes).
  Result<std::span<const float>> Render(int model, std::uint64_t position, std::size_t worker,
                                        std::span<TexturedView> views);
  // Sets the object up as Render does, for Again, in views that are given instead of drawn ones.
  Status SetUp(int model, std::uint64_t position, std::size_t worker,
               std::span<const TexturedView> views);
  // The views of the last Render or SetUp with this worker, the same size, in another way.
  Result<std::span<const float>> Again(std::size_t worker, Appearance appearance);

  // Other cameras and lights for Again, as many as there were.
  Status Change(std::size_t worker, std::span<const TexturedView> views);

  // Of processor time that Render has taken since the last call.
  double TakeSeconds();
  // Rows of objects from models that are spread over all, to look at.
  Result<ImageU8> Sheet(int objects, int views);

 private:
  struct Worker;
  Status Place(int model, std::uint64_t position, Worker* worker, std::span<TexturedView> views);
  Job job_;
  MeshCache meshes_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

}  // namespace tilegrad::train
