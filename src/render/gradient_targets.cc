// SPDX-License-Identifier: Apache-2.0
#include "render/gradient_targets.h"

#include <algorithm>
#include <functional>
#include <string_view>

#include "base/array_checks.h"
#include "base/error.h"
#include "render/validate.h"

namespace tilegrad {
namespace {

template <class Target>
Status CheckApart(const Target& a, const Target& b) {
  const bool same = a.out.data() == b.out.data() && a.out.size() == b.out.size() &&
                    a.name == std::string_view(b.name) && a.width == b.width;
  if (same || !std::less<>()(b.out.data(), a.out.data() + a.out.size())) return {};
  return InvalidArgument(
      "d_scene.{} of scene {} ({} numbers) and d_scene.{} of scene {} ({} numbers) overlap: "
      "only whole arrays of the same kind and size may be shared",
      a.name, a.scene, a.out.size(), b.name, b.scene, b.out.size());
}

template <class T>
Status OverflowOf(std::size_t scene, const std::string& name, std::span<const T> values) {
  return CheckFinite(("d_scene." + name).c_str(), values)
      .Within(SceneName(scene) + ": the gradient overflows");
}

}  // namespace

template <class T>
void GradientTargets<T>::List(const SceneT<T>& scene, const SceneGradientsT<T>& wanted,
                              std::size_t n) {
  const auto add = [&](std::span<T> out, const char* name, std::optional<Varying> stream,
                       std::optional<std::size_t> texture, int width) {
    if (!out.empty()) targets_.push_back({out, name, n, stream, texture, width, targets_.size()});
  };
  ForEachStream(scene, wanted, [&](const SceneStream<T>& stream) {
    add(stream.gradient, stream.name, stream.what, {}, 0);
  });
  add(wanted.sh, "sh", {}, {}, 0);
  for (std::size_t t = 0; t < wanted.textures.size(); ++t) {
    add(wanted.textures[t], "textures", {}, t,
        t < scene.textures.size() ? scene.textures[t].width : 0);
  }
}

template <class T>
void GradientTargets<T>::TakeRecords(const SceneGradientsT<T>& wanted, std::size_t n) {
  Records& records = records_[n];
  records.surfaces.resize(wanted.surfaces.size());
  records.lights.resize(wanted.lights.size());
  SceneGradientsT<T>& own = scenes_.emplace_back(wanted);
  own.surfaces = records.surfaces;
  own.lights = records.lights;
  own.camera = wanted.camera == nullptr ? nullptr : &records.camera;
  ClearRecords(own);
}

template <class T>
Status GradientTargets<T>::Begin(std::span<const SceneT<T>> scenes,
                                 std::span<const SceneGradientsT<T>> wanted) {
  wanted_ = wanted;
  targets_.clear();
  arrays_.clear();
  scenes_.clear();
  if (records_.size() < wanted.size()) records_.resize(wanted.size());
  const SceneT<T> nothing;
  for (std::size_t n = 0; n < wanted.size(); ++n) {
    List(n < scenes.size() ? scenes[n] : nothing, wanted[n], n);
    TakeRecords(wanted[n], n);
  }
  std::sort(targets_.begin(), targets_.end(), [](const Target& a, const Target& b) {
    if (a.out.data() == b.out.data()) return a.order < b.order;
    return std::less<const T*>()(a.out.data(), b.out.data());
  });
  for (std::size_t i = 0, end = 0; i < targets_.size(); i = end) {
    for (end = i + 1; end < targets_.size(); ++end) {
      TILEGRAD_TRY(CheckApart(targets_[end - 1], targets_[end]));
      if (targets_[end].out.data() != targets_[i].out.data()) break;
    }
    arrays_.push_back(std::span(targets_).subspan(i, end - i));
  }
  std::sort(arrays_.begin(), arrays_.end(),
            [](auto a, auto b) { return a.front().order < b.front().order; });
  return {};
}

template <class T>
void GradientTargets<T>::SplitArrays() {
  std::size_t size = 0;
  for (const Target& target : targets_) size += target.out.size();
  values_.assign(size, T(0));
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    records_[n].textures.assign(wanted_[n].textures.begin(), wanted_[n].textures.end());
    scenes_[n].textures = records_[n].textures;
  }
  std::size_t next = 0;
  for (Target& target : targets_) {
    target.own = std::span(values_).subspan(next, target.out.size());
    next += target.out.size();
    if (target.texture) records_[target.scene].textures[*target.texture] = target.own;
    ForEachPlainArray(scenes_[target.scene], [&](std::string_view name, std::span<T>& array) {
      if (name == target.name) array = target.own;
    });
  }
}

template <class T>
void GradientTargets<T>::JoinArrays() const {
  for (const auto& array : arrays_) {
    const std::span<T> out = array.front().out;
    std::fill(out.begin(), out.end(), T(0));
    for (const Target& target : array) kAddPart("", target.own, out);
  }
}

// Calls visit(numbers) for the caller's arrays, then for the parts of the caller's records.
template <class T>
template <class Visit>
void GradientTargets<T>::ForEachDestination(const Visit& visit) const {
  for (const auto& array : arrays_) visit(array.front().out);
  for (const SceneGradientsT<T>& d : wanted_) {
    ForEachRecordPart(d, [&](const char*, const char*, std::span<T> part) { visit(part); });
  }
}

template <class T>
void GradientTargets<T>::Save() {
  saved_.clear();
  ForEachDestination(
      [&](std::span<T> out) { saved_.insert(saved_.end(), out.begin(), out.end()); });
}

template <class T>
void GradientTargets<T>::Restore() const {
  const T* from = saved_.data();
  ForEachDestination([&](std::span<T> out) {
    std::copy_n(from, out.size(), out.begin());
    from += out.size();
  });
}

template <class T>
bool GradientTargets<T>::AddSaved() const {
  const T* from = saved_.data();
  bool finite = true;
  for (const auto& array : arrays_) {
    const std::span<T> out = array.front().out;
    for (T& x : out) x += *from++;
    finite = finite && AllFinite(out);
  }
  return finite;
}

template <class T>
bool GradientTargets<T>::JoinRecords() const {
  bool finite = true;
  const auto add = AddPartInto(&finite);
  for (std::size_t n = 0; n < wanted_.size(); ++n) {
    const SceneGradientsT<T>& to = wanted_[n];
    const Records& own = records_[n];
    if (to.camera != nullptr) ForEachCameraPart(add, own.camera, *to.camera);
    for (std::size_t i = 0; i < to.lights.size(); ++i)
      ForEachLightPart(add, own.lights[i], to.lights[i]);
    for (std::size_t i = 0; i < to.surfaces.size(); ++i)
      ForEachSurfacePart(add, own.surfaces[i], to.surfaces[i]);
  }
  return finite;
}

template <class T>
Status GradientTargets<T>::Join(bool add) const {
  const bool arrays_finite = !add || AddSaved();
  for (std::size_t n = 0; n < wanted_.size() && !add; ++n) ClearRecords(wanted_[n]);
  if (JoinRecords() && arrays_finite) return {};
  return InvalidArgument("a sum of gradients overflows");
}

template <class T>
Status GradientTargets<T>::CheckSums() const {
  for (const auto& array : arrays_) {
    const Target& target = array.front();
    if (!AllFinite(target.out)) return OverflowOf<T>(target.scene, target.name, target.out);
  }
  Status status;
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    ForEachRecordPart(scenes_[n], [&](const char* record, const char* part, std::span<T> values) {
      if (!status.ok() || AllFinite(values)) return;
      status = OverflowOf<T>(n, fmt::format("{}.{}", record, part), values);
    });
  }
  return status;
}

template class GradientTargets<float>;
template class GradientTargets<double>;

}  // namespace tilegrad
