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

// Meshes of codes [n, noise] with the present weights of `generator`; grey unless `textured`.
// Normals are smooth.
Result<std::vector<Mesh>> GenerateMeshes(nn::Context& context, ShapeTextureGenerator& generator,
                                         const nn::Tensor& codes, bool textured);

class GeneratorModel : public Model {
 public:
  static Result<std::unique_ptr<GeneratorModel>> Load(nn::Context& context, const GanConfig& config,
                                                      const Checkpoint& checkpoint);

  GeneratorModel* generator() override { return this; }

  // Dimension of a code.
  std::int64_t noise() const { return config_.network.noise; }
  // Whether textures are trained: the first stage trains only shapes.
  bool has_textures() const { return textured_; }
  // Code `index` of the sequence of `seed`: standard normal, the same on every machine.
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

// Spherical interpolation from one code to another, since both lie near a large sphere; `share` in
// [0, 1].
std::vector<float> BetweenCodes(std::span<const float> from, std::span<const float> to,
                                double share);

// The generator that scored best, as checkpoints keep it: "best.shape..." and "best.texture...".
std::vector<nn::NamedTensor> KeptState(ShapeTextureGenerator& generator);
Status LoadKept(ShapeTextureGenerator& generator, const std::vector<nn::NamedTensor>& state);
Status LoadKeptShape(ShapeTextureGenerator& generator, const std::vector<nn::NamedTensor>& state);

// Pictures of generated objects for people, under the light of datasets.

struct SheetLook {
  int size = 128;      // pixels a side of each picture
  int columns = 8;     // pictures a row
  bool behind = true;  // also from behind: two pictures to an object
};

// From the front and above, turned by another `azimuth` degrees.
Camera SheetCamera(int size, double azimuth);
// A picture for each mesh.
Result<std::vector<ImageU8>> DrawObjects(std::span<const Mesh> meshes, const Camera& camera,
                                         int size, const Workers& workers);
Result<ImageU8> DrawSheet(std::span<const Mesh> meshes, const SheetLook& look,
                          const Workers& workers);

}  // namespace tilegrad::train
