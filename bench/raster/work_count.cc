// SPDX-License-Identifier: Apache-2.0
#include "raster/work_count.h"

#include <algorithm>
#include <vector>

#include "raster/culled_geometry.h"

namespace tilegrad::bench {
namespace {

using plain::Box;
using plain::Point;
using plain::Triangle;

constexpr int kBlockWidth = 4, kBlockHeight = 2, kBlockPixels = kBlockWidth * kBlockHeight;

// Operations a unit of work takes at least, where all of it is done in vectors.
constexpr double kSetUpOps = 60, kSetUpLoads = 12;  // a face: three vertices of four numbers
constexpr double kCoverOps = 12;                    // a pixel of a block: edges, depth, comparison
constexpr double kShadeOps = 25, kShadeLoads = 18;  // a covered pixel; a seen face
constexpr double kPairOps = 30;                     // three distances, exponential, product
constexpr double kPairBackwardOps = 45;
constexpr double kShadeBackwardOps = 45, kShadeBackwardSums = 15;  // a covered pixel; a seen face
constexpr double kWord = 4;                                        // bytes
constexpr double kColors = 3;

// Calls visit(block) for the blocks that a box has pixels of.
template <class Visit>
void ForBlocks(const Box& box, const Visit& visit) {
  if (box.x0 >= box.x1) return;
  const int left = box.x0 - box.x0 % kBlockWidth, top = box.y0 - box.y0 % kBlockHeight;
  for (int y = top; y < box.y1; y += kBlockHeight) {
    for (int x = left; x < box.x1; x += kBlockWidth) {
      visit(Box{std::max(x, box.x0), std::max(y, box.y0), std::min(x + kBlockWidth, box.x1),
                std::min(y + kBlockHeight, box.y1)});
    }
  }
}

void CountFace(const CulledScene& scene, const CulledFrame& frame, const Triangle& t,
               WorkCount* work) {
  ForBlocks(plain::BoxOf(scene, t, 0), [&](const Box&) { ++work->hard_blocks; });
  const float reach = plain::Reach(scene), far = reach * reach;
  ForBlocks(plain::BoxOf(scene, t, reach), [&](const Box& block) {
    const double before = work->pairs;
    plain::ForPixels(scene, block, [&](std::size_t pixel, Point p) {
      if (frame.face_ids[pixel] < 0 && plain::NearestOf(t, p).squared <= far) ++work->pairs;
    });
    if (work->pairs > before) ++work->soft_blocks;
  });
}

double Milliseconds(double amount, double rate) { return 1e3 * amount / rate; }

Limit Combine(double hard, double soft, double soft_in_blocks, double memory, double bytes) {
  return {std::max(hard + soft, memory), hard + soft_in_blocks + memory, bytes};
}

}  // namespace

WorkCount& WorkCount::operator+=(const WorkCount& other) {
  pixels += other.pixels;
  faces += other.faces;
  covered += other.covered;
  seen += other.seen;
  hard_blocks += other.hard_blocks;
  soft_blocks += other.soft_blocks;
  pairs += other.pairs;
  return *this;
}

WorkCount CountWork(const CulledScene& scene, const CulledFrame& frame) {
  WorkCount work;
  const std::size_t faces = scene.faces.size() / 3;
  work.pixels = static_cast<double>(frame.face_ids.size());
  work.faces = static_cast<double>(faces);
  std::vector<bool> seen(faces);
  for (const std::int32_t id : frame.face_ids) {
    if (id >= 0) {
      ++work.covered;
      seen[static_cast<std::size_t>(id)] = true;
    }
  }
  work.seen = static_cast<double>(std::count(seen.begin(), seen.end(), true));
  for (std::size_t f = 0; f < faces; ++f) CountFace(scene, frame, plain::FaceAt(scene, f), &work);
  return work;
}

Limit ForwardLimit(const WorkCount& work, const CulledParts& parts, const MachineRates& rates) {
  const double words = 1 + (parts.color ? kColors : 0) + (parts.alpha ? 1 : 0);
  const double bytes = words * kWord * work.pixels;
  double hard = Milliseconds(kSetUpOps * work.faces, rates.lane_ops) +
                Milliseconds(kSetUpLoads * work.faces, rates.loads) +
                Milliseconds(kCoverOps * kBlockPixels * work.hard_blocks, rates.lane_ops);
  if (parts.color) {
    hard += Milliseconds(kShadeOps * work.covered, rates.lane_ops) +
            Milliseconds(kShadeLoads * work.seen, rates.loads);
  }
  const double soft = parts.alpha ? Milliseconds(kPairOps, rates.lane_ops) : 0;
  return Combine(hard, soft * work.pairs, soft * kBlockPixels * work.soft_blocks,
                 Milliseconds(bytes, rates.write), bytes);
}

Limit BackwardLimit(const WorkCount& work, const CulledParts& parts, const MachineRates& rates) {
  const double words = 1 + (parts.color ? kColors : 0) + (parts.alpha ? 2 : 0);
  const double bytes = words * kWord * work.pixels;
  const double hard = parts.color
                          ? Milliseconds(kShadeBackwardOps * work.covered, rates.lane_ops) +
                                Milliseconds(kShadeBackwardSums * work.seen, rates.horizontal_sums)
                          : 0;
  const double soft = parts.alpha ? Milliseconds(kPairBackwardOps, rates.lane_ops) : 0;
  return Combine(hard, soft * work.pairs, soft * kBlockPixels * work.soft_blocks,
                 Milliseconds(bytes, rates.read), bytes);
}

}  // namespace tilegrad::bench
