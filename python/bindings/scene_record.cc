// SPDX-License-Identifier: Apache-2.0
#include "bindings/scene_record.h"

#include <algorithm>
#include <limits>

namespace tilegrad::python {
namespace {

// Copy the parts of a record, in their order, from and to a run of numbers.
template <class T>
auto Reader(const T*& next) {
  return [&next](const char*, std::span<T> part) {
    for (T& x : part) x = *next++;
  };
}
template <class T>
auto Writer(T*& next) {
  return [&next](const char*, std::span<const T> part) {
    for (const T x : part) *next++ = x;
  };
}

py::ssize_t Length(const py::object& array, py::ssize_t axis_from_end) {
  if (!py::isinstance<py::array>(array)) return 0;
  const auto values = py::reinterpret_borrow<py::array>(array);
  return values.ndim() < axis_from_end ? 0 : values.shape(values.ndim() - axis_from_end);
}

template <class T>
void SetField(std::span<const T> values, Rate, std::span<const T>* to) {
  *to = values;
}
template <class T>
void SetField(std::span<const T> values, Rate rate, StreamT<T>* to) {
  *to = {values, rate};
}

}  // namespace

py::object SceneArrays::operator[](const char* name) const {
  return fields.contains(name) ? py::object(fields[name]) : py::none();
}

bool SceneArrays::at_corners(std::string_view name) const {
  return std::find(per_corner.begin(), per_corner.end(), name) != per_corner.end();
}

template <class T>
SurfaceT<T> SurfaceOf(std::span<const T> numbers) {
  SurfaceT<T> out;
  const T* next = numbers.data();
  ForEachSurfacePart(Reader<T>(next), out);
  return out;
}
template <class T>
void PutSurface(const SurfaceT<T>& surface, std::span<T> numbers) {
  T* next = numbers.data();
  ForEachSurfacePart(Writer<T>(next), surface);
}
template <class T>
LightT<T> LightOf(std::span<const T> numbers) {
  LightT<T> out;
  const T* next = numbers.data();
  ForEachLightPart(Reader<T>(next), out);
  return out;
}
template <class T>
void PutLight(const LightT<T>& light, std::span<T> numbers) {
  T* next = numbers.data();
  ForEachLightPart(Writer<T>(next), light);
}

template <class T>
SceneRecord<T>::SceneRecord(std::size_t count, SceneArrays arrays)
    : arrays_(std::move(arrays)), scenes_(count) {
  const auto faces = Take<std::int32_t>("faces", {kAny, kAny});
  const auto cameras = Take<T>("camera", {kCameraNumbers});
  const auto model = [](int lighting, int normals, auto... flags) {
    return ShadingModel{static_cast<Lighting>(lighting), static_cast<Normals>(normals), flags...};
  };
  for (std::size_t n = 0; n < count; ++n) {
    SceneT<T>& scene = scenes_[n];
    scene.faces = faces.Of(n);
    scene.camera = CameraOf(cameras.Of(n));
    scene.shading = std::apply(model, arrays_.shading);
  }
  SetStreams();
  SetTextures();
  SetSurfaces();
  SetLights();
}

template <class T>
void SceneRecord<T>::SetStreams() {
  const py::ssize_t channels = Length(arrays_["attributes"], 1);
  constexpr py::ssize_t kMost = std::numeric_limits<int>::max();  // more than the engine takes
  channels_ = static_cast<int>(std::min(channels, kMost));
  for (SceneT<T>& scene : scenes_) scene.channels = channels_;
  SceneT<T> names;
  ForEachStream(names, {}, [&](const SceneStream<T>& s) {
    const bool corner = arrays_.at_corners(s.name);
    const auto field = Take<T>(s.name, std::vector<py::ssize_t>(corner ? 3 : 2, kAny));
    if (!field.given()) return;
    const Rate rate = corner ? Rate::kCorner : Rate::kVertex;
    for (std::size_t n = 0; n < scenes_.size(); ++n) {
      ForEachStreamField<T>(scenes_[n], scenes_[n],
                            [&](const char*, Varying what, int, auto& to, auto&) {
                              if (what == s.what) SetField<T>(field.Of(n), rate, &to);
                            });
    }
  });
}

template <class T>
std::string SceneRecord<T>::PlaceOf(std::string_view name, std::size_t number) const {
  std::vector<std::size_t> rows;  // the lengths of all axes but the first
  if (name == "faces") rows = {3};
  const SceneT<T> names;
  ForEachStream(names, {}, [&](const SceneStream<T>& s) {
    if (name != s.name) return;
    const auto width = static_cast<std::size_t>(s.what == Varying::kUser ? channels_ : s.width);
    rows = {width};
    if (arrays_.at_corners(name)) rows.insert(rows.begin(), 3);
  });
  std::string others;
  for (auto length = rows.rbegin(); length != rows.rend(); ++length) {
    others = fmt::format(",{}", number % *length) + others;
    number /= *length;
  }
  return fmt::format("{}[{}{}]", name, number, others);
}

template <class T>
void SceneRecord<T>::SetTextures() {
  const std::size_t each = arrays_.textures.size();
  if (arrays_.wraps.size() != each || arrays_.filters.size() != each) {
    throw py::value_error("Scene: textures, wraps and filters differ in length");
  }
  textures_.resize(each * scenes_.size());
  for (std::size_t i = 0; i < each; ++i) {
    const py::object& texels = arrays_.textures[i];
    const py::ssize_t height = Length(texels, 3), width = Length(texels, 2);
    const auto field = Take<T>("textures", texels, {kAny, kAny, kAny});
    for (std::size_t n = 0; n < scenes_.size(); ++n) {
      textures_[n * each + i] = {field.Of(n), static_cast<int>(width), static_cast<int>(height),
                                 static_cast<Wrap>(arrays_.wraps[i]),
                                 static_cast<Filter>(arrays_.filters[i])};
    }
  }
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    scenes_[n].textures = std::span<const TextureT<T>>(textures_).subspan(n * each, each);
  }
}

template <class T>
void SceneRecord<T>::SetSurfaces() {
  const auto indices = Take<std::int32_t>("face_surfaces", {kAny});
  const auto count = static_cast<py::ssize_t>(arrays_.surface_textures.size());
  if (const py::object surfaces = arrays_["surfaces"]; !surfaces.is_none()) {
    const auto numbers = SpanOf<T>(surfaces, "Scene", "surfaces",
                                   {count, static_cast<py::ssize_t>(kSurfaceNumbers)});
    for (std::size_t i = 0; i < arrays_.surface_textures.size(); ++i) {
      surfaces_.push_back(SurfaceOf<T>(numbers.subspan(i * kSurfaceNumbers, kSurfaceNumbers)));
      surfaces_.back().texture = arrays_.surface_textures[i];
    }
  }
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    scenes_[n].surfaces = surfaces_;
    if (indices.given()) scenes_[n].face_surfaces = indices.Of(n);
  }
}

template <class T>
void SceneRecord<T>::SetLights() {
  const py::ssize_t each = Length(arrays_["lights"], 2);
  const auto lights = Take<T>("lights", {each, kLightNumbers});
  const auto sh = Take<T>("sh", {kAny});
  lights_.resize(static_cast<std::size_t>(each) * lights.arrays());
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    lights_[i] = LightOf<T>(lights.all().subspan(i * kLightNumbers, kLightNumbers));
  }
  const auto length = static_cast<std::size_t>(each);
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    scenes_[n].lights =
        std::span<const LightT<T>>(lights_).subspan(lights.own() ? n * length : 0, length);
    if (sh.given()) scenes_[n].sh = sh.Of(n);
  }
}

#define TILEGRAD_INSTANTIATE(T)                               \
  template SurfaceT<T> SurfaceOf(std::span<const T>);         \
  template void PutSurface(const SurfaceT<T>&, std::span<T>); \
  template LightT<T> LightOf(std::span<const T>);             \
  template void PutLight(const LightT<T>&, std::span<T>);     \
  template class SceneRecord<T>;
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::python
