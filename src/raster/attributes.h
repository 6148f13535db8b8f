// SPDX-License-Identifier: Apache-2.0
// Attributes of a mesh: values interpolated across its faces (colours, uv, normals, ...).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "raster/screen_mesh.h"
#include "tilegrad/options.h"
#include "tilegrad/scene.h"

namespace tilegrad::raster {

// Attributes in the layout of a ScreenMesh, i.e. after near clipping. T may be const.
template <class T>
struct AttributeViewT {
  std::span<T> values;  // [V,C] or [F,3,C] by rate
  int channels = 0;
  Rate rate = Rate::kVertex;

  // The C values of a face's corner.
  template <class U>
  T* corner(const ScreenMeshT<U>& mesh, std::size_t face, int k) const {
    const std::size_t row = rate == Rate::kVertex ? static_cast<std::size_t>(mesh.vertex(face, k))
                                                  : 3 * face + static_cast<std::size_t>(k);
    return values.data() + row * static_cast<std::size_t>(channels);
  }
};

}  // namespace tilegrad::raster
