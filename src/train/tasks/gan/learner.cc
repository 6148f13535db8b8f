// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/learner.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "nn/nn.h"
#include "train/tasks/gan/model.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kNoiseStream = 0x6e6f697365, kScoreStream = 0x73636f7265;
constexpr std::uint64_t kScoreNumber = std::uint64_t{1} << 40;  // apart from those of steps
constexpr float kNoScore = 1e30f;
constexpr double kCollapsed = 0.3;  // of the true pictures' spread

std::uint64_t SeedOf(const GanConfig& config) {
  return static_cast<std::uint64_t>(config.schedule.seed);
}

void CopyState(nn::Module& from, nn::Module& to) {
  // Both are of one shape, so nothing can be missing.
  (void)nn::LoadState(to, nn::State(from));
}

// Of the checkpointed state.
const std::string kShapePrefix = "shape.", kTexturePrefix = "texture.", kScoresName = "scores";

}  // namespace

GanLearner::GanLearner(nn::Context& context, const Job& job, const Sources& sources)
    : context_(context),
      config_(job.config),
      warn_(job.warn),
      sources_(sources),
      step_(context, config_, job.camera),
      generator_(context, config_.network, SeedOf(config_)),
      shown_(context, config_.network, SeedOf(config_)),
      kept_(context, config_.network, SeedOf(config_)),
      shape_(context, generator_.shape(), config_.optimizer, config_.StageSteps(true)),
      texture_(context, generator_.texture(), config_.optimizer, config_.StageSteps(false)),
      silhouettes_(context, JobOf(config_, GanCritic::kSilhouettes)),
      pictures_(context, JobOf(config_, GanCritic::kPictures)),
      real_(static_cast<std::size_t>(config_.schedule.portions)),
      fake_(static_cast<std::size_t>(config_.schedule.portions)) {
  if (config_.critic.texture_weight > 0)
    maps_.emplace(context, JobOf(config_, GanCritic::kTextures));
  scores_ = context.Zeros({kScores});
  nn::WithFloatType(scores_.dtype(), [&]<class T>(T) {
    scores_.data<T>()[kBestShape] = scores_.data<T>()[kBestTexture] = T(kNoScore);
  });
}

Result<std::unique_ptr<GanLearner>> GanLearner::Make(nn::Context& context, const Job& job,
                                                     const Sources& sources) {
  std::unique_ptr<GanLearner> out(new GanLearner(context, job, sources));
  TILEGRAD_ASSIGN(ObjectViews truth,
                  sources.pictures->Draw({kScoreNumber, static_cast<int>(job.config.score_count)}));
  const auto half_axes = MeanHalfAxes(truth, job.camera);
  for (ShapeTextureGenerator* generator : {&out->generator_, &out->shown_, &out->kept_})
    generator->SetEllipsoid(half_axes);
  out->watch_.emplace(std::move(truth), context.workers());
  if (sources.bank != nullptr) {
    const std::vector<float> mean = sources.bank->Mean();
    for (ShapeTextureGenerator* generator : {&out->generator_, &out->shown_, &out->kept_})
      generator->SetMeanMap(mean);
  }
  return out;
}

std::vector<LearnedCritic*> GanLearner::Critics(GanStage stage) {
  if (stage == GanStage::kShape) return {&silhouettes_};
  if (!maps_) return {&pictures_};
  return {&pictures_, &*maps_};
}

LearnedWeights& GanLearner::Weights(GanStage stage) {
  return stage == GanStage::kShape ? shape_ : texture_;
}

std::int64_t GanLearner::StageStep(std::int64_t step) const {
  return StageOf(step) == GanStage::kShape ? step : step - config_.shape_steps;
}

int GanLearner::Updates(std::int64_t step) {
  return 1 +
         static_cast<int>(config_.critic.updates) * static_cast<int>(Critics(StageOf(step)).size());
}

// The number of a draw: each round of the critics sees other objects, the first the generator's.
std::uint64_t GanLearner::NumberOf(const UpdateIndex& at, int round) const {
  const std::int64_t batch = at.step * config_.critic.updates + round;
  return static_cast<std::uint64_t>(batch * at.portion.count + at.portion.index);
}

Status GanLearner::DrawReal(const UpdateIndex& at, int round) {
  const auto count = static_cast<int>(CountOf(at));
  const std::uint64_t number = NumberOf(at, round);
  const auto batch_of = [&](const BatchIndex& of) {
    return RealPictures::Batch{NumberOf({of.step, 0, of.portion}, 0), count};
  };
  TILEGRAD_ASSIGN(ObjectViews views, round > 0 ? sources_.pictures->Draw({number, count})
                                               : sources_.pictures->Take(at, batch_of));
  Seen& real = real_[static_cast<std::size_t>(at.portion.index)];
  real = {};
  if (StageOf(at.step) == GanStage::kShape) {
    real.cover = std::move(views.cover);
    return {};
  }
  real.colors = std::move(views.colors);
  if (maps_) real.maps = sources_.bank->Draw(context_, number, count);
  return {};
}

GeneratedObjects GanLearner::Draw(const UpdateIndex& at, int round) {
  const nn::Tensor noise = step_.Noise(kNoiseStream, NumberOf(at, round), CountOf(at));
  GeneratedObjects out = step_.Draw(generator_, noise, StageOf(at.step), nn::Mode::kTrain);
  fake_[static_cast<std::size_t>(at.portion.index)] = {out.cover.value(), out.colors.value(),
                                                       out.maps.value()};
  return out;
}

Status GanLearner::DrawFake(const UpdateIndex& at, int round) {
  const nn::NoGrad off(context_);
  Draw(at, round);
  return context_.TakeStatus();
}

LearnedCritic::Pair GanLearner::PairOf(const LearnedCritic& critic, const Portion& portion) const {
  const Seen& real = real_[static_cast<std::size_t>(portion.index)];
  const Seen& fake = fake_[static_cast<std::size_t>(portion.index)];
  if (&critic == &silhouettes_) return {real.cover, fake.cover};
  if (&critic == &pictures_) return {real.colors, fake.colors};
  return {real.maps, fake.maps};
}

void GanLearner::AddAdversarialLoss(LearnedCritic* critic, const GeneratedObjects& objects,
                                    LossSum* sum) {
  const bool maps = maps_ && critic == &*maps_;
  const nn::Var& seen =
      critic == &silhouettes_ ? objects.cover : (maps ? objects.maps : objects.colors);
  critic->AddGeneratorLoss(maps ? config_.critic.texture_weight : 1, seen, sum);
}

Result<nn::StepVector<nn::Gradient>> GanLearner::GeneratorGradients(const UpdateIndex& at,
                                                                    StepValues* out) {
  const GanStage stage = StageOf(at.step);
  TILEGRAD_TRY(DrawReal(at, 0));
  const GeneratedObjects objects = Draw(at, 0);
  LossSum sum(out);
  for (LearnedCritic* critic : Critics(stage)) AddAdversarialLoss(critic, objects, &sum);
  if (stage == GanStage::kShape) step_.AddShapeLosses(generator_, objects.shapes, &sum);
  TILEGRAD_ASSIGN(auto gradients, Weights(stage).Gradients(sum.total(), at.listener, *out));
  sum.Watch("gradient_generator", "Norm of the generator's gradient",
            nn::GlobalNorm(context_, gradients));
  AddScores(&sum);
  out->also.emplace_back("learning_rate", Weights(stage).RateAt(StageStep(at.step)));
  out->images = CountOf(at) * config_.views;
  return gradients;
}

Result<nn::StepVector<nn::Gradient>> GanLearner::Backward(const UpdateIndex& at, StepValues* out) {
  if (at.update == 0) return GeneratorGradients(at, out);
  const auto critics = Critics(StageOf(at.step));
  const int round = (at.update - 1) / static_cast<int>(critics.size());
  const std::size_t which = static_cast<std::size_t>(at.update - 1) % critics.size();
  if (round > 0 && which == 0) {
    TILEGRAD_TRY(DrawReal(at, round));
    TILEGRAD_TRY(DrawFake(at, round));
  }
  LearnedCritic& critic = *critics[which];
  return critic.Gradients(PairOf(critic, at.portion), NumberOf(at, round), at.listener,
                          round == 0 ? out : nullptr);
}

Status GanLearner::Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) {
  const GanStage stage = StageOf(at.step);
  const auto critics = Critics(stage);
  if (at.update == 0) {
    TILEGRAD_TRY(Weights(stage).Update(gradients, StageStep(at.step), at.share));
  } else {
    const std::size_t which = static_cast<std::size_t>(at.update - 1) % critics.size();
    TILEGRAD_TRY(critics[which]->Update(gradients, StageStep(at.step), at.share));
  }
  if (at.update + 1 < Updates(at.step)) return {};
  const std::int64_t done = at.step + 1;
  const bool ends = done == config_.schedule.steps || done == config_.shape_steps;
  if (done % config_.score_every == 0 || ends) TILEGRAD_TRY(Score(done));
  return done == config_.shape_steps ? FreezeShapes() : Status();
}

Result<ShapeTextureGenerator*> GanLearner::Shown(std::int64_t steps) {
  const bool shaping = steps <= config_.shape_steps;
  if (shaping) {
    TILEGRAD_TRY(LoadPredictingWeights(shown_.shape(), shape_.State()));
  } else {
    CopyState(kept_.shape(), shown_.shape());
  }
  TILEGRAD_TRY(LoadPredictingWeights(shown_.texture(), texture_.State()));
  return &shown_;
}

Status GanLearner::Score(std::int64_t steps) {
  TILEGRAD_ASSIGN(ShapeTextureGenerator * generator, Shown(steps));
  const ObjectViews made =
      step_.Show(*generator, step_.Noise(kScoreStream, 0, config_.score_count));
  TILEGRAD_TRY(context_.TakeStatus());
  const GanStage stage = StageOf(steps - 1);
  TILEGRAD_ASSIGN(const Watched seen, watch_->Compare(made, stage));
  nn::WithFloatType(scores_.dtype(), [&]<class T>(T) {
    T* const scores = scores_.data<T>();
    scores[kDistance] = T(seen.distance);
    scores[kShapes] = T(seen.shapes);
    scores[kColors] = T(seen.colors);
    T& best = scores[stage == GanStage::kShape ? kBestShape : kBestTexture];
    if (scores[kDistance] >= best) return;
    best = scores[kDistance];
    CopyState(generator->shape(), kept_.shape());
    CopyState(generator->texture(), kept_.texture());
  });
  const bool textures = stage == GanStage::kTexture;
  const double spread = textures ? seen.colors : seen.shapes;
  if (warn_ && 2 * StageStep(steps - 1) > Weights(stage).steps() && spread < kCollapsed)
    warn_(
        fmt::format("step {}: the generator collapses: the spread of its {} is {:.0f} % of the "
                    "data's; a smaller optimizer.learning_rate or more critic.updates may help",
                    steps, textures ? "colours" : "shapes", 100 * spread));
  return {};
}

Status GanLearner::FreezeShapes() {
  CopyState(kept_.shape(), generator_.shape());
  return {};
}

void GanLearner::AddScores(LossSum* sum) const {
  nn::WithFloatType(scores_.dtype(), [&]<class T>(T) {
    const T* const scores = scores_.data<T>();
    const auto watch = [&](const char* name, const char* label, T score) {
      sum->Watch(name, label, static_cast<double>(score));
    };
    watch("distance",
          "Kernel distance to true pictures, times 1000; selects the generator that is kept",
          scores[kDistance]);
    watch("spread_shapes", "Spread of shapes, as a share of the data's", scores[kShapes]);
    watch("spread_colors", "Spread of colours, as a share of the data's", scores[kColors]);
  });
}

std::int64_t GanLearner::parameters() {
  return nn::CountParameters(generator_.shape()) + nn::CountParameters(generator_.texture());
}

Status GanLearner::StartAs(const std::vector<nn::NamedTensor>& state) {
  TILEGRAD_TRY(LoadKeptShape(kept_, state));
  CopyState(kept_.shape(), generator_.shape());
  return {};
}

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
