// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pixel_segments.h"

#include <algorithm>

#include "raster/conventions.h"

namespace tilegrad {
namespace {

std::size_t PaddedEnd(std::size_t count) {
  return (count + shade::kRunPad - 1) / shade::kRunPad * shade::kRunPad;
}

void GatherPixels(const PixelRun& run, const float* plane, const StripRows& rows, float* to) {
  for (const PixelSegment& s : run.segments) {
    const float* const from = plane + rows(s.at);
    to = std::copy(from, from + s.count, to);
  }
}

}  // namespace

void FindSegments(const raster::FaceRows& rows, int columns,
                  std::span<const std::int32_t> source_face,
                  std::span<const std::int32_t> face_surfaces,
                  std::vector<PixelSegment>* segments) {
  segments->clear();
  const auto surface_of = [&](std::int32_t face) -> std::int32_t {
    if (face_surfaces.empty()) return 0;
    return face_surfaces[static_cast<std::size_t>(source_face[static_cast<std::size_t>(face)])];
  };
  for (int i = rows.row_begin; i < rows.row_end; ++i) {
    const std::int32_t* const faces = rows.row(i);
    const std::int32_t at = (i - rows.row_begin) * raster::kBinSize;
    for (std::int32_t j = 0; j < columns;) {
      if (faces[j] == raster::kNoFace) {
        ++j;
        continue;
      }
      const std::int32_t first = j, surface = surface_of(faces[j]);
      while (j < columns && faces[j] != raster::kNoFace && surface_of(faces[j]) == surface) ++j;
      segments->push_back({surface, at + first, j - first});
    }
  }
  if (face_surfaces.empty()) return;
  std::sort(segments->begin(), segments->end(), [](const auto& a, const auto& b) {
    return a.surface != b.surface ? a.surface < b.surface : a.at < b.at;
  });
}

std::ptrdiff_t StripRows::operator()(std::int32_t at) const {
  return static_cast<std::ptrdiff_t>(at >> raster::kBinBits) * row + (at & (raster::kBinSize - 1));
}

void GatherRun(const PixelRun& run, const float* plane, const StripRows& rows,
               shade::RunPlane* to) {
  GatherPixels(run, plane, rows, to->at);
  PadRun(run.count, to);
}

void GatherCotangents(const PixelRun& run, const float* plane, const StripRows& rows,
                      shade::RunPlane* to) {
  GatherPixels(run, plane, rows, to->at);
  PadRunWithZeros(run.count, to);
}

void ScatterRun(const PixelRun& run, const shade::RunPlane& from, const StripRows& rows,
                float* plane) {
  const float* next = from.at;
  for (const PixelSegment& s : run.segments) {
    std::copy(next, next + s.count, plane + rows(s.at));
    next += s.count;
  }
}

void PadRun(std::size_t count, shade::RunPlane* p) {
  std::fill(p->at + count, p->at + PaddedEnd(count), p->at[count - 1]);
}

void PadRunWithZeros(std::size_t count, shade::RunPlane* p) {
  std::fill(p->at + count, p->at + PaddedEnd(count), 0.0f);
}

}  // namespace tilegrad
