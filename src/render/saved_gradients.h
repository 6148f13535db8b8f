// SPDX-License-Identifier: Apache-2.0
// GradientMode::kAdd over a renderer that overwrites: what the caller's arrays hold is kept aside,
// and added when the gradients are there.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "render/scene_fields.h"

namespace tilegrad {

template <class T>
class SavedGradients {
 public:
  // Each array once, whoever shares it.
  void Save(std::span<const SceneGradientsT<T>> gradients) {
    arrays_.clear();
    for (const SceneGradientsT<T>& d : gradients) {
      ForEachGradientArray(SceneT<T>(), d, [&](const char*, std::span<T> array, int) {
        if (!array.empty()) arrays_.push_back(array);
      });
    }
    const auto before = [](auto a, auto b) { return std::less<T*>()(a.data(), b.data()); };
    const auto same = [](auto a, auto b) { return a.data() == b.data(); };
    std::sort(arrays_.begin(), arrays_.end(), before);
    arrays_.erase(std::unique(arrays_.begin(), arrays_.end(), same), arrays_.end());
    values_.clear();
    for (const auto& array : arrays_) values_.insert(values_.end(), array.begin(), array.end());
  }

  void Restore() const {
    const T* from = values_.data();
    for (const auto& array : arrays_) {
      std::copy_n(from, array.size(), array.begin());
      from += array.size();
    }
  }

  // False, and the arrays are as they were, if a sum is not finite.
  bool Add() const {
    const T* from = values_.data();
    T not_finite = T(0);
    for (const auto& array : arrays_) {
      for (T& x : array) {
        x += *from++;
        not_finite += x - x;
      }
    }
    if (not_finite == T(0)) return true;
    Restore();
    return false;
  }

 private:
  std::vector<std::span<T>> arrays_;
  AlignedVector<T> values_;
};

}  // namespace tilegrad
