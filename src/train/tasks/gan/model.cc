// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/model.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/try_all.h"
#include "nn/nn.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "scene/shapes.h"
#include "train/data/dataset.h"
#include "train/tasks/gan/learner.h"

namespace tilegrad::train {
namespace {

const std::string kShape = "best.shape.", kTexture = "best.texture.";
constexpr std::uint64_t kCodeStream = 0x73616d706c65;

constexpr double kFromFront = 50, kFromBehind = 230, kElevation = 20;  // degrees
constexpr double kNearer = 0.8;                                        // than cameras of datasets

}  // namespace

Result<std::vector<Mesh>> GenerateMeshes(nn::Context& context, ShapeTextureGenerator& generator,
                                         const nn::Tensor& codes, bool textured) {
  const nn::NoGrad off(context);
  const nn::Var code = nn::Constant(context, codes);
  Prediction made = generator.MakeShapes(code, nn::Mode::kEval);
  if (textured) made.textures = generator.Textures(generator.MakeMaps(code, nn::Mode::kEval));
  TILEGRAD_TRY(context.TakeStatus());
  std::vector<Mesh> meshes;
  for (std::size_t i = 0; i < static_cast<std::size_t>(codes.shape()[0]); ++i) {
    TILEGRAD_ASSIGN(Mesh mesh, MeshOf(generator.sphere(), made, i));
    if (!textured) mesh.materials = {{.name = "shape", .base_color = {0.7f, 0.7f, 0.7f, 1.0f}}};
    mesh.normals = SmoothNormals(mesh);
    meshes.push_back(std::move(mesh));
  }
  return meshes;
}

GeneratorModel::GeneratorModel(nn::Context& context, const GanConfig& config, bool textured)
    : context_(context),
      config_(config),
      textured_(textured),
      generator_(context, config.network, /*seed=*/0) {
  template_ = generator_.sphere().mesh();
  parameters_ = nn::CountParameters(generator_.shape()) + nn::CountParameters(generator_.texture());
}

Result<std::unique_ptr<GeneratorModel>> GeneratorModel::Load(nn::Context& context,
                                                             const GanConfig& config,
                                                             const Checkpoint& checkpoint) {
  TILEGRAD_TRY(CheckGenerator(config.network));
  const bool textured = checkpoint.info.step > config.shape_steps;
  std::unique_ptr<GeneratorModel> model(new GeneratorModel(context, config, textured));
  TILEGRAD_TRY(context.TakeStatus());
  TILEGRAD_TRY(LoadKept(model->generator_, checkpoint.tensors));
  model->weights_ = KeptState(model->generator_);
  return model;
}

std::vector<float> GeneratorModel::Code(std::uint64_t seed, std::uint64_t index) const {
  Rng rng(seed ^ kCodeStream, index);
  std::vector<float> code(static_cast<std::size_t>(noise()));
  for (float& x : code) x = static_cast<float>(rng.Normal());
  return code;
}

Result<std::vector<Mesh>> GeneratorModel::Generate(std::span<const float> codes) {
  const std::int64_t count = static_cast<std::int64_t>(codes.size()) / noise();
  return GenerateMeshes(context_, generator_, context_.From({count, noise()}, codes), textured_);
}

std::vector<float> BetweenCodes(std::span<const float> from, std::span<const float> to,
                                double share) {
  double dot = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    dot += double{from[i]} * to[i];
    aa += double{from[i]} * from[i];
    bb += double{to[i]} * to[i];
  }
  const double angle = std::acos(std::clamp(dot / std::sqrt(std::max(aa * bb, 1e-30)), -1.0, 1.0));
  double a = 1 - share, b = share;
  if (std::sin(angle) > 1e-6) {
    a = std::sin((1 - share) * angle) / std::sin(angle);
    b = std::sin(share * angle) / std::sin(angle);
  }
  std::vector<float> out(from.size());
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = static_cast<float>(a * double{from[i]} + b * double{to[i]});
  return out;
}

std::vector<nn::NamedTensor> KeptState(ShapeTextureGenerator& generator) {
  auto out = WithPrefix(kShape, nn::State(generator.shape()));
  Append(WithPrefix(kTexture, nn::State(generator.texture())), &out);
  return out;
}

Status LoadKept(ShapeTextureGenerator& generator, const std::vector<nn::NamedTensor>& state) {
  TILEGRAD_TRY(LoadKeptShape(generator, state));
  return nn::LoadState(generator.texture(), OfPrefix(kTexture, state));
}

Status LoadKeptShape(ShapeTextureGenerator& generator, const std::vector<nn::NamedTensor>& state) {
  return nn::LoadState(generator.shape(), OfPrefix(kShape, state));
}

Camera SheetCamera(int size, double azimuth) {
  const CameraRule rule;
  Lens lens = rule.lens;
  lens.width = lens.height = size;
  return OrbitCamera(lens, kFromFront + azimuth, kElevation, kNearer * rule.distance);
}

Result<std::vector<ImageU8>> DrawObjects(std::span<const Mesh> meshes, const Camera& camera,
                                         int size, const Workers& workers) {
  std::vector<LitRenderer> renderers(static_cast<std::size_t>(workers.count()));
  std::vector<ImageU8> out(meshes.size());
  const auto draw = [&](std::size_t i, std::size_t worker) -> Status {
    TILEGRAD_ASSIGN(const auto planes, renderers[worker].Render(meshes[i], {&camera, 1}, size));
    out[i] = OnPaper(planes, size);
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, meshes.size(), draw));
  return out;
}

Result<ImageU8> DrawSheet(std::span<const Mesh> meshes, const SheetLook& look,
                          const Workers& workers) {
  TILEGRAD_ASSIGN(auto front, DrawObjects(meshes, SheetCamera(look.size, 0), look.size, workers));
  if (!look.behind) return TileImages(front, look.columns, 2);
  TILEGRAD_ASSIGN(auto behind, DrawObjects(meshes, SheetCamera(look.size, kFromBehind - kFromFront),
                                           look.size, workers));
  std::vector<ImageU8> cells;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    cells.push_back(std::move(front[i]));
    cells.push_back(std::move(behind[i]));
  }
  return TileImages(cells, look.columns, 2);
}

}  // namespace tilegrad::train
