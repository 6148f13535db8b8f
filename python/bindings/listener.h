// SPDX-License-Identifier: Apache-2.0
// Long work that Python hears of and may stop.
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>

#include "base/progress.h"
#include "bindings/arrays.h"

namespace tilegrad::python {

// A Python function that is told of progress, and may stop the work: by returning True, by an
// exception, by Ctrl-C. Work runs on a separate thread, without the GIL; the function is called
// on the thread that called Run, which looks for Ctrl-C ten times a second, whatever the work does.
class Listener {
 public:
  explicit Listener(py::object function) : function_(std::move(function)) {}
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  // What `work`, which touches no Python object, returns. It may be called several times.
  template <class Work>
  auto Run(const Work& work) {
    std::optional<decltype(work())> result;
    RunApart([&] { result.emplace(work()); });
    return *std::move(result);
  }

  // For the work: to be told, and to look at.
  ProgressSink Sink() {
    return [this](const Progress& progress) { Pass(progress); };
  }
  const StopFlag& stop() const { return stop_; }

  // After the work: propagates the function's exception; its request to stop is no error.
  void Settle(const Status& status) const;

 private:
  void RunApart(const std::function<void()>& work);
  void Pass(const Progress& progress);  // on the thread of the work
  void HearUntilDone();                 // on the caller's, from here on
  void Hear(const Progress* progress);  // with the GIL; null: nothing is new

  py::object function_;
  StopFlag stop_ = false;
  bool asked_ = false;
  std::optional<py::error_already_set> error_;

  std::mutex mutex_;
  std::condition_variable changed_;
  const Progress* news_ = nullptr;  // that the thread of the work waits with, until it is heard
  bool apart_ = false;              // the work has a separate thread
  bool done_ = false;
};

}  // namespace tilegrad::python
