// SPDX-License-Identifier: Apache-2.0
#include "bindings/renderer_object.h"

#include <cstdio>
#include <string_view>
#include <type_traits>
#include <utility>

namespace tilegrad::python {

// What another process left in the copy of its memory is neither used nor ended: a lock of it may
// be held by a thread that does not exist here.
void RendererObject::DropForeignSession() {
  if (session_ != nullptr && session_->process != getpid()) static_cast<void>(session_.release());
}

RendererObject::Session& RendererObject::session() {
  DropForeignSession();
  if (session_ == nullptr) session_ = std::make_unique<Session>(threads_);
  return *session_;
}

template <class T>
RendererT<T>& RendererObject::EngineOf(Session& session) {
  if constexpr (std::is_same_v<T, float>) {
    return session.floats;
  } else {
    return session.doubles;
  }
}

template <class T>
std::shared_ptr<FramePool<T>>& RendererObject::pool() {
  if constexpr (std::is_same_v<T, float>) {
    return float_frames_;
  } else {
    return double_frames_;
  }
}

template <class T, class Call>
Status RendererObject::Run(const Call& call) {
  Session& mine = session();
  const py::gil_scoped_release released;  // first: who waits for the lock must not hold the GIL
  const std::lock_guard lock(mine.mutex);
  return call(EngineOf<T>(mine));
}

namespace {

template <class T>
using Records = std::vector<std::shared_ptr<SceneRecord<T>>>;

// The record that has image `image` of a batch.
template <class T>
const SceneRecord<T>* RecordOf(const Records<T>& records, std::size_t image) {
  for (const auto& record : records) {
    if (image < record->count()) return record.get();
    image -= record->count();
  }
  return nullptr;
}

// "options.width" is the argument `width` in Python, and in "scene 0: faces[7] is 9" faces have two
// axes.
template <class T>
std::string InPython(const std::string& message, const Records<T>& records) {
  constexpr std::string_view prefix = "options.";
  if (message.starts_with(prefix)) return message.substr(prefix.size());
  std::size_t image = 0, number = 0;
  char name[24];
  int end = 0;
  std::sscanf(message.c_str(), "scene %zu: %23[a-z_][%zu]%n", &image, name, &number, &end);
  const SceneRecord<T>* const record = end > 0 ? RecordOf(records, image) : nullptr;
  if (record == nullptr) return message;
  return fmt::format("scene {}: {}{}", image, record->PlaceOf(name, number), message.substr(end));
}

template <class T>
void ThrowInPython(const char* function, const Status& status, const Records<T>& records) {
  if (status.ok()) return ThrowIfError(status);
  ThrowIfError(Status(status.code(), InPython(status.message(), records)).Within(function));
}

}  // namespace

template <class T>
std::unique_ptr<FrameObject<T>> RendererObject::Render(
    std::vector<std::shared_ptr<SceneRecord<T>>> scenes, const RenderOptions& options,
    const Outputs& outputs) {
  std::vector<SceneT<T>> views;
  for (const auto& scene : scenes) {
    views.insert(views.end(), scene->scenes().begin(), scene->scenes().end());
  }
  auto out = std::make_unique<FrameObject<T>>(std::move(scenes), pool<T>());
  const Status status = Run<T>(
      [&](RendererT<T>& engine) { return engine.Render(views, options, outputs, &out->frame()); });
  ThrowInPython("render", status, out->scenes());
  return out;
}

template <class T>
void RendererObject::Backward(const FrameObject<T>& frame, const FrameGradientsT<T>& d_frame,
                              const std::vector<py::dict>& gradients, GradientMode mode) {
  if (gradients.size() != frame.scenes().size()) {
    throw py::value_error(fmt::format("backward: {} gradients, the frame has {} scenes",
                                      gradients.size(), frame.scenes().size()));
  }
  std::vector<GradientRecord<T>> records;
  std::vector<SceneGradientsT<T>> views;
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    records.emplace_back(*frame.scenes()[i], gradients[i], mode);
    const auto& own = records.back().gradients();
    views.insert(views.end(), own.begin(), own.end());
  }
  const Status status = Run<T>(
      [&](RendererT<T>& engine) { return engine.Backward(frame.frame(), d_frame, views, mode); });
  ThrowInPython("backward", status, frame.scenes());
  for (const GradientRecord<T>& record : records) record.Store();
}

#define TILEGRAD_INSTANTIATE(T)                                                            \
  template std::unique_ptr<FrameObject<T>> RendererObject::Render(                         \
      std::vector<std::shared_ptr<SceneRecord<T>>>, const RenderOptions&, const Outputs&); \
  template void RendererObject::Backward(const FrameObject<T>&, const FrameGradientsT<T>&, \
                                         const std::vector<py::dict>&, GradientMode);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::python
