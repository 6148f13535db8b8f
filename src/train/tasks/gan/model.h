// SPDX-License-Identifier: Apache-2.0
// A trained generator: latent codes in, textured meshes out.
#pragma once

#include <span>
#include <vector>

#include "base/parallel.h"
#include "scene/camera.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"
#include "train/tasks/gan/config.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// Meshes of codes [n, noise], by the weights that `generator` has. Without `textured`, of shapes
// alone, they are grey. Normals are smooth.
Result<std::vector<Mesh>> GenerateMeshes(nn::Context& context, ShapeTextureGenerator& generator,
                                         const nn::Tensor& codes, bool textured);

class GeneratorModel : public Model {
 public:
  static Result<std::unique_ptr<GeneratorModel>> Load(nn::Context& context, const GanConfig& config,
                                                      const Checkpoint& checkpoint);

  GeneratorModel* generator() override { return this; }

  // Numbers of a code.
  std::int64_t noise() const { return config_.network.noise; }
  // Whether textures have learned: in the first stage only shapes do.
  bool has_textures() const { return textured_; }
  // Code `index` of those that `seed` stands for: standard normal, the same on every machine.
  std::vector<float> Code(std::uint64_t seed, std::uint64_t index) const;
  // codes: [n][noise()].
  Result<std::vector<Mesh>> Generate(std::span<const float> codes);

  ShapeTextureGenerator& network() { return generator_; }
  nn::Context& context() { return context_; }
  const GanConfig& config() const { return config_; }

 private:
  GeneratorModel(nn::Context& context, const GanConfig& config, bool textured);
  nn::Context& context_;
  GanConfig config_;
  bool textured_;
  ShapeTextureGenerator generator_;
};

// From one code to another along the great circle, as both lie far out on a sphere: `share` in
// [0, 1].
std::vector<float> BetweenCodes(std::span<const float> from, std::span<const float> to,
                                double share);

// What checkpoints keep of the generator that scored best, "best.shape..." and "best.texture...".
std::vector<nn::NamedTensor> KeptState(ShapeTextureGenerator& generator);
Status LoadKept(ShapeTextureGenerator& generator, const std::vector<nn::NamedTensor>& state);
Status LoadKeptShape(ShapeTextureGenerator& generator, const std::vector<nn::NamedTensor>& state);

// Pictures of generated objects for people: under the light of datasets.

struct SheetLook {
  int size = 128;      // pixels a side of each picture
  int columns = 8;     // pictures a row
  bool behind = true;  // also from behind: two pictures to an object
};

// From in front and above, turned by `azimuth` degrees more.
Camera SheetCamera(int size, double azimuth);
// A picture for each mesh.
Result<std::vector<ImageU8>> DrawObjects(std::span<const Mesh> meshes, const Camera& camera,
                                         int size, const Workers& workers);
Result<ImageU8> DrawSheet(std::span<const Mesh> meshes, const SheetLook& look,
                          const Workers& workers);

}  // namespace tilegrad::train
