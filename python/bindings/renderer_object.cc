// SPDX-License-Identifier: Apache-2.0
#include "bindings/renderer_object.h"

#include <algorithm>
#include <cstdio>
#include <type_traits>

#include "bindings/gil.h"

namespace tilegrad::python {
namespace {

// The shape of one image's part of `array`.
std::vector<py::ssize_t> ShapeOfOne(const py::object& array, std::size_t axes) {
  if (array.is_none()) return {};
  const auto shape = ShapeOf(py::reinterpret_borrow<py::array>(array));
  return {shape.end() - static_cast<std::ptrdiff_t>(axes), shape.end()};
}

// Records of runs of `numbers` numbers.
template <class T, class Record, class Read>
void ReadAll(const Field<T>& from, std::size_t numbers, std::vector<Record>* to, Read read) {
  const std::span<const T> all = from.all();
  for (std::size_t i = 0; i < all.size(); i += numbers)
    to->push_back(read(all.subspan(i, numbers)));
}

template <class T, class Record, class Put>
void PutAll(const std::vector<Record>& from, std::size_t numbers, const Field<T>& to, Put put) {
  for (std::size_t i = 0; i < from.size(); ++i)
    put(from[i], to.all().subspan(i * numbers, numbers));
}

// Arrays of Python that a backward pass writes to, as the records of the public interface.
template <class T>
class GradientRecord {
 public:
  // `arrays` maps the names of SceneArrays' fields, and textures (a list, with None where not
  // wanted), to arrays of the same shapes, or with an additional leading axis for a gradient of
  // each image. Missing names are not wanted. ValueError or TypeError for an array of another shape
  // or dtype, or one that is read-only.
  GradientRecord(const SceneRecord<T>& scene, const py::dict& arrays, GradientMode mode)
      : mode_(mode), gradients_(scene.count()) {
    for (const std::pair<py::handle, py::handle> entry : arrays) {
      arrays_.emplace_back(py::cast<std::string_view>(entry.first),
                           py::reinterpret_borrow<py::object>(entry.second));
    }
    SetStreams(scene);
    SetTextures(scene);
    SetRecords(scene);
  }
  GradientRecord(GradientRecord&&) noexcept = default;

  const std::vector<SceneGradientsT<T>>& gradients() const { return gradients_; }

  // Copies what is not a plain array in C++ from the records to the arrays.
  void Store() const {
    PutAll(cameras_, kCameraNumbers, camera_, PutCamera<T>);
    PutAll(surfaces_, kSurfaceNumbers, surface_, PutSurface<T>);
    PutAll(lights_, kLightNumbers, light_, PutLight<T>);
  }

 private:
  // Null: not wanted. The names live as long as the dictionary, which lives as long as the call.
  const py::object* Find(std::string_view name) const {
    for (const auto& [known, array] : arrays_) {
      if (known == name) return &array;
    }
    return nullptr;
  }

  Field<T> Take(const char* name, const py::object& array, const std::vector<py::ssize_t>& shape) {
    const Field<T> field("backward", name, array, shape, gradients_.size());
    // Without images nothing else writes what images share: their sum.
    const bool clear = gradients_.empty() && mode_ == GradientMode::kOverwrite;
    if (clear) std::fill(field.all().begin(), field.all().end(), T(0));
    return field;
  }

  Field<T> Take(const char* name, const std::vector<py::ssize_t>& shape) {
    const py::object* array = Find(name);
    return array == nullptr ? Field<T>() : Take(name, *array, shape);
  }

  void SetStreams(const SceneRecord<T>& scene) {
    SceneGradientsT<T> names;
    const SceneArrays& a = scene.arrays();
    ForEachPlainArray(names, [&](const char* name, auto&) {
      if (Find(name) == nullptr) return;
      const std::size_t axes = a.at_corners(name) ? 3 : name == std::string_view("sh") ? 1 : 2;
      const auto field = Take(name, ShapeOfOne(a[name], axes));
      for (std::size_t n = 0; field.given() && n < gradients_.size(); ++n) {
        ForEachPlainArray(gradients_[n], [&](std::string_view to, std::span<T>& array) {
          if (to == name) array = field.Of(n);
        });
      }
    });
  }

  void SetTextures(const SceneRecord<T>& scene) {
    const py::object* wanted = Find("textures");
    if (wanted == nullptr) return;
    const py::sequence given = *wanted;
    const std::size_t each = scene.arrays().textures.size();
    if (py::len(given) != each) {
      throw py::value_error(fmt::format(
          "backward: textures has {} gradients, the scene {} textures", py::len(given), each));
    }
    textures_.resize(each * gradients_.size());
    for (std::size_t i = 0; i < each; ++i) {
      const auto field = Take("textures", given[i], ShapeOfOne(scene.arrays().textures[i], 3));
      for (std::size_t n = 0; field.given() && n < gradients_.size(); ++n) {
        textures_[n * each + i] = field.Of(n);
      }
    }
    for (std::size_t n = 0; n < gradients_.size(); ++n) {
      gradients_[n].textures = std::span<const std::span<T>>(textures_).subspan(n * each, each);
    }
  }

  void SetRecords(const SceneRecord<T>& scene) {
    const SceneArrays& a = scene.arrays();
    const auto surfaces = std::max<py::ssize_t>(static_cast<py::ssize_t>(a.surface_textures.size()),
                                                1);  // none: the default
    camera_ = Take("camera", {kCameraNumbers});
    surface_ = Take("surfaces", {surfaces, kSurfaceNumbers});
    light_ = Take("lights", ShapeOfOne(a["lights"], 2));
    ReadAll(camera_, kCameraNumbers, &cameras_, CameraOf<T>);
    ReadAll(surface_, kSurfaceNumbers, &surfaces_, SurfaceOf<T>);
    ReadAll(light_, kLightNumbers, &lights_, LightOf<T>);
    const auto of = [](auto& all, const Field<T>& field, std::size_t n) {
      const std::size_t each = all.size() / field.arrays();
      return std::span(all).subspan(field.own() ? n * each : 0, each);
    };
    for (std::size_t n = 0; n < gradients_.size(); ++n) {
      if (!cameras_.empty()) gradients_[n].camera = of(cameras_, camera_, n).data();
      gradients_[n].surfaces = of(surfaces_, surface_, n);
      gradients_[n].lights = of(lights_, light_, n);
    }
  }

  GradientMode mode_;
  std::vector<std::pair<std::string_view, py::object>> arrays_;
  std::vector<SceneGradientsT<T>> gradients_;
  std::vector<std::span<T>> textures_;
  Field<T> camera_, surface_, light_;
  std::vector<CameraT<T>> cameras_;
  std::vector<SurfaceT<T>> surfaces_;
  std::vector<LightT<T>> lights_;
};

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

// "options.width" is the argument `width` in Python, "d_frame.color" is `color`, and in "scene 0:
// faces[7] is 9" faces have two axes.
template <class T>
std::string InPython(const std::string& message, const Records<T>& records) {
  for (const std::string_view prefix : {"options.", "d_frame."}) {
    if (message.starts_with(prefix)) return message.substr(prefix.size());
  }
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

// The session copied from another process is neither used nor destroyed: a thread that does not
// exist here may hold one of its locks.
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
  const GilReleased released;  // first: who waits for the lock must not hold the GIL
  const std::lock_guard lock(mine.mutex);
  return call(EngineOf<T>(mine));
}

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
