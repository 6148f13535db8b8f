// SPDX-License-Identifier: Apache-2.0
#include "train/trainer.h"

#include <chrono>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "base/folder_lock.h"
#include "io/image_file.h"
#include "nn/nn.h"
#include "train/run/checkpoint.h"
#include "train/run/first_difference.h"
#include "train/run/log.h"
#include "train/run/machine.h"
#include "train/run/trained_models.h"
#include "train/tasks/single_image/sample_images.h"
#include "train/tasks/single_image/step.h"

namespace tilegrad::train {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kSampleRows = 8, kSampleViews = 3;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The parts of a configuration that the future of a run depends on, as text.
std::string FateOf(TrainConfig config) {
  const ScheduleConfig defaults;
  config.name.clear();
  config.schedule.log_every = defaults.log_every;
  config.schedule.sample_every = defaults.sample_every;
  config.schedule.checkpoint_every = defaults.checkpoint_every;
  config.schedule.keep_checkpoints = defaults.keep_checkpoints;
  return WriteConfig(config);
}

// The settings of a configuration without the comments beside them.
std::string WithoutComments(const std::string& text) {
  std::string out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::string setting = line.substr(0, line.find("  #"));
    out += setting.substr(0, setting.find_last_not_of(' ') + 1) + "\n";
  }
  return out;
}

class Run {
 public:
  Run(const TrainJob& job, const Workers& workers, const ProgressSink& progress,
      const StopFlag& stop)
      : job_(job), workers_(workers), progress_(progress), stop_(stop), context_(workers) {}

  Result<TrainOutcome> Execute();

 private:
  Status Prepare();
  Status CheckExisting() const;
  Status Restore();
  Status LoadData();
  Status WriteHeader();
  Status Loop();
  Status OneStep();
  Status Log(const LossValues& values);
  Status DrawSamples();
  Status Save();
  double Seconds() const { return seconds_before_ + SecondsSince(loop_start_); }
  bool OutOfTime() const {
    return job_.max_minutes > 0 && SecondsSince(loop_start_) > 60 * job_.max_minutes;
  }

  const TrainJob& job_;
  const Workers& workers_;
  const ProgressSink& progress_;
  const StopFlag& stop_;
  FolderLock lock_;
  nn::Context context_;
  std::optional<Dataset> dataset_;
  ImageStore train_, held_out_;
  std::vector<Sample> samples_;
  std::optional<TrainStep> step_;
  std::optional<BatchOrder> order_;
  std::optional<RunLog> log_;
  TrainOutcome outcome_;
  double seconds_before_ = 0;
  std::int64_t saved_step_ = -1;
  Clock::time_point loop_start_, last_log_;
  std::int64_t last_logged_step_ = 0;
  std::string note_;
};

// Of what `place` holds.
Status CheckSame(const TrainConfig& before, const TrainConfig& config, const Path& place) {
  const std::string then = FateOf(before), now = FateOf(config);
  if (then == now) return {};
  return InvalidArgument(
      "{}: this run was started with another configuration: {}; resume with the same, or give "
      "another --out",
      place.string(), FirstDifference(WithoutComments(then), WithoutComments(now)));
}

Status Run::CheckExisting() const {
  const Path config_file = job_.run / "config.toml";
  const bool started = std::filesystem::exists(config_file);
  // Checkpoints alone are a run, too, or a fit.
  if ((started || !ListCheckpoints(job_.run).empty()) && job_.existing == ExistingRun::kRefuse) {
    return InvalidArgument(
        "{}: already holds a run; give --resume to go on with it, or another --out",
        job_.run.string());
  }
  if (!started) return {};
  TILEGRAD_ASSIGN(const TrainConfig before, ReadConfig(config_file));
  return CheckSame(before, job_.config, job_.run);
}

Status Run::LoadData() {
  TILEGRAD_ASSIGN(dataset_, Dataset::Open(job_.data));
  const std::vector<int> train = dataset_->Select(Split::kTrain);
  std::vector<int> test = dataset_->Select(Split::kTest);
  const ScheduleConfig& s = job_.config.schedule;
  if (train.empty()) return InvalidArgument("{}: no training models in it", job_.data.string());
  if (s.views > dataset_->info().views) {
    return InvalidArgument("schedule.views is {}, but the dataset has {} views a model", s.views,
                           dataset_->info().views);
  }
  if (dataset_->info().image_size % 8 != 0) {
    return InvalidArgument("{}: images are {} pixels a side; the network needs a multiple of 8",
                           job_.data.string(), dataset_->info().image_size);
  }
  // The pictures show models spread over the held-out ones, which stand in the order of their
  // classes.
  if (test.size() > kSampleRows) {
    for (std::size_t i = 0; i < kSampleRows; ++i) test[i] = test[i * test.size() / kSampleRows];
    test.resize(kSampleRows);
  }
  TILEGRAD_ASSIGN(train_, LoadImageStore(*dataset_, train, workers_, progress_, stop_));
  TILEGRAD_ASSIGN(held_out_, LoadImageStore(*dataset_, test, workers_, progress_, stop_));
  const int views = std::min(kSampleViews, held_out_.views);
  for (int m = 0; m < held_out_.models; ++m) {
    Sample sample{m, {}};
    // Spread over the circle, from the one that sees the front (as the report's).
    for (int v = 0; v < views; ++v) {
      sample.views.push_back((5 * held_out_.views / 6 + v * held_out_.views / views) %
                             held_out_.views);
    }
    samples_.push_back(std::move(sample));
  }
  return {};
}

Status Run::Restore() {
  auto found = LoadNewestCheckpoint(context_, job_.run);
  if (!found.ok())
    return found.status().code() == StatusCode::kNotFound ? Status() : found.status();
  for (const auto& warning : found->warnings) {
    if (job_.warn) job_.warn("passed over: " + warning);
  }
  const Checkpoint& checkpoint = found->checkpoint;
  const std::string file = found->file.string();
  TILEGRAD_ASSIGN(const TrainConfig before, ParseConfig(checkpoint.info.config, file));
  TILEGRAD_TRY(CheckSame(before, job_.config, found->file));
  if (checkpoint.info.image_size != train_.size) {
    return InvalidArgument("{}: trained on images of {} pixels a side, the dataset has {}", file,
                           checkpoint.info.image_size, train_.size);
  }
  TILEGRAD_TRY(nn::LoadState(step_->network().module(), checkpoint.tensors).Within(file));
  TILEGRAD_TRY(step_->adam().LoadState(checkpoint.tensors).Within(file));
  if (step_->adam().steps() != checkpoint.info.step) {
    return InvalidArgument("{}: the optimizer has taken {} steps, the run {}", file,
                           step_->adam().steps(), checkpoint.info.step);
  }
  SetAside(found->broken);
  outcome_.first_step = saved_step_ = checkpoint.info.step;
  seconds_before_ = checkpoint.info.seconds;
  return {};
}

Status Run::WriteHeader() {
  nlohmann::ordered_json json = {{"name", job_.config.name},
                                 {"dataset", job_.data.string()},
                                 {"dataset_source", dataset_->info().source},
                                 {"training_models", train_.models},
                                 {"parameters", nn::CountParameters(step_->network().module())}};
  for (const auto& [key, value] : DescribeMachine()) json["machine"][key] = value;
  // Paths need be no UTF-8: then a replacement character, not an exception.
  const std::string text =
      json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  TILEGRAD_TRY(WriteTextAtomic(job_.run / "run.json", text + "\n"));
  return WriteTextAtomic(job_.run / "config.toml", WriteConfig(job_.config));
}

Status Run::Prepare() {
  TILEGRAD_TRY(CheckExisting());
  TILEGRAD_TRY(LoadData());
  TILEGRAD_ASSIGN(lock_, FolderLock::Take(job_.run));
  RemoveHalfWritten(job_.run);
  step_.emplace(context_, job_.config, train_.size);
  order_.emplace(train_.models, train_.views,
                 static_cast<std::uint64_t>(job_.config.schedule.seed));
  TILEGRAD_TRY(context_.TakeStatus());
  TILEGRAD_TRY(Restore());
  TILEGRAD_TRY(RememberTrainedModels(
      job_.run, *dataset_, outcome_.first_step == 0 ? RunStart::kNew : RunStart::kGoingOn));
  TILEGRAD_TRY(WriteHeader());
  PruneCheckpoints(job_.run, job_.config.schedule.keep_checkpoints);
  TILEGRAD_ASSIGN(log_, RunLog::Open(job_.run, outcome_.first_step));
  outcome_.last_step = last_logged_step_ = outcome_.first_step;
  return {};
}

Status Run::Save() {
  if (saved_step_ == outcome_.last_step) return {};
  std::vector<nn::NamedTensor> tensors = nn::State(step_->network().module());
  const std::vector<nn::NamedTensor> moments = step_->adam().State();
  tensors.insert(tensors.end(), moments.begin(), moments.end());
  TILEGRAD_TRY(SaveCheckpoint(
      job_.run, {outcome_.last_step, train_.size, WriteConfig(job_.config), Seconds()},
      std::move(tensors)));
  saved_step_ = outcome_.last_step;
  PruneCheckpoints(job_.run, job_.config.schedule.keep_checkpoints);
  return {};
}

Status Run::Log(const LossValues& v) {
  const double elapsed = SecondsSince(last_log_);
  const auto images =
      static_cast<double>((outcome_.last_step - last_logged_step_) * job_.config.schedule.batch);
  const double rate = elapsed > 0 ? images / elapsed : 0;
  last_log_ = Clock::now();
  last_logged_step_ = outcome_.last_step;
  note_ = fmt::format("loss {:.4f}  IoU loss {:.3f}  colour {:.3f}  {:.0f} images/s", v.total,
                      v.iou, v.color, rate);
  const double epoch =
      static_cast<double>(outcome_.last_step * job_.config.schedule.batch) / train_.models;
  return log_->Append({outcome_.last_step,
                       {{"epoch", epoch},
                        {"loss", v.total},
                        {"iou", v.iou},
                        {"color", v.color},
                        {"smoothness", v.smoothness},
                        {"laplacian", v.laplacian},
                        {"learning_rate", LearningRateAt(job_.config, outcome_.last_step - 1)},
                        {"images_per_second", rate},
                        {"seconds", Seconds()}}});
}

Status Run::DrawSamples() {
  if (samples_.empty()) return {};
  TILEGRAD_ASSIGN(const ImageU8 sheet,
                  SampleSheet(context_, *step_, held_out_, samples_, outcome_.last_step));
  return io::SavePng(job_.run / "samples" / fmt::format("step_{:08}.png", outcome_.last_step),
                     sheet);
}

Status Run::OneStep() {
  const ScheduleConfig& s = job_.config.schedule;
  const std::int64_t index = outcome_.last_step;
  const auto batch = order_->Batch(index, static_cast<int>(s.batch), static_cast<int>(s.views));
  TILEGRAD_ASSIGN(const LossValues values, step_->Run(GatherBatch(context_, train_, batch), index));
  const std::int64_t done = ++outcome_.last_step;
  const bool last = done == s.steps;
  if (done % s.log_every == 0 || done == 1 || last) TILEGRAD_TRY(Log(values));
  if (done % s.sample_every == 0 || last) TILEGRAD_TRY(DrawSamples());
  if (done % s.checkpoint_every == 0 || last) TILEGRAD_TRY(Save());
  progress_(
      {"training", static_cast<std::uint64_t>(done), static_cast<std::uint64_t>(s.steps), note_});
  return {};
}

Status Run::Loop() {
  loop_start_ = last_log_ = Clock::now();
  while (outcome_.last_step < job_.config.schedule.steps && !stop_ && !OutOfTime())
    TILEGRAD_TRY(OneStep());
  TILEGRAD_TRY(Save());
  outcome_.seconds = Seconds();
  outcome_.finished = outcome_.last_step == job_.config.schedule.steps;
  if (stop_ && !outcome_.finished) {
    return Cancelled("stopped at step {} of {}; everything is saved, go on with --resume",
                     outcome_.last_step, job_.config.schedule.steps);
  }
  return {};
}

Result<TrainOutcome> Run::Execute() {
  TILEGRAD_TRY(Prepare());
  TILEGRAD_TRY(Loop());
  return outcome_;
}

}  // namespace

Result<TrainOutcome> Train(const TrainJob& job, const Workers& workers,
                           const ProgressSink& progress, const StopFlag& stop) {
  return Run(job, workers, progress, stop).Execute();
}

}  // namespace tilegrad::train
