// SPDX-License-Identifier: Apache-2.0
#include "base/loop_trace.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

namespace tilegrad {
namespace {

// The shortest of many, so that no more is subtracted than a reading costs.
double MeasureReading() {
  double shortest = std::numeric_limits<double>::infinity();
  double last = ThreadSeconds();
  for (int i = 0; i < 1000; ++i) {
    const double now = ThreadSeconds();
    shortest = std::min(shortest, now - last);
    last = now;
  }
  return shortest;
}

}  // namespace

LoopTrace::LoopTrace() : reading_seconds_(MeasureReading()) {}

double WorkOf(const Strand& strand) {
  double sum = std::accumulate(strand.stretches.begin(), strand.stretches.end(), 0.0);
  for (const LoopRecord& loop : strand.loops) sum += WorkOf(loop);
  return sum;
}

double WorkOf(const LoopRecord& loop) {
  double sum = 0;
  for (const Strand& task : loop.tasks) sum += WorkOf(task);
  return sum;
}

void LoopTrace::Begin() {
  events_.clear();
  loops_.clear();
  traffic_ = 0;
  begin_ = ThreadSeconds();
}

void LoopTrace::Run(std::size_t n, FunctionRef<void(std::size_t, std::size_t)> task, LoopSite site,
                    std::size_t helpers) {
  const double bytes = std::exchange(traffic_, 0);
  if (n == 0 || (n == 1 && helpers == 0)) {  // nothing for another worker to do
    if (n == 1) task(0, 0);
    return;
  }
  RunTasks({n, site, bytes, helpers}, task);
}

void LoopTrace::RunTasks(const Begun& loop, FunctionRef<void(std::size_t, std::size_t)> task) {
  loops_.push_back(loop);
  events_.push_back({true});
  for (std::size_t i = 0; i < loop.tasks; ++i) {
    task(i, 0);
    events_.push_back({false});
  }
}

// Turns the list of events into strands.
class LoopTrace::Reader {
 public:
  Reader(const LoopTrace& trace, double end)
      : events_(trace.events_),
        loops_(trace.loops_),
        reading_(trace.reading_seconds_),
        last_(trace.begin_),
        end_(end) {}

  // Reads up to the end of the task, or of the recording.
  Strand ReadStrand() {
    Strand strand;
    while (next_ < events_.size() && events_[next_].begins) {
      strand.stretches.push_back(Lap(events_[next_].at));
      strand.loops.push_back(ReadLoop());
    }
    strand.stretches.push_back(Lap(next_ < events_.size() ? events_[next_].at : end_));
    return strand;
  }

 private:
  LoopRecord ReadLoop() {
    ++next_;  // its begin
    const Begun& begin = loops_[next_loop_++];
    LoopRecord loop{begin.site, begin.bytes, {}, begin.helpers, begin.grouped};
    for (std::size_t i = 0; i < begin.tasks; ++i) {
      loop.tasks.push_back(ReadStrand());
      ++next_;  // its end
    }
    return loop;
  }
  // Seconds since the last event, without its reading of the clock.
  double Lap(double now) { return std::max(0.0, now - std::exchange(last_, now) - reading_); }

  const std::vector<Event>& events_;
  const std::vector<Begun>& loops_;
  const double reading_;
  std::size_t next_ = 0, next_loop_ = 0;
  double last_, end_;
};

Strand LoopTrace::End() const { return Reader(*this, ThreadSeconds()).ReadStrand(); }

}  // namespace tilegrad
