// SPDX-License-Identifier: Apache-2.0
// The foreground pixels of a strip, gathered into runs of one surface and scattered back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "raster/seen_faces.h"
#include "shade/pixel_run.h"

namespace tilegrad {

// Neighbours in a row of a strip whose faces have one surface.
struct PixelSegment {
  std::int32_t surface;
  std::int32_t at;     // of the first pixel in the strip
  std::int32_t count;  // up to kRunPixels
};

// Segments of one surface, of kRunPixels at most together.
struct PixelRun {
  std::span<const PixelSegment> segments;
  std::size_t count;  // pixels
  std::int32_t surface() const { return segments[0].surface; }
};

// The pixels of `rows` (kBinSize wide) that show a face, in their order, surface after surface.
// `face_surfaces` [F] of `source_face` [mesh faces], or empty: all 0.
void FindSegments(const raster::FaceRows& rows, int columns,
                  std::span<const std::int32_t> source_face,
                  std::span<const std::int32_t> face_surfaces, std::vector<PixelSegment>* segments);

// Calls visit(run) for the runs that segments make.
template <class Visit>
void ForEachRun(std::span<const PixelSegment> segments, const Visit& visit) {
  for (std::size_t i = 0; i < segments.size();) {
    std::size_t end = i, count = 0;
    while (end < segments.size() && segments[end].surface == segments[i].surface &&
           count + static_cast<std::size_t>(segments[end].count) <= shade::kRunPixels) {
      count += static_cast<std::size_t>(segments[end++].count);
    }
    visit(PixelRun{segments.subspan(i, end - i), count});
    i = end;
  }
}

// Calls visit(place in the run, pixel of the strip) for each pixel of a run.
template <class Visit>
void ForEachRunPixel(const PixelRun& run, const Visit& visit) {
  std::size_t to = 0;
  for (const PixelSegment& s : run.segments) {
    for (std::int32_t i = 0; i < s.count; ++i) visit(to++, s.at + i);
  }
}

// Where pixels of a strip stand in a plane of an image: rows of `row` floats.
struct StripRows {
  std::ptrdiff_t row;
  std::ptrdiff_t operator()(std::int32_t at) const;  // of a pixel of the strip
};

// to <- the run's pixels of `plane`, whose first is the strip's first pixel; copies of the last one
// fill the last vector.
void GatherRun(const PixelRun& run, const float* plane, const StripRows& rows, shade::RunPlane* to);
// The same; 0 fills the last vector, as cotangents want it.
void GatherCotangents(const PixelRun& run, const float* plane, const StripRows& rows,
                      shade::RunPlane* to);
void ScatterRun(const PixelRun& run, const shade::RunPlane& from, const StripRows& rows,
                float* plane);

// Repeats the last of `count` values, or writes zeros, to the end of its vector.
void PadRun(std::size_t count, shade::RunPlane* p);
void PadRunWithZeros(std::size_t count, shade::RunPlane* p);

}  // namespace tilegrad
