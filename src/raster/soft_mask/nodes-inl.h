// SPDX-License-Identifier: Apache-2.0
// Which nodes of the tree a tile looks at. Lanes are nodes, groups.

#if defined(TILEGRAD_RASTER_SOFT_MASK_NODES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_NODES_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_NODES_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_NODES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>

#include "base/simd_math-inl.h"
#include "raster/soft_mask/compact-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace simd = tilegrad::HWY_NAMESPACE;

// The nodes that a tile looks at.
struct SoftNodes {
  std::size_t count = 0;
  std::size_t faces = 0;  // in them
  double dropped = 0;     // bound on the sum of A of all other faces
};

// Bits of those of n boxes from i on that are within z of `box`.
HWY_INLINE std::uint32_t NearBits(SoftTag d, const SoftBoxes& boxes, std::size_t i, std::size_t n,
                                  const SoftBox& box, float z) {
  const SoftMask near = hn::Le(BoxDistance(d, boxes, i, box), hn::Set(d, z));
  return BitsOf(d, hn::And(near, hn::FirstN(d, n - i)));
}

// The box around the pixel centres of a rectangle.
inline SoftBox CentresOf(const PixelRect& rect, const SoftMaskPlan& plan) {
  return {static_cast<float>(rect.x0) + 0.5f, static_cast<float>(rect.y0) + 0.5f,
          static_cast<float>(rect.x1) - 0.5f, static_cast<float>(rect.y1) - 0.5f,
          static_cast<float>(plan.unit_x),    static_cast<float>(plan.unit_y)};
}

// The squared distance behind which groups are dropped, and a little for its rounding.
inline float GroupLimit(const SoftMaskPlan& plan) {
  return static_cast<float>(plan.group_z * (1 + 0x1p-20));
}

// The groups that are near some pixel of a region. A box inside the region is no nearer to a group
// than the region is, in floating point too, so no group that a tile would keep is lost.
inline void FindNearGroups(const SoftTree& tree, const SoftMaskPlan& plan, const PixelRect& rect,
                           SoftNearGroups* near) {
  const SoftTag d;
  const SoftBox box = CentresOf(rect, plan);
  const std::size_t count = tree.groups.count;
  near->boxes.Resize(count);
  near->count = 0;
  if (near->group.size() < count) near->group.resize(count);
  for (std::size_t g = 0; g < count; g += hn::Lanes(d)) {
    std::uint32_t bits = NearBits(d, tree.groups, g, count, box, GroupLimit(plan));
    for (; bits != 0; bits &= bits - 1, ++near->count) {
      const std::size_t group = g + static_cast<std::size_t>(std::countr_zero(bits));
      near->group[near->count] = static_cast<std::int32_t>(group);
      for (std::size_t a = 0; a < SoftBoxes::kArrays; ++a) {
        near->boxes.array(a)[near->count] = tree.groups.array(a)[group];
      }
    }
  }
}

// Appends those nodes of a group that have faces and are nearer than z = `end` to the `count`
// found; returns the new count.
HWY_INLINE std::size_t AppendNodes(const SoftTree& tree, std::size_t group, const SoftBox& box,
                                   int end, std::size_t count, SoftNodesAt* found) {
  const SoftTag d;
  const SoftIntTag di;
  const SoftVec limit = hn::Set(d, static_cast<float>(end));
  const float* faces = tree.nodes.array(SoftBoxes::kFaces);
  for (std::size_t n = group * kGroupNodes; n < (group + 1) * kGroupNodes; n += hn::Lanes(d)) {
    const SoftVec z = BoxDistance(d, tree.nodes, n, box);
    const SoftMask full = hn::Gt(hn::Load(d, faces + n), hn::Zero(d));
    const Compactor compact(d, hn::And(full, hn::Lt(z, limit)));
    compact.Store(simd::CountFrom(di, static_cast<std::int32_t>(n)), found->node.data() + count);
    compact.Store(hn::ConvertTo(di, hn::Min(z, limit)), found->z.data() + count);
    count += compact.count();
  }
  return count;
}

// Nodes of groups nearer than group_z into `found`, unless they are beyond z = `end`; returns how
// many. Adds a bound on the sum of A of the other groups to `dropped`, and all faces of these ones
// to `near_faces`.
HWY_INLINE std::size_t FindNodesOfGroups(const SoftTree& tree, const SoftMaskPlan& plan,
                                         const SoftBox& box, int end, SoftMaskScratch* scratch,
                                         double* dropped, double* near_faces) {
  const SoftTag d;
  const SoftNearGroups& groups = scratch->groups;
  SoftNodesAt& found = scratch->found;
  if (found.node.size() < tree.nodes.count) {
    found.node.resize(tree.nodes.count);
    found.z.resize(tree.nodes.count);
  }
  std::size_t count = 0;
  for (std::size_t g = 0; g < groups.count; g += hn::Lanes(d)) {
    std::uint32_t bits = NearBits(d, groups.boxes, g, groups.count, box, GroupLimit(plan));
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t i = g + static_cast<std::size_t>(std::countr_zero(bits));
      count = AppendNodes(tree, static_cast<std::size_t>(groups.group[i]), box, end, count, &found);
      *near_faces += static_cast<double>(groups.boxes.array(SoftBoxes::kFaces)[i]);
    }
  }
  *dropped += (static_cast<double>(tree.faces) - *near_faces) * plan.group_influence;
  return count;
}

// A histogram of nodes by the integer part of their z, which is less than `end`.
struct SoftHistogram {
  int end;
  double beyond;  // faces of others, from `end` on
  float faces[kEndZ + 1];
  std::int32_t nodes[kEndZ + 1];

  // `near_faces` is how many faces there are in all.
  HWY_INLINE SoftHistogram(const SoftBoxes& boxes, const SoftNodesAt& found, std::size_t count,
                           int end_z, double near_faces)
      : end(end_z), beyond(near_faces) {
    std::fill_n(faces, end, 0.0f);
    std::fill_n(nodes, end, 0);
    const float* in = boxes.array(SoftBoxes::kFaces);
    for (std::size_t i = 0; i < count; ++i) {
      const float more = in[found.node[i]];
      faces[found.z[i]] += more;
      ++nodes[found.z[i]];
      beyond -= static_cast<double>(more);
    }
  }
  // Drops the farthest as long as `budget` lasts; returns the first whole z that is dropped, and
  // adds what that costs to `dropped`.
  int DropFar(double budget, double* dropped) const {
    int from = end;
    double influence = std::ldexp(1.0, -end), cost = beyond * influence;
    while (from > 0) {
      influence *= 2;
      const double more = static_cast<double>(faces[from - 1]) * influence;
      if (cost + more > budget) break;
      cost += more;
      --from;
    }
    *dropped += cost;
    return from;
  }
};

// The nodes that a tile with background in `box` must look at, near ones first: a counting sort.
inline SoftNodes FindSoftNodes(const SoftTree& tree, const SoftMaskPlan& plan, const SoftBox& box,
                               SoftMaskScratch* scratch) {
  SoftNodes out;
  const int far = static_cast<int>(std::ceil(plan.group_z));
  double near_faces = 0;
  const std::size_t count =
      FindNodesOfGroups(tree, plan, box, far, scratch, &out.dropped, &near_faces);
  if (count == 0) {  // the usual case for tiles of pure background
    out.dropped += std::ldexp(near_faces, -far);
    return out;
  }
  const SoftNodesAt& found = scratch->found;
  // All faces at group_z together are within the budget.
  const SoftHistogram histogram(tree.nodes, found, count, far, near_faces);
  const int end = histogram.DropFar(plan.node_error / 2, &out.dropped);
  std::size_t begin[kEndZ + 1];
  for (int z = 0; z < end; ++z) {
    out.faces += static_cast<std::size_t>(histogram.faces[z]);
    begin[z] = out.count;
    out.count += static_cast<std::size_t>(histogram.nodes[z]);
  }
  begin[end] = out.count;  // those that are dropped go behind the others: no branch
  if (scratch->nodes.size() < count) scratch->nodes.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    scratch->nodes[begin[std::min(found.z[i], end)]++] = found.node[i];
  }
  return out;
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
