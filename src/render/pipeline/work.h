// SPDX-License-Identifier: Apache-2.0
// What a call of the pipeline did, and how long it took.
#pragma once

#include <cstdint>

namespace tilegrad {

// What a call of Render or Backward did. Parts: bins of an image where it is drawn or given alpha,
// bands of it on the way back through attributes.
struct RenderStats {
  std::int64_t prepared = 0;  // images projected and listed; others were as they had been before
  std::int64_t drawn = 0;     // parts
  std::int64_t interpolated = 0;  // parts, forward or backward
  std::int64_t alpha_parts = 0;   // parts, forward or backward
  std::int64_t merged = 0;        // arrays of gradients: positions and attributes count apart
  // Of the soft mask, forward or backward, lanes of vectors that had no face included. They depend
  // on the instruction set.
  std::int64_t pairs = 0;       // of a face and a background pixel that were evaluated
  std::int64_t powers = 0;      // exponentials
  const char* alpha_rule = "";  // AlphaStage::name, where alpha was made or pulled on
};

// Milliseconds in the stages of a call, summed over workers.
struct RenderTimes {
  double prepare = 0;      // project, bin, and the hierarchy of the soft mask
  double visibility = 0;   // which face a pixel shows, and depth
  double interpolate = 0;  // attributes of pixels, forward or backward
  double stage = 0;        // a PixelStage
  double gradients = 0;    // from attributes of pixels to faces
  double alpha = 0;        // the soft mask, forward or backward
  double merge = 0;        // from faces to the scene
};

}  // namespace tilegrad
