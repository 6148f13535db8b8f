// SPDX-License-Identifier: Apache-2.0
#include "train/run/run.h"

#include <chrono>
#include <future>
#include <sstream>
#include <utility>

#include "base/clocks.h"
#include "base/error.h"
#include "base/text.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

constexpr const char* kStepsKey = "schedule.steps";

using Clock = std::chrono::steady_clock;

// Without the line "KEY = ...".
std::string WithoutKey(const std::string& settings, const std::string& key) {
  std::istringstream lines(settings);
  std::string out;
  for (std::string line; std::getline(lines, line);) {
    if (key.empty() || !line.starts_with(key + " = ")) out += line + "\n";
  }
  return out;
}

// `before`: settings that `place` holds. That of `may_differ` is not compared.
Status CheckSettings(const RunPlan& plan, const RunWork& work, const std::string& before,
                     const Path& place, const std::string& may_differ) {
  TILEGRAD_ASSIGN(std::string then, work.ResultSettings(before, place.string()));
  TILEGRAD_ASSIGN(std::string now, work.ResultSettings(plan.settings, "this run"));
  then = WithoutKey(then, may_differ);
  now = WithoutKey(now, may_differ);
  if (then == now) return {};
  return InvalidArgument(
      "{}: was started with another configuration: {}; resume with that one, or start anew with "
      "--force or another --out",
      place.string(), FirstDifference(then, now));
}

// The last step in the log; 0: none.
Result<std::int64_t> LastLogged(const Path& folder) {
  const auto log = ReadLog(folder);
  if (!log.ok() && log.status().code() != StatusCode::kNotFound) return log.status();
  return log.ok() && !log->empty() ? log->back().step : std::int64_t{0};
}

class Session {
 public:
  Session(const RunPlan& plan, RunWork* work, nn::Context& context)
      : plan_(plan), work_(*work), context_(context) {}

  Status Open() {
    if (!plan_.locked) {
      TILEGRAD_ASSIGN(lock_, FolderLock::Take(plan_.folder));
    }
    TILEGRAD_TRY(CheckExistingRun(plan_, work_));
    if (plan_.existing == ExistingRun::kReplace) TILEGRAD_TRY(RemoveRun(plan_.folder));
    TILEGRAD_TRY(Restore());
    RemoveHalfWritten(plan_.folder);
    TILEGRAD_TRY(work_.Begin(first_step_));
    PruneCheckpoints(plan_.folder, plan_.schedule.keep_checkpoints);
    TILEGRAD_ASSIGN(log_, RunLog::Open(plan_.folder, first_step_));
    return {};
  }

  Status Loop(const Watch& watch) {
    loop_start_ = last_log_ = Clock::now();
    process_seconds_ = ProcessSeconds();
    if (done_ == 0) TILEGRAD_TRY(Draw());
    while (done_ < End() && !watch.stopped() && !OutOfTime()) {
      TILEGRAD_TRY(OneStep());
      watch.Report({plan_.stage, static_cast<std::uint64_t>(done_),
                    static_cast<std::uint64_t>(End()), note_});
    }
    TILEGRAD_TRY(Save());
    TILEGRAD_TRY(AwaitSave());
    if (!watch.stopped() || done_ >= End()) return {};
    return Cancelled("stopped at step {} of {}; everything is saved", done_, End());
  }

  RunOutcome outcome() const { return {first_step_, done_, Seconds(), done_ >= End()}; }

 private:
  Status Restore() {
    auto found = LoadNewestCheckpoint(context_, plan_.folder);
    if (found.status().code() == StatusCode::kNotFound) return StartAnew();
    if (!found.ok()) return found.status();
    for (const auto& warning : found->warnings) {
      if (plan_.warn) plan_.warn("skipped: " + warning);
    }
    const CheckpointInfo& info = found->checkpoint.info;
    const std::string file = found->file.string();
    // config.toml, which is written when a run is extended, was compared before: the newest
    // checkpoint may be older than that.
    const bool compared = PathExists(plan_.folder / kTrainSettings);
    TILEGRAD_TRY(CheckSettings(plan_, work_, info.config, found->file,
                               compared ? kStepsKey : plan_.may_differ));
    if (info.step > plan_.schedule.steps)
      return InvalidArgument("{}: has {} already, more than {}", file, Count(info.step, "step"),
                             plan_.schedule.steps);
    if (info.image_size != plan_.image_size)
      return InvalidArgument("{}: its images had {} pixels a side, now there are {}", file,
                             info.image_size, plan_.image_size);
    TILEGRAD_TRY(work_.LoadState(found->checkpoint.tensors, info.step).Within(file));
    SetAside(found->broken);
    first_step_ = done_ = saved_ = info.step;
    seconds_before_ = info.seconds;
    return {};
  }

  // A run that was killed in its first step has no checkpoint; one whose checkpoints were removed
  // must not write over the curves of what they held.
  Status StartAnew() const {
    TILEGRAD_ASSIGN(const std::int64_t last, LastLogged(plan_.folder));
    if (last <= 1) return {};
    return DataLoss(
        "{}: its metrics.jsonl goes up to step {}, but its checkpoints are gone: there is "
        "nothing to resume; start anew in another folder with --out, or in this one with "
        "--force, which removes the run",
        plan_.folder.string(), last);
  }

  Status OneStep() {
    const Schedule& s = plan_.schedule;
    values_.Clear();
    TILEGRAD_TRY(work_.Step(done_, &values_).Within(fmt::format("step {}", done_)));
    ++done_;
    images_ += values_.images;
    stream_seconds_ += values_.stream_seconds;
    wait_seconds_ += values_.wait_seconds;
    const bool last = done_ >= End();
    if (done_ % s.log_every == 0 || done_ == 1 || last) TILEGRAD_TRY(Log());
    TILEGRAD_TRY(Draw());
    if (done_ % s.checkpoint_every == 0 || done_ == 1 || last) TILEGRAD_TRY(Save());
    // From the first step on there is a checkpoint, and the disk has room for one.
    return done_ == 1 ? AwaitSave() : Status();
  }

  Status Draw() {
    if (!work_.HasPicture(done_)) return {};
    TILEGRAD_ASSIGN(const ImageU8 picture, work_.Picture(done_));
    if (picture.empty()) return {};
    const Path file = PictureFile(plan_, done_);
    TILEGRAD_TRY(io::SavePng(file, picture));
    if (plan_.drawn) plan_.drawn(file);
    const Mesh mesh = work_.PictureMesh();
    return mesh.faces.empty() ? Status() : io::SaveGlb(Path(file).replace_extension(".glb"), mesh);
  }

  Status Log() {
    const double elapsed = SecondsSince(last_log_);
    const double rate = elapsed > 0 ? static_cast<double>(images_) / elapsed : 0;
    last_log_ = Clock::now();
    images_ = 0;
    note_ = values_.ForConsole() + fmt::format("  {:.0f} images/s", rate);
    LogEntry entry{done_, values_.ForLog()};
    entry.values.emplace_back("images_per_second", rate);
    entry.values.emplace_back("seconds", Seconds());
    LogStream(&entry);
    LogWait(elapsed, &entry);
    return log_->Append(entry);
  }

  // The share of the processor time that went into streamed pictures.
  void LogStream(LogEntry* entry) {
    const double before = std::exchange(process_seconds_, ProcessSeconds());
    const double streamed = std::exchange(stream_seconds_, 0);
    if (streamed <= 0 || process_seconds_ <= before) return;
    const double share = streamed / (process_seconds_ - before);
    note_ += fmt::format("  streaming {:.0f} %", 100 * share);
    entry->values.emplace_back("stream_share", share);
  }

  // The share of the time that this rank, done with its portions, waited for the sums of all, and
  // how many these are in a step.
  void LogWait(double elapsed, LogEntry* entry) {
    const double waited = std::exchange(wait_seconds_, 0);
    if (waited <= 0 || elapsed <= 0) return;
    note_ += fmt::format("  waiting {:.1f} %", 100 * waited / elapsed);
    entry->values.emplace_back("wait_share", waited / elapsed);
    entry->values.emplace_back("summed_numbers", values_.summed_numbers);
  }

  Status Save() {
    if (saved_ == done_) return {};
    TILEGRAD_TRY(AwaitSave());
    CheckpointInfo info{done_, plan_.image_size, plan_.settings, Seconds(), plan_.half_extent};
    auto save = [this, info = std::move(info), state = Snapshot()]() mutable {
      TILEGRAD_TRY(SaveCheckpoint(plan_.folder, info, std::move(state)));
      PruneCheckpoints(plan_.folder, plan_.schedule.keep_checkpoints);
      return Status();
    };
    // Deferred to AwaitSave where the system refuses a thread.
    saving_ = std::async(std::launch::async | std::launch::deferred, std::move(save));
    saved_ = done_;
    return {};
  }

  Status AwaitSave() { return saving_.valid() ? saving_.get() : Status(); }

  // What later steps do not change.
  std::vector<nn::NamedTensor> Snapshot() {
    std::vector<nn::NamedTensor> state = work_.State();
    for (nn::NamedTensor& t : state) t.value = context_.Copy(t.value);
    return state;
  }

  std::int64_t End() const { return work_.End(plan_.schedule.steps); }
  double Seconds() const { return seconds_before_ + SecondsSince(loop_start_); }
  bool OutOfTime() const {
    return plan_.max_minutes > 0 && SecondsSince(loop_start_) > 60 * plan_.max_minutes;
  }

  const RunPlan& plan_;
  RunWork& work_;
  nn::Context& context_;
  FolderLock lock_;
  std::optional<RunLog> log_;
  StepValues values_;                       // of the last step
  std::int64_t first_step_ = 0, done_ = 0;  // steps
  std::int64_t saved_ = -1;
  double seconds_before_ = 0;
  Clock::time_point loop_start_, last_log_;
  // Since the last log.
  std::int64_t images_ = 0;
  double stream_seconds_ = 0, process_seconds_ = 0;  // the latter: of the process at that log
  double wait_seconds_ = 0;
  std::string note_;
  std::future<Status> saving_;  // beside the steps
};

}  // namespace

Status CheckExistingRun(const Path& folder, ExistingRun existing) {
  if (existing != ExistingRun::kRefuse) return {};
  TILEGRAD_ASSIGN(const bool holds, HoldsRun(folder));
  if (!holds) return {};
  return InvalidArgument(
      "{}: already holds a run; --resume continues it, --force starts anew, or choose another "
      "--out",
      folder.string());
}

Status CheckExistingRun(const RunPlan& plan, const RunWork& work) {
  TILEGRAD_TRY(CheckExistingRun(plan.folder, plan.existing));
  const Path settings = plan.folder / kTrainSettings;
  if (plan.existing != ExistingRun::kContinue || !PathExists(settings)) return {};
  TILEGRAD_ASSIGN(const std::string before, ReadText(settings));
  return CheckSettings(plan, work, before, settings, plan.may_differ);
}

Result<RunOutcome> ExecuteRun(const RunPlan& plan, RunWork* work, nn::Context& context,
                              const Watch& watch) {
  Session session(plan, work, context);
  TILEGRAD_TRY(session.Open());
  TILEGRAD_TRY(session.Loop(watch));
  return session.outcome();
}

Path PictureFile(const RunPlan& plan, std::int64_t steps) {
  return plan.folder / fmt::format("{}{:08}.png", plan.pictures, steps);
}

}  // namespace tilegrad::train
