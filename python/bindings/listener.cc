// SPDX-License-Identifier: Apache-2.0
#include "bindings/listener.h"

#include <chrono>
#include <new>
#include <system_error>
#include <thread>

#include "base/parallel.h"
#include "bindings/to_python.h"

namespace tilegrad::python {
namespace {

constexpr std::chrono::milliseconds kSignalInterval(100);

}  // namespace

void Listener::RunApart(const std::function<void()>& work) {
  std::exception_ptr failure;
  std::thread thread;
  done_ = false;
  apart_ = true;
  try {
    thread = std::thread([&] {
      ReserveThreadData();
      try {
        work();
      } catch (...) {  // out of memory
        failure = std::current_exception();
      }
      const std::lock_guard lock(mutex_);
      done_ = true;
      changed_.notify_all();
    });
  } catch (const std::system_error&) {  // no thread to be had
    apart_ = false;
    return WithoutGil(work);
  }
  WithoutGil([&] {
    HearUntilDone();
    thread.join();
  });
  if (failure != nullptr) std::rethrow_exception(failure);
}

void Listener::Pass(const Progress& progress) {
  if (stop_) return;
  if (!apart_) {
    const py::gil_scoped_acquire held;
    return Hear(&progress);
  }
  std::unique_lock lock(mutex_);
  news_ = &progress;
  changed_.notify_all();
  changed_.wait(lock, [&] { return news_ == nullptr; });
}

void Listener::HearUntilDone() {
  std::unique_lock lock(mutex_);
  while (!done_) {
    changed_.wait_for(lock, kSignalInterval, [&] { return done_ || news_ != nullptr; });
    const Progress* const news = news_;
    lock.unlock();
    {
      const py::gil_scoped_acquire held;
      Hear(news);
    }
    lock.lock();
    if (news == nullptr) continue;
    news_ = nullptr;
    changed_.notify_all();
  }
}

void Listener::Hear(const Progress* progress) {
  if (stop_) return;
  try {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress == nullptr || function_.is_none()) return;
    asked_ = function_(Text(progress->stage), progress->done, progress->total).is(py::bool_(true));
    if (asked_) stop_ = true;
  } catch (const py::error_already_set& error) {
    error_.emplace(error);
    stop_ = true;
  } catch (const std::bad_alloc&) {
    PyErr_NoMemory();
    error_.emplace();
    stop_ = true;
  }
}

void Listener::Settle(const Status& status) const {
  if (error_) {
    py::error_already_set error = *error_;
    throw error;
  }
  if (!(asked_ && status.code() == StatusCode::kCancelled)) ThrowIfError(status);
}

}  // namespace tilegrad::python
