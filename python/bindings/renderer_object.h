// SPDX-License-Identifier: Apache-2.0
// A renderer as Python has it: for both kinds of numbers, for any thread, in any process.
#pragma once

#include <unistd.h>

#include <memory>
#include <mutex>
#include <vector>

#include "bindings/frame_object.h"
#include "bindings/gradient_record.h"

namespace tilegrad::python {

// Calls from several threads wait for each other. In a child process after a fork the engine starts
// anew: the parent's may have been at work when it was copied.
class RendererObject {
 public:
  explicit RendererObject(int threads) : threads_(threads) {}
  ~RendererObject() { DropForeignSession(); }
  RendererObject(const RendererObject&) = delete;
  RendererObject& operator=(const RendererObject&) = delete;

  template <class T>
  std::unique_ptr<FrameObject<T>> Render(std::vector<std::shared_ptr<SceneRecord<T>>> scenes,
                                         const RenderOptions& options, const Outputs& outputs);

  // `gradients`: a dictionary for each scene record of the frame (GradientRecord).
  template <class T>
  void Backward(const FrameObject<T>& frame, const FrameGradientsT<T>& d_frame,
                const std::vector<py::dict>& gradients, GradientMode mode);

  int threads() const { return threads_; }

 private:
  // The engine of one process.
  struct Session {
    explicit Session(int threads) : floats({threads}), doubles({threads}) {}

    const pid_t process = getpid();
    std::mutex mutex;  // one call at a time
    RendererT<float> floats;
    RendererT<double> doubles;
  };
  Session& session();
  void DropForeignSession();
  template <class T, class Call>
  Status Run(const Call& call);
  template <class T>
  static RendererT<T>& EngineOf(Session& session);
  template <class T>
  std::shared_ptr<FramePool<T>>& pool();

  int threads_;
  std::unique_ptr<Session> session_;
  std::shared_ptr<FramePool<float>> float_frames_ = std::make_shared<FramePool<float>>();
  std::shared_ptr<FramePool<double>> double_frames_ = std::make_shared<FramePool<double>>();
};

}  // namespace tilegrad::python
