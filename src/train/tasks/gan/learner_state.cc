// SPDX-License-Identifier: Apache-2.0
// What a checkpoint has of a GanLearner.
#include <algorithm>

#include "base/error.h"
#include "nn/nn.h"
#include "train/tasks/gan/learner.h"
#include "train/tasks/gan/model.h"

namespace tilegrad::train {
namespace {

const std::string kShapePrefix = "shape.", kTexturePrefix = "texture.", kScoresName = "scores";

}  // namespace

std::vector<nn::NamedTensor> GanLearner::State() {
  std::vector<nn::NamedTensor> out = WithPrefix(kShapePrefix, shape_.State());
  Append(WithPrefix(kTexturePrefix, texture_.State()), &out);
  for (LearnedCritic* critic : {&silhouettes_, &pictures_}) Append(critic->State(), &out);
  if (maps_) Append(maps_->State(), &out);
  Append(KeptState(kept_), &out);
  out.push_back({kScoresName, scores_});
  return out;
}

Status GanLearner::LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) {
  const std::int64_t shape = std::min(steps, config_.shape_steps), texture = steps - shape;
  const std::int64_t updates = config_.critic.updates;
  TILEGRAD_TRY(shape_.LoadState(OfPrefix(kShapePrefix, state), shape));
  TILEGRAD_TRY(texture_.LoadState(OfPrefix(kTexturePrefix, state), texture));
  TILEGRAD_TRY(silhouettes_.LoadState(state, shape * updates));
  TILEGRAD_TRY(pictures_.LoadState(state, texture * updates));
  if (maps_) TILEGRAD_TRY(maps_->LoadState(state, texture * updates));
  TILEGRAD_TRY(LoadKept(kept_, state));
  return nn::CopyByName(state, {{kScoresName, scores_}});
}

std::vector<nn::NamedTensor> GanLearner::Statistics() {
  std::vector<nn::NamedTensor> out;
  std::vector<nn::Module*> networks = {&generator_.shape(), &generator_.texture()};
  for (LearnedCritic* critic : {&silhouettes_, &pictures_}) networks.push_back(&critic->network());
  if (maps_) networks.push_back(&maps_->network());
  for (nn::Module* network : networks) Append(nn::Buffers(*network), &out);
  return out;
}

}  // namespace tilegrad::train
