// SPDX-License-Identifier: Apache-2.0
// The renderer behind Python's: for float32 and float64, any thread, any process.
#pragma once

#include <unistd.h>

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "bindings/scene_record.h"

namespace tilegrad::python {

// Unused frames for the next render, so that the memory of images is not returned to the system and
// requested again, page by page. Used with the GIL held.
template <class T>
class FramePool {
 public:
  FrameT<T> Take() {
    if (spare_.empty()) return {};
    FrameT<T> frame = std::move(spare_.back());
    spare_.pop_back();
    return frame;
  }
  void Give(FrameT<T> frame) {
    if (spare_.size() < kMost) spare_.push_back(std::move(frame));
  }

 private:
  static constexpr std::size_t kMost = 2;  // one that a loop overwrites, one that it reads
  std::vector<FrameT<T>> spare_;
};

// A frame with the scenes' arrays, which it needs, and the pool to which it returns its memory.
template <class T>
class FrameObject {
 public:
  using Record = SceneRecord<T>;

  FrameObject(std::vector<std::shared_ptr<Record>> scenes, std::shared_ptr<FramePool<T>> pool)
      : scenes_(std::move(scenes)), pool_(std::move(pool)), frame_(pool_->Take()) {}
  ~FrameObject() { pool_->Give(std::move(frame_)); }
  FrameObject(const FrameObject&) = delete;
  FrameObject& operator=(const FrameObject&) = delete;

  const std::vector<std::shared_ptr<Record>>& scenes() const { return scenes_; }
  FrameT<T>& frame() { return frame_; }
  const FrameT<T>& frame() const { return frame_; }
  const ImagesT<T>& images() const { return frame_.images(); }

 private:
  std::vector<std::shared_ptr<Record>> scenes_;
  std::shared_ptr<FramePool<T>> pool_;
  FrameT<T> frame_;
};

// Serialises calls from several threads. A child process gets a new engine after a fork: the
// parent's may have been busy when it was copied.
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
