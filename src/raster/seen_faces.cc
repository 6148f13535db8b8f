// SPDX-License-Identifier: Apache-2.0
#include "raster/seen_faces.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "raster/seen_faces.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "raster/seen_faces-inl.h"

#if HWY_ONCE
namespace tilegrad::raster {
namespace {

HWY_EXPORT(NumberAllRows);

template <class T>
void GrowTo(std::size_t size, T fill, AlignedVector<T>* array) {
  if (array->size() < size) array->resize(size, fill);
}

}  // namespace

void ReserveSeenFaces(std::size_t mesh_faces, std::size_t pixels, SeenFaces* out) {
  const std::size_t slots = SeenFaces::MostSlots(mesh_faces, pixels);
  GrowTo(1 + mesh_faces, -1, &out->slot_of_face);
  out->slot_of_face[0] = 0;
  GrowTo(slots, 0, &out->face);
  for (auto* array : {&out->origin_x, &out->origin_y}) GrowTo(slots, 0.0f, array);
}

void NumberFaces(const FaceRows& rows, std::size_t mesh_faces, SeenFaces* out) {
  ReserveSeenFaces(mesh_faces, rows.pixels(), out);
  HWY_DYNAMIC_DISPATCH(NumberAllRows)(rows, out);
  if (out->faces() == 0) return;
  const auto copy_first = [&](std::size_t to) {
    out->face[to] = out->face[1];
    out->origin_x[to] = out->origin_x[1];
    out->origin_y[to] = out->origin_y[1];
  };
  copy_first(0);
  for (std::size_t s = out->count; s < out->stride(); ++s) copy_first(s);
}

void ForgetFaces(SeenFaces* faces) {
  for (std::size_t s = 1; s < faces->count; ++s) {
    faces->slot_of_face[static_cast<std::size_t>(1 + faces->face[s])] = -1;
  }
}

}  // namespace tilegrad::raster
#endif
