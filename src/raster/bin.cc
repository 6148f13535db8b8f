// SPDX-License-Identifier: Apache-2.0
#include "raster/bin.h"

#include <algorithm>
#include <numeric>

#include "base/parallel.h"

namespace tilegrad::raster {
namespace {

// Calls emit(bin) for the bins of a face. Most have one.
template <class Emit>
void ForEachBin(const BinRange& range, int bin_columns, const Emit& emit) {
  if ((range.columns | range.rows) == 1) {
    emit(static_cast<std::size_t>(range.first));
    return;
  }
  for (int row = 0; row < range.rows; ++row) {
    for (int column = 0; column < range.columns; ++column) {
      emit(static_cast<std::size_t>(range.first + row * bin_columns + column));
    }
  }
}

// Calls emit(index of the face, bin) for all faces of lists [begin, end).
template <class Emit>
void ForEachFaceAndBin(const DrawnFaces& faces, int bin_columns, std::size_t begin, std::size_t end,
                       const Emit& emit) {
  for (std::size_t list = begin; list < end; ++list) {
    std::size_t face = list * DrawnFaces::kChunk;
    for (const BinRange& range : faces.bins_of_list(list)) {
      ForEachBin(range, bin_columns, [&](std::size_t bin) { emit(face, bin); });
      ++face;
    }
  }
}

// Prefix sum over each chunk's faces per bin: sets `begin` and `cursor`.
void PlaceChunks(std::size_t bins, BinListBuffers* buffers) {
  std::int32_t total = 0;
  for (std::size_t t = 0; t < bins; ++t) {
    buffers->begin[t] = total;
    for (std::size_t at = t; at < buffers->cursor.size(); at += bins) {
      const std::int32_t count = buffers->cursor[at];
      buffers->cursor[at] = total;
      total += count;
    }
  }
  buffers->begin[bins] = total;
}

// A counting sort, which is stable, in chunks of `share` lists. A chunk has at least as many faces
// as there are bins; otherwise its counters would cost more than its faces.
BinLists SortIntoBins(const DrawnFaces& faces, const SquareGrid& grid, BinListBuffers* buffers,
                      const Workers* workers) {
  constexpr std::size_t kList = DrawnFaces::kChunk;
  const std::size_t bins = grid.cells(), lists = faces.counts.size();
  const std::size_t share = (bins + kList - 1) / kList;
  buffers->begin.resize(bins + 1);
  buffers->cursor.assign((lists + share - 1) / share * bins, 0);
  const auto for_each_bin = [&](const auto& emit) {
    ForChunks(workers, lists, share, [&](std::size_t begin, std::size_t end) {
      std::int32_t* const cursor = buffers->cursor.data() + begin / share * bins;
      ForEachFaceAndBin(faces, grid.columns, begin, end,
                        [&](std::size_t face, std::size_t bin) { emit(face, &cursor[bin]); });
    });
  };
  for_each_bin([](std::size_t, std::int32_t* count) { ++*count; });
  PlaceChunks(bins, buffers);
  buffers->faces.resize(static_cast<std::size_t>(buffers->begin.back()));
  for_each_bin([&](std::size_t face, std::int32_t* next) {
    buffers->faces[static_cast<std::size_t>((*next)++)] = static_cast<std::int32_t>(face);
  });
  return buffers->View();
}

// All faces into the only bin. Reserves the maximum, not the need: which worker gets which image
// varies between calls, and once every size has occurred nothing may allocate.
BinLists ListAll(const DrawnFaces& faces, BinListBuffers* buffers) {
  buffers->faces.clear();
  buffers->faces.reserve(faces.storage.size());
  for (std::size_t chunk = 0; chunk < faces.counts.size(); ++chunk) {
    const std::size_t before = buffers->faces.size();
    buffers->faces.resize(before + faces.counts[chunk]);
    std::iota(buffers->faces.begin() + static_cast<std::ptrdiff_t>(before), buffers->faces.end(),
              static_cast<std::int32_t>(chunk * DrawnFaces::kChunk));
  }
  buffers->begin = {0, static_cast<std::int32_t>(buffers->faces.size())};
  return buffers->View();
}

}  // namespace

BinLists BinDrawnFaces(const DrawnFaces& faces, const SquareGrid& bins, BinListBuffers* buffers,
                       const Workers* workers) {
  if (bins.cells() == 1) return ListAll(faces, buffers);
  return SortIntoBins(faces, bins, buffers, workers);
}

}  // namespace tilegrad::raster
