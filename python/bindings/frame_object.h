// SPDX-License-Identifier: Apache-2.0
// A frame with what it needs: the scenes' arrays, and a place to leave its memory to.
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "bindings/scene_record.h"

namespace tilegrad::python {

// Frames that nobody looks at any more, for the next render: the memory of images is not returned
// to the system and asked for again, page by page. Used with the GIL held.
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
  static constexpr std::size_t kMost = 2;  // one that a loop overwrites, one that it looks at
  std::vector<FrameT<T>> spare_;
};

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

}  // namespace tilegrad::python
