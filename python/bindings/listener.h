// SPDX-License-Identifier: Apache-2.0
// Long work that reports to Python and that Python may stop.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>

#include "base/progress.h"
#include "bindings/arrays.h"

namespace tilegrad::python {

// A Python callback for progress, which may stop the work by returning True or by an exception;
// Ctrl-C stops it, too. The work runs on a separate thread, without the GIL; the callback runs on
// the thread that called Run, which checks for Ctrl-C ten times a second, whatever the work does.
class Listener {
 public:
  explicit Listener(py::object function) : function_(std::move(function)) {}
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  // The result of `work`, which must not touch Python objects. May be called several times.
  template <class Work>
  auto Run(const Work& work) {
    std::optional<decltype(work())> result;
    RunApart([&] { result.emplace(work()); });
    return *std::move(result);
  }

  // For the work: where to report progress, and the flag to check.
  ProgressSink Sink() {
    return [this](const Progress& progress) { Pass(progress); };
  }
  const StopFlag& stop() const { return stop_; }
  Watch watch() { return {Sink(), &stop_}; }

  // After the work: propagates the function's exception; its request to stop is no error.
  void Settle(const Status& status) const;

 private:
  void RunApart(const std::function<void()>& work);
  void Pass(const Progress& progress);  // on the work's thread
  void HearUntilDone();                 // on the caller's, from here on
  void Hear(const Progress* progress);  // with the GIL; null: nothing is new

  py::object function_;
  StopFlag stop_ = false;
  bool asked_ = false;
  std::optional<py::error_already_set> error_;

  std::mutex mutex_;
  std::condition_variable changed_;
  const Progress* news_ = nullptr;  // the work's thread waits until it is heard
  bool apart_ = false;              // the work has a separate thread
  bool done_ = false;
};

}  // namespace tilegrad::python
