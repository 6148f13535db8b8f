// SPDX-License-Identifier: Apache-2.0
#include "train/trainer.h"

#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/text.h"
#include "train/ranks/gradient_sums.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

constexpr std::int64_t kEnd = -1;     // the order after the last step
constexpr std::int64_t kGather = -2;  // the order to bring moments to rank 0

// The loss of an update that does not compute it.
constexpr double kNoLoss = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kBeforeTerms = 3;  // numbers: loss, images, stream seconds

// An update by portions of the batch, on one process or many ranks: the same bits. Portions of a
// process are computed side by side by the lanes of its context.
class PortionedUpdate {
 public:
  struct Parts {
    nn::Context& context;
    Task& task;
    ProcessGroup* group;  // of all ranks, or null
  };
  // `group`: of all ranks, or null. InvalidArgument where the task or the number of ranks do not
  // allow so many portions.
  static Result<std::unique_ptr<PortionedUpdate>> Make(nn::Context& context, Task& task,
                                                       std::int64_t portions, ProcessGroup* group) {
    Transport* const ranks = group ? &group->ranks() : nullptr;
    if (ranks && ranks->size() > portions)
      return InvalidArgument(
          "{} ranks cannot share {} of a batch: set schedule.portions to a power of two that is "
          "not smaller, or start fewer ranks",
          ranks->size(), Count(portions, "portion"));
    if (context.dtype() != nn::DType::kF32) return InternalError("portions are summed in F32");
    TILEGRAD_ASSIGN(auto statistics, task.Statistics());
    const GradientSums::Shape shape{.portions = portions, .ranks = ranks};
    auto sums = std::make_unique<GradientSums>(context, shape, std::move(statistics));
    return std::unique_ptr<PortionedUpdate>(
        new PortionedUpdate({context, task, group}, shape, std::move(sums)));
  }

  // Task::Backward of this rank's portions, the means of all, Task::Update. `values` are those of
  // the whole batch on rank 0; elsewhere they mean nothing. at.next: of a step that follows.
  Status Run(const UpdateIndex& at, StepValues* values) {
    sums_->BeginUpdate();
    value_sums_.BeginUpdate();
    Status status = Backward(at);
    if (status.ok()) status = Finish(values);
    if (!status.ok()) {
      sums_->GiveUp();
      return status;
    }
    return Update(at, values);
  }

  // Moments of optimisers that are spread over ranks come to rank 0. Every rank calls it where
  // HasMoments, which is the same on all.
  bool HasMoments() const { return sums_->share() && sums_->share()->HasMoments(); }
  void GatherMoments() { sums_->share()->GatherMoments(); }

 private:
  // What a lane's portions have come to.
  struct LaneWork {
    Status status;
    std::vector<StepValues> values;  // of its portions
  };

  PortionedUpdate(const Parts& parts, const GradientSums::Shape& shape,
                  std::unique_ptr<GradientSums> sums)
      : context_(parts.context),
        task_(parts.task),
        group_(parts.group),
        portions_(shape.portions),
        sums_(std::move(sums)),
        value_sums_(shape.portions, shape.ranks),
        work_(sums_->lanes().size()) {
    for (std::size_t i = 0; i < work_.size(); ++i)
      work_[i].values.resize(sums_->lanes()[i]->portions().size());
  }

  Status Update(UpdateIndex at, StepValues* values) {
    WeightShare* const share = sums_->share();
    at.share = share;
    const Status status = task_.Update(at, sums_->means());
    TILEGRAD_TRY(group_error_);
    TILEGRAD_TRY(status);
    if (!share) return {};
    if (!share->finished()) return InternalError("Task::Update gave no share to its optimizer");
    values->wait_seconds += share->seconds_waited();
    return {};
  }

  Status Backward(const UpdateIndex& at) {
    context_.ForEachLane([&](std::size_t i) {
      work_[i].status = BackwardOf(*sums_->lanes()[i], at, &work_[i].values);
    });
    for (const LaneWork& work : work_) TILEGRAD_TRY(work.status);
    for (const LaneWork& work : work_) {
      for (const StepValues& values : work.values) AddValues(values);
    }
    return {};
  }

  // Of all portions of a lane.
  Status BackwardOf(GradientSums::Lane& lane, UpdateIndex at, std::vector<StepValues>* values) {
    at.listener = lane.listener();
    const std::optional<BatchIndex> following = at.next;
    for (std::size_t i = 0; i < lane.portions().size(); ++i) {
      at.portion = {lane.portions()[i], portions_};
      at.next = NextAfter(lane, i, {at.step, following});
      StepValues& portion = values->at(i);
      portion.Clear();
      portion.loss = kNoLoss;
      lane.BeginPortion(i);
      TILEGRAD_ASSIGN(const auto gradients, task_.Backward(at, &portion));
      lane.EndPortion(gradients);
      TILEGRAD_TRY(context_.TakeStatus());
    }
    return {};
  }

  struct Following {
    std::int64_t step;               // the current one
    std::optional<BatchIndex> next;  // of the following step
  };
  // The batch after a lane's portion number i of a step: its next one, or its first one of the
  // following step.
  std::optional<BatchIndex> NextAfter(const GradientSums::Lane& lane, std::size_t i,
                                      Following following) const {
    const auto& own = lane.portions();
    if (i + 1 < own.size()) return BatchIndex{following.step, {own[i + 1], portions_}};
    if (following.next) following.next->portion = {own[0], portions_};
    return following.next;
  }

  void AddValues(const StepValues& of) {
    numbers_ = {of.loss, static_cast<double>(of.images), of.stream_seconds};
    for (const LossTerm& term : of.terms) numbers_.push_back(term.value);
    value_sums_.Add(numbers_);
  }

  Status Finish(StepValues* values) {
    const auto all_is_well = [this] {
      if (group_ && group_->leads()) group_error_ = group_->ReportedError();
      return group_error_.ok();
    };
    if (!sums_->Finish(all_is_well)) return group_error_;
    const std::span<const double> numbers = value_sums_.Finish(all_is_well);
    TILEGRAD_TRY(group_error_);
    if (group_) {
      values->wait_seconds += sums_->seconds_waited();
      values->summed_numbers += static_cast<double>(sums_->numbers());
    }
    if (!numbers.empty()) TakeValues(numbers, values);
    return {};
  }

  void TakeValues(std::span<const double> sums, StepValues* values) const {
    const auto count = static_cast<double>(portions_);
    if (std::isfinite(sums[0])) values->loss = sums[0] / count;
    values->images += static_cast<std::int64_t>(sums[1]);
    values->stream_seconds += sums[2];
    const StepValues& last = work_.back().values.back();
    for (std::size_t i = 0; i < last.terms.size(); ++i) {
      values->terms.push_back(last.terms[i]);
      values->terms.back().value = sums[kBeforeTerms + i] / count;
    }
    values->also.insert(values->also.end(), last.also.begin(), last.also.end());
  }

  nn::Context& context_;
  Task& task_;
  ProcessGroup* group_;
  std::int64_t portions_;
  std::unique_ptr<GradientSums> sums_;
  ValueSums value_sums_;
  Status group_error_;           // of another rank, in the middle of an update
  std::vector<LaneWork> work_;   // of each lane
  std::vector<double> numbers_;  // of a portion: loss, images, stream seconds, terms
};

class Training : public RunWork {
 public:
  Training(const TrainJob& job, TrainConfig* config)
      : job_(job), config_(*config), task_(*config->task) {}

  Result<std::string> ResultSettings(const std::string& settings,
                                     const std::string& place) const override {
    TILEGRAD_ASSIGN(TrainConfig config, ParseConfig(settings, place));
    return train::ResultSettings(config.Fields());
  }

  Status Begin(std::int64_t first_step) override {
    // First: a run that is killed from here on is one to resume.
    TILEGRAD_TRY(WriteTextAtomic(job_.run / kTrainSettings, WriteConfig(config_)));
    header_ = task_.Header();
    header_.name = config_.name;
    header_.dataset = job_.data.string();
    header_.machine = DescribeMachine();
    // Before the task's files, for which the disk may be full: --resume finds the dataset by it.
    if (first_step == 0) TILEGRAD_TRY(WriteHeader(job_.run, header_));
    TILEGRAD_TRY(task_.Begin(job_.run, first_step));
    const auto before = ReadHeader(job_.run);
    if (first_step > 0 && before.ok()) header_.labels = before->labels;
    TILEGRAD_TRY(WriteHeader(job_.run, header_));
    if (job_.begun) TILEGRAD_TRY(job_.begun());
    if (job_.group) ShareState(first_step);
    return {};
  }

  Status Step(std::int64_t step, StepValues* values) override {
    if (job_.group) job_.group->Order(step);
    Status status = Updates(step, values);
    if (!status.ok() && job_.group) job_.group->Break();
    return status.ok() ? NoteLabels(values->terms) : status;
  }

  // Data, networks and all else; on every rank.
  Status Start(nn::Context& context, const Watch& watch) {
    context.MakeLanes(GradientSums::MostLanes(
        {config_.schedule.portions, job_.group ? &job_.group->ranks() : nullptr}));
    TILEGRAD_TRY(task_.Start({context, config_.schedule, job_.data, watch, job_.warn}));
    TILEGRAD_TRY(context.TakeStatus());
    if (!job_.group && config_.schedule.portions == 1) return {};
    TILEGRAD_ASSIGN(portioned_,
                    PortionedUpdate::Make(context, task_, config_.schedule.portions, job_.group));
    return {};
  }

  Result<std::string> Fingerprint(const Workers& workers) const {
    return task_.Fingerprint(job_.data, workers);
  }

  // The run of a rank other than 0.
  RunOutcome Follow(nn::Context& context) {
    const std::int64_t first_step = job_.group->AwaitOrder();
    if (first_step == kEnd) return {};
    if (const Status taken = TakeState(context, first_step); !taken.ok())
      job_.group->ReportError(taken);
    RunOutcome outcome{first_step, first_step};
    StepValues values;
    for (std::int64_t step = job_.group->AwaitOrder(); step != kEnd;
         step = job_.group->AwaitOrder()) {
      if (step == kGather) {
        portioned_->GatherMoments();
        continue;
      }
      values.Clear();
      const Status done = Updates(step, &values);
      if (!done.ok()) job_.group->ReportError(done.Within(fmt::format("step {}", step)));
      outcome.last_step = step + 1;
    }
    return outcome;
  }

  std::vector<nn::NamedTensor> State() override {
    if (job_.group && portioned_->HasMoments()) {
      job_.group->Order(kGather);
      portioned_->GatherMoments();
    }
    return task_.State();
  }
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override {
    return task_.LoadState(state, steps);
  }

  bool HasPicture(std::int64_t steps) const override {
    return SampleIsDue(config_.schedule, steps);
  }
  Result<ImageU8> Picture(std::int64_t steps) override { return task_.SamplePicture(steps); }

  // Waits for all work beside the steps.
  void Settle() { task_.Settle(); }

  // The computing of a step.
  Status Updates(std::int64_t step, StepValues* values) {
    for (int update = 0; update < task_.Updates(step); ++update) {
      UpdateIndex at{step, update};
      if (step + 1 < config_.schedule.steps) at.next = BatchIndex{step + 1};
      if (portioned_) {
        TILEGRAD_TRY(portioned_->Run(at, values));
        continue;
      }
      TILEGRAD_ASSIGN(const auto gradients, task_.Backward(at, values));
      TILEGRAD_TRY(task_.Update(at, gradients));
    }
    return {};
  }

 private:
  // Terms may begin in the middle of a run.
  Status NoteLabels(std::span<const LossTerm> terms) {
    const std::size_t known = header_.labels.size();
    for (const LossTerm& term : terms) {
      if (*term.label != '\0') header_.labels.emplace(term.name, term.label);
    }
    return header_.labels.size() == known ? Status() : WriteHeader(job_.run, header_);
  }
  void ShareState(std::int64_t first_step) {
    job_.group->Order(first_step);
    std::vector<nn::NamedTensor> state = task_.State();
    job_.group->Share(&state);
  }
  Status TakeState(nn::Context& context, std::int64_t first_step) {
    std::vector<nn::NamedTensor> state = task_.State();
    for (nn::NamedTensor& t : state) t.value = context.Copy(t.value);
    job_.group->Share(&state);
    return task_.LoadState(state, first_step);
  }

  const TrainJob& job_;
  TrainConfig& config_;
  Task& task_;
  RunHeader header_;
  std::unique_ptr<PortionedUpdate> portioned_;  // without: the batch is one portion, as it comes
};

// With other ranks that agree; an error is that of all.
Status StartTogether(const RunPlan& plan, const TrainJob& job, const Workers& workers,
                     Training* training, const std::function<Status()>& start) {
  TILEGRAD_ASSIGN(const std::string settings,
                  training->ResultSettings(plan.settings, "configuration"));
  const Status ready = job.group->leads() ? CheckExistingRun(plan, *training) : Status();
  TILEGRAD_TRY(job.group->Agree(ready, CommonTraits(settings)));
  Status started = start();
  Trait data{"dataset", "",
             fmt::format("{}, and runs that the configuration names, must hold the same files "
                         "everywhere",
                         job.data.string())};
  if (started.ok()) {
    auto fingerprint = training->Fingerprint(workers);
    started = fingerprint.status();
    if (started.ok()) data.value = *fingerprint;
  }
  return job.group->Agree(started, {data});
}

class TrainingRehearsal : public Rehearsal {
 public:
  TrainingRehearsal(const TrainJob& job, TrainConfig config, const Workers& workers)
      : config_(std::move(config)), context_(workers), training_(job, &config_) {}

  Status Start(const Watch& watch) { return training_.Start(context_, watch); }
  Status Step() override {
    values_.Clear();
    TILEGRAD_TRY(training_.Updates(step_++, &values_));
    training_.Settle();
    return {};
  }

 private:
  TrainConfig config_;
  nn::Context context_;
  Training training_;
  StepValues values_;
  std::int64_t step_ = 0;
};

}  // namespace

Result<std::unique_ptr<Rehearsal>> Rehearse(const TrainJob& job, const Workers& workers,
                                            const Watch& watch) {
  TILEGRAD_ASSIGN(TrainConfig config, ParseConfig(WriteConfig(job.config), "configuration"));
  auto rehearsal = std::make_unique<TrainingRehearsal>(job, std::move(config), workers);
  TILEGRAD_TRY(rehearsal->Start(watch));
  return std::unique_ptr<Rehearsal>(std::move(rehearsal));
}

Result<RunOutcome> Train(const TrainJob& job, const Workers& workers, const Watch& watch) {
  RunPlan plan{.stage = "training",
               .folder = job.run,
               .settings = WriteConfig(job.config),
               .pictures = "samples/step_",
               .schedule = job.config.schedule,
               .existing = job.existing,
               .may_differ = job.extends ? "schedule.steps" : "",
               .max_minutes = job.max_minutes,
               .warn = job.warn,
               .drawn = job.drawn};
  nn::Context context(workers);
  // A separate task: that of the job stays unchanged for the next call.
  TILEGRAD_ASSIGN(TrainConfig config, ParseConfig(plan.settings, "configuration"));
  Training training(job, &config);
  const auto start = [&] { return training.Start(context, watch); };
  if (job.group) {
    TILEGRAD_TRY(StartTogether(plan, job, workers, &training, start));
    if (!job.group->leads()) return training.Follow(context);
  } else {
    TILEGRAD_TRY(CheckExistingRun(plan, training));
    TILEGRAD_TRY(start());
  }
  plan.image_size = config.task->image_size();
  plan.half_extent = config.task->half_extent();
  auto outcome = ExecuteRun(plan, &training, context, watch);
  if (job.group && !job.group->broken()) job.group->Order(kEnd);
  return outcome;
}

}  // namespace tilegrad::train
