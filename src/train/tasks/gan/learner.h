// SPDX-License-Identifier: Apache-2.0
// GAN training of section 5.5: a step is one update of the generator and then some of each critic
// of its stage. Also keeps the generator that scored best.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "train/tasks/adversary.h"
#include "train/tasks/gan/config.h"
#include "train/tasks/gan/real_samples.h"
#include "train/tasks/gan/step.h"
#include "train/tasks/gan/watch.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

class GanLearner {
 public:
  struct Job {
    const GanConfig& config;
    const CameraRule& camera;
    const WarningSink& warn;
  };
  // What it learns from; outlives the learner. `bank` is null if no textures are trained.
  struct Sources {
    RealPictures* pictures;
    const TextureBank* bank;
  };
  static Result<std::unique_ptr<GanLearner>> Make(nn::Context& context, const Job& job,
                                                  const Sources& sources);

  GanStage StageOf(std::int64_t step) const {
    return step < config_.shape_steps ? GanStage::kShape : GanStage::kTexture;
  }
  int Updates(std::int64_t step);
  Result<nn::StepVector<nn::Gradient>> Backward(const UpdateIndex& at, StepValues* out);
  // The last update of a step also scores, keeps the best, and freezes the shapes at the end of
  // their stage.
  Status Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients);

  std::vector<nn::NamedTensor> State();
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps);
  // What Backward changes besides its gradients.
  std::vector<nn::NamedTensor> Statistics();
  // Starts with the best shapes that another run kept.
  Status StartAs(const std::vector<nn::NamedTensor>& state);

  // The generator with the moving averages of its weights.
  Result<ShapeTextureGenerator*> Shown(std::int64_t steps);
  std::int64_t parameters();
  GanStep& step() { return step_; }
  const GanWatch& watch() const { return *watch_; }

 private:
  GanLearner(nn::Context& context, const Job& job, const Sources& sources);
  std::vector<LearnedCritic*> Critics(GanStage stage);
  std::int64_t StageStep(std::int64_t step) const;
  LearnedWeights& Weights(GanStage stage);
  Status DrawReal(const UpdateIndex& at, int round);
  Status DrawFake(const UpdateIndex& at, int round);
  GeneratedObjects Draw(const UpdateIndex& at, int round);
  LearnedCritic::Pair PairOf(const LearnedCritic& critic, const Portion& portion) const;
  Result<nn::StepVector<nn::Gradient>> GeneratorGradients(const UpdateIndex& at, StepValues* out);
  void AddAdversarialLoss(LearnedCritic* critic, const GeneratedObjects& objects, LossSum* sum);
  std::uint64_t NumberOf(const UpdateIndex& at, int round) const;
  std::int64_t CountOf(const UpdateIndex& at) const { return config_.batch / at.portion.count; }
  Status Score(std::int64_t steps);
  Status FreezeShapes();
  void AddScores(LossSum* sum) const;

  nn::Context& context_;
  GanConfig config_;
  WarningSink warn_;
  Sources sources_;
  GanStep step_;
  ShapeTextureGenerator generator_, shown_, kept_;
  LearnedWeights shape_, texture_;
  LearnedCritic silhouettes_, pictures_;
  std::optional<LearnedCritic> maps_;
  std::optional<GanWatch> watch_;
  // From the last update of the generator or from this round of the critics, by portion.
  struct Seen {
    nn::Tensor cover, colors, maps;
  };
  std::vector<Seen> real_, fake_;
  // Best distance of each stage; distance, and spread of shapes and colours, when last scored.
  enum { kBestShape, kBestTexture, kDistance, kShapes, kColors, kScores };
  nn::Tensor scores_;
};

}  // namespace tilegrad::train
