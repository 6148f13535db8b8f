// SPDX-License-Identifier: Apache-2.0
#include "base/loop_schedule.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <deque>
#include <functional>
#include <map>
#include <queue>
#include <string_view>
#include <utility>

#include "base/aligned.h"
#include "base/clocks.h"
#include "base/worker_groups.h"

namespace tilegrad {
namespace {

// The time of one of the strand's own loops.
struct Taken {
  double seconds = 0;
  // Of a grouped loop: what its slowest group does, which starts that much later.
  LoopForecast slowest = {};
};

// Of the group that ends last. Groups share the memory bandwidth.
LoopForecast ForecastGroups(const LoopRecord& loop, const LoopMachine& machine) {
  const std::size_t groups = loop.tasks.size();
  LoopForecast slowest;
  for (std::size_t g = 0; g < groups; ++g) {
    const auto first = [&](std::size_t of) {
      return WorkerGroups::FirstOf(of, machine.workers, groups);
    };
    LoopMachine part = machine;
    part.workers = std::max(1, static_cast<int>(first(g + 1) - first(g)));
    part.bytes_per_second *= static_cast<double>(part.workers) / machine.workers;
    LoopForecast own = Forecast(loop.tasks[g], part);
    if (own.seconds >= slowest.seconds) slowest = std::move(own);
  }
  return slowest;
}

// Executes a strand on simulated workers.
class Simulation {
 public:
  explicit Simulation(const LoopMachine& machine)
      : machine_(machine), stacks_(static_cast<std::size_t>(machine.workers)) {
    for (std::size_t w = stacks_.size(); w-- > 1;) idle_.push_back(w);
  }

  // Returns the time of each of the strand's own loops.
  std::vector<Taken> Run(const Strand& strand) {
    Begin(strand, nullptr, 0, 0.0);
    while (!events_.empty()) {
      const auto [time, worker] = events_.top();
      events_.pop();
      Advance(worker, time);
    }
    return std::move(taken_);
  }

 private:
  struct OpenLoop {
    const LoopRecord& record;
    std::size_t owner;
    double begin;
    std::size_t place;  // index of its seconds in taken_
    std::size_t started = 0, ended = 0;
    bool awaited = true, left = false;  // by its owner
    bool HasTask() const { return started < record.tasks.size(); }
    bool IsOver() const { return ended == record.tasks.size(); }
    // Whether a worker without a loop of its own may take a task.
    bool IsOpen() const { return HasTask() && (awaited || started - ended < record.helpers); }
  };
  // A strand that a worker is executing.
  struct Frame {
    const Strand& strand;
    OpenLoop* of;               // the loop of which it is a task; null: the outermost strand
    std::size_t stretch = 0;    // the current one, or the one before the awaited loop
    OpenLoop* inner = nullptr;  // the loop that it waits for
  };

  void Begin(const Strand& strand, OpenLoop* of, std::size_t worker, double time) {
    stacks_[worker].push_back({strand, of});
    events_.emplace(time + strand.stretches[0], worker);
  }

  // The worker's stretch has ended, or the loop that it waits for, or others may have work for it.
  void Advance(std::size_t worker, double time) {
    auto& stack = stacks_[worker];
    if (!stack.empty() && stack.back().inner == nullptr) {
      Frame& frame = stack.back();
      if (frame.stretch < frame.strand.loops.size()) {
        Open(worker, time);
        if (frame.inner == nullptr) return;  // a side loop: the strand continues
      } else if (!AwaitSideLoop(worker, time)) {
        Close(worker, time);
      }
    }
    Continue(worker, time);
  }

  void Open(std::size_t worker, double time) {
    Frame& frame = stacks_[worker].back();
    const LoopRecord& record = frame.strand.loops[frame.stretch];
    if (record.grouped) return RunGroups(record, worker, time);
    OpenLoop& loop = loops_.emplace_back(OpenLoop{record, worker, time, taken_.size()});
    loop.awaited = record.helpers == 0;
    if (frame.of == nullptr) taken_.emplace_back();
    WakeOthers(time, frame.of == nullptr);
    if (loop.awaited) {
      frame.inner = &loop;
    } else {
      events_.emplace(time + frame.strand.stretches[++frame.stretch], worker);
    }
  }

  // No worker joins loops of another group: each group is a machine of its own.
  void RunGroups(const LoopRecord& record, std::size_t worker, double time) {
    Frame& frame = stacks_[worker].back();
    LoopForecast slowest = ForecastGroups(record, machine_);
    const double seconds =
        std::bit_width(record.tasks.size() - 1) * machine_.start_seconds + slowest.seconds;
    if (frame.of == nullptr) taken_.push_back({seconds, std::move(slowest)});
    events_.emplace(time + seconds + frame.strand.stretches[++frame.stretch], worker);
  }

  // After each start time twice as many take part; workers already awake join at once.
  void WakeOthers(double time, bool asleep) {
    std::size_t awake = 1;
    for (const std::size_t other : std::exchange(idle_, {})) {
      const double starts = asleep ? std::bit_width(awake++) : 0;
      events_.emplace(time + starts * machine_.start_seconds, other);
    }
  }

  // At the end of the outermost strand: whether its owner must now wait for a side loop.
  bool AwaitSideLoop(std::size_t worker, double time) {
    Frame& frame = stacks_[worker].back();
    if (frame.of != nullptr) return false;
    const auto left = std::find_if(loops_.begin(), loops_.end(),
                                   [](const auto& l) { return !l.awaited && !l.IsOver(); });
    if (left == loops_.end()) return false;
    left->awaited = true;
    left->begin = time;
    frame.inner = &*left;
    WakeOthers(time, true);
    return true;
  }

  // Ends a strand. The owner of its loop may be waiting for it.
  void Close(std::size_t worker, double time) {
    OpenLoop* const loop = stacks_[worker].back().of;
    stacks_[worker].pop_back();
    if (loop == nullptr) return;
    ++loop->ended;
    if (loop->IsOver() && loop->awaited && loop->owner != worker)
      events_.emplace(time, loop->owner);
  }

  void Continue(std::size_t worker, double time) {
    auto& stack = stacks_[worker];
    OpenLoop* const loop = stack.empty() ? Oldest() : stack.back().inner;
    if (loop == nullptr) {
      idle_.push_back(worker);
    } else if (loop->HasTask()) {
      Begin(loop->record.tasks[loop->started++], loop, worker, time);
    } else if (loop->IsOver()) {
      Resume(&stack.back(), worker, time);
    }
  }

  OpenLoop* Oldest() {
    while (!loops_.empty() && loops_.front().left) loops_.pop_front();
    const auto found =
        std::find_if(loops_.begin(), loops_.end(), [](const auto& l) { return l.IsOpen(); });
    return found == loops_.end() ? nullptr : &*found;
  }

  void Resume(Frame* frame, std::size_t worker, double time) {
    OpenLoop& loop = *frame->inner;
    loop.left = true;
    if (machine_.bytes_per_second > 0)
      time = std::max(time, loop.begin + loop.record.bytes / machine_.bytes_per_second);
    if (frame->of == nullptr) taken_[loop.place].seconds = time - loop.begin;
    frame->inner = nullptr;
    const bool ended = frame->stretch == frame->strand.loops.size();  // a side loop was left
    events_.emplace(ended ? time : time + frame->strand.stretches[++frame->stretch], worker);
  }

  using Event = std::pair<double, std::size_t>;  // time and worker
  const LoopMachine& machine_;
  std::vector<std::vector<Frame>> stacks_;  // of workers
  std::deque<OpenLoop> loops_;              // in the order in which they were opened
  std::vector<std::size_t> idle_;
  std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
  std::vector<Taken> taken_;
};

std::string NameOf(const LoopSite& site) {
  std::string_view file = site.file;
  const std::size_t folder = file.rfind("src/");
  if (folder != std::string_view::npos) file.remove_prefix(folder + 4);
  return fmt::format("{}:{}", file, site.line);
}

// Sums by place.
class Places {
 public:
  explicit Places(int workers) : workers_(workers) {}
  void Add(const std::string& place, double work, double taken, int times = 1) {
    HeldBack& sum = places_[place];
    sum.times += times;
    sum.work += work;
    sum.taken += taken;
  }
  // A grouped loop: the slowest group's places, as if the others were as slow.
  void AddGroups(const std::string& place, std::size_t groups, const Taken& taken) {
    Add(place, 0, taken.seconds - taken.slowest.seconds);
    for (const HeldBack& inner : taken.slowest.places)
      Add(inner.place, static_cast<double>(groups) * inner.work, inner.taken, inner.times);
  }
  LoopForecast Sorted() {
    LoopForecast out;
    for (auto& [place, sum] : places_) {
      sum.place = place;
      sum.wasted = sum.taken - sum.work / workers_;
      out.seconds += sum.taken;
      out.places.push_back(sum);
    }
    std::stable_sort(out.places.begin(), out.places.end(),
                     [](const HeldBack& a, const HeldBack& b) { return a.wasted > b.wasted; });
    return out;
  }

 private:
  int workers_;
  std::map<std::string, HeldBack> places_;
};

void Spin(double seconds) {
  for (const auto begin = std::chrono::steady_clock::now(); SecondsSince(begin) < seconds;) {
  }
}

// The time of a loop beyond its tasks, with one task per worker, that nine of ten loops exceed:
// delays by other programs do not count. Divided by the number of doublings until all workers take
// part.
double MeasureStart(const Workers& workers) {
  constexpr int kLoops = 301;
  constexpr double kBefore = 30e-6, kTask = 100e-6;
  std::vector<double> beyond;
  for (int i = 0; i < kLoops; ++i) {
    Spin(kBefore);
    const auto begin = std::chrono::steady_clock::now();
    workers.For(workers.size(), [](std::size_t, std::size_t) { Spin(kTask); });
    beyond.push_back(SecondsSince(begin) - kTask);
  }
  std::nth_element(beyond.begin(), beyond.begin() + kLoops / 10, beyond.end());
  const auto doublings = std::bit_width(static_cast<unsigned>(workers.count()) - 1u);
  return std::max(0.0, beyond[kLoops / 10]) / std::max(1, static_cast<int>(doublings));
}

// The best of a few rounds over arrays larger than any cache: two reads and a write per number.
double MeasureMemory(const Workers& workers) {
  constexpr std::size_t kNumbers = std::size_t{1} << 25, kGrain = std::size_t{1} << 16;
  constexpr int kRounds = 6;
  AlignedVector<float> x(kNumbers, 1.0f), y(kNumbers, 0.0f);
  double best = 0;
  for (int i = 0; i < kRounds; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    workers.ForRanges(kNumbers, kGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t k = from; k < to; ++k) y[k] += 0.5f * x[k];
    });
    best = std::max(best, 3.0 * sizeof(float) * kNumbers / SecondsSince(begin));
  }
  return best;
}

}  // namespace

LoopForecast Forecast(const Strand& strand, const LoopMachine& machine) {
  const std::vector<Taken> taken = Simulation(machine).Run(strand);
  Places places(machine.workers);
  std::string before = "begin";
  for (std::size_t i = 0; i < strand.stretches.size(); ++i) {
    const bool last = i == strand.loops.size();
    std::string next = last ? "end" : NameOf(strand.loops[i].site);
    places.Add(before + " .. " + next, strand.stretches[i], strand.stretches[i]);
    if (last) break;
    const LoopRecord& loop = strand.loops[i];
    if (loop.grouped) {
      places.AddGroups(next, loop.tasks.size(), taken[i]);
    } else {
      places.Add(next, WorkOf(loop), taken[i].seconds);
    }
    before = std::move(next);
  }
  return places.Sorted();
}

LoopCosts MeasureLoopCosts(const Workers& workers) {
  return {MeasureStart(workers), MeasureMemory(workers)};
}

}  // namespace tilegrad
