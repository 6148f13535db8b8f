// SPDX-License-Identifier: Apache-2.0
// Long work without the GIL.
#pragma once

#include <pybind11/pybind11.h>
#include <unistd.h>

namespace tilegrad::python {

// Releases the GIL during its lifetime. Unlike pybind11's, it survives the end of the interpreter,
// which ends daemon threads that ask for the GIL by unwinding them: through destructors, which ends
// the process, and through objects of Python, which are gone. Such a thread stops here instead.
class GilReleased {
 public:
  GilReleased() : thread_(PyEval_SaveThread()) {}
  ~GilReleased() {
    try {
      PyEval_RestoreThread(thread_);
    } catch (...) {  // ends neither with this block nor with a return
      while (true) pause();
    }
  }
  GilReleased(const GilReleased&) = delete;
  GilReleased& operator=(const GilReleased&) = delete;

 private:
  PyThreadState* thread_;
};

// The result of `work`, which must not touch Python objects; other Python threads run meanwhile.
template <class Work>
auto WithoutGil(const Work& work) {
  const GilReleased released;
  return work();
}

}  // namespace tilegrad::python
