// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/classify/perceptual_network.h"

#include <algorithm>

#include "base/error.h"
#include "nn/networks.h"
#include "nn/serialize.h"
#include "train/config.h"
#include "train/tasks/classify/model.h"

namespace tilegrad::train {
namespace {

Result<FeatureFunction> LoadClassifier(nn::Context& context, const PerceptualSource& source) {
  const std::string place = source.file.string();
  TILEGRAD_ASSIGN(const FoundCheckpoint found, FindCheckpoint(context, source.file));
  TILEGRAD_ASSIGN(const TrainConfig config, ParseConfig(found.checkpoint.info.config, place));
  if (config.kind != "classify")
    return InvalidArgument(
        "{}: its task.kind is \"{}\"; a perceptual loss takes a run of task.kind = \"classify\"",
        place, config.kind);
  auto loaded = config.task->LoadModel(context, found.checkpoint);
  if (!loaded.ok()) return loaded.status().Within(place);
  std::shared_ptr<Model> model = std::move(*loaded);
  const int skipped = std::max(source.first_level, 0);
  return FeatureFunction([model, skipped](const nn::Var& images) {
    auto levels = model->classifier()->network().Levels(images, nn::Mode::kEval);
    const auto first = std::min<std::ptrdiff_t>(skipped, std::ssize(levels) - 1);
    levels.erase(levels.begin(), levels.begin() + first);
    return levels;
  });
}

}  // namespace

Result<Path> PerceptualWeights(nn::Context& context, const PerceptualSource& source) {
  if (source.kind != "classify") return source.file;
  TILEGRAD_ASSIGN(const FoundCheckpoint found, FindCheckpoint(context, source.file));
  return found.file;
}

Result<FeatureFunction> LoadPerceptualNetwork(nn::Context& context,
                                              const PerceptualSource& source) {
  if (source.kind == "classify") return LoadClassifier(context, source);
  if (source.kind != "vgg16")
    return InvalidArgument(
        "the perceptual network is \"{}\", but must be \"classify\" or \"vgg16\"", source.kind);
  TILEGRAD_ASSIGN(const nn::TensorFile file, nn::ReadSafetensors(context, source.file));
  auto network = nn::Vgg16::Load(context, file.tensors);
  if (!network.ok()) return network.status().Within(source.file.string());
  return FeatureFunction(
      [network = std::move(*network)](const nn::Var& images) { return network.Features(images); });
}

}  // namespace tilegrad::train
