// SPDX-License-Identifier: Apache-2.0
#include "train/trainer.h"

#include "base/error.h"
#include "train/run/machine.h"

namespace tilegrad::train {
namespace {

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
    TILEGRAD_TRY(task_.Begin(job_.run, first_step));
    RunHeader header = task_.Header();
    header.name = config_.name;
    header.dataset = job_.data.string();
    header.machine = DescribeMachine();
    TILEGRAD_TRY(WriteHeader(job_.run, header));
    return WriteTextAtomic(job_.run / "config.toml", WriteConfig(config_));
  }

  Status Step(std::int64_t step, StepValues* values) override {
    for (int update = 0; update < task_.Updates(step); ++update) {
      const UpdateIndex at{step, update};
      TILEGRAD_ASSIGN(const auto gradients, task_.Backward(at, values));
      TILEGRAD_TRY(task_.Update(at, gradients));
    }
    return {};
  }

  std::vector<nn::NamedTensor> State() override { return task_.State(); }
  Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) override {
    return task_.LoadState(state, steps);
  }

  bool HasPicture(std::int64_t steps) const override {
    const Schedule& s = config_.schedule;
    return steps > 0 && (steps % s.sample_every == 0 || steps == s.steps);
  }
  Result<ImageU8> Picture(std::int64_t steps) override { return task_.SamplePicture(steps); }

 private:
  const TrainJob& job_;
  TrainConfig& config_;
  Task& task_;
};

}  // namespace

Result<RunOutcome> Train(const TrainJob& job, const Workers& workers, const ProgressSink& progress,
                         const StopFlag& stop) {
  RunPlan plan{.stage = "training",
               .folder = job.run,
               .settings = WriteConfig(job.config),
               .pictures = "samples/step_",
               .schedule = job.config.schedule,
               .existing = job.existing,
               .may_differ = job.extends ? "schedule.steps" : "",
               .max_minutes = job.max_minutes,
               .warn = job.warn};
  nn::Context context(workers);
  // A task of its own: that of the job stays as it is, for the next call.
  TILEGRAD_ASSIGN(TrainConfig config, ParseConfig(plan.settings, "configuration"));
  Training training(job, &config);
  TILEGRAD_TRY(CheckExistingRun(plan, training));
  TILEGRAD_TRY(config.task->Start({context, config.schedule, job.data, progress, stop, job.warn}));
  TILEGRAD_TRY(context.TakeStatus());
  plan.image_size = config.task->image_size();
  return ExecuteRun(plan, &training, context, progress, stop);
}

}  // namespace tilegrad::train
