// SPDX-License-Identifier: Apache-2.0
// Vector body of soft_mask_tree.h, and which nodes a tile looks at. Lanes are faces, nodes, groups.

#if defined(TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_
#undef TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_
#else
#define TILEGRAD_RASTER_SOFT_MASK_TREE_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <span>

#include "raster/face_lanes-inl.h"
#include "raster/soft_mask_plan.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using SoftTag = hn::CappedTag<float, kSoftLanes>;
using SoftVec = hn::Vec<SoftTag>;
using SoftMask = hn::Mask<SoftTag>;
using SoftIntTag = hn::RebindToSigned<SoftTag>;
using SoftInt = hn::Vec<SoftIntTag>;

// Bit i: lane i.
HWY_INLINE std::uint32_t BitsOf(SoftTag d, SoftMask mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0];
}

// A lower bound of the squared distance between lanes of boxes and one box, kernel units. Sides are
// subtracted with one rounding, so it is relatively exact to 8 u, which the last factor covers.
HWY_INLINE SoftVec BoxDistance(SoftTag d, SoftVec left, SoftVec top, SoftVec right, SoftVec bottom,
                               const SoftBox& box) {
  const SoftVec zero = hn::Zero(d);
  const auto gap_x =
      hn::Max(hn::Sub(left, hn::Set(d, box.right)), hn::Sub(hn::Set(d, box.left), right));
  const auto gap_y =
      hn::Max(hn::Sub(top, hn::Set(d, box.bottom)), hn::Sub(hn::Set(d, box.top), bottom));
  const auto x = hn::Mul(hn::Max(gap_x, zero), hn::Set(d, box.unit_x));
  const auto y = hn::Mul(hn::Max(gap_y, zero), hn::Set(d, box.unit_y));
  return hn::Mul(hn::MulAdd(x, x, hn::Mul(y, y)), hn::Set(d, 1 - 0x1p-20f));
}

HWY_INLINE SoftVec BoxDistance(SoftTag d, const SoftBoxes& boxes, std::size_t i,
                               const SoftBox& box) {
  const auto side = [&](SoftBoxes::Array a) HWY_ATTR { return hn::LoadU(d, boxes.array(a) + i); };
  return BoxDistance(d, side(SoftBoxes::kLeft), side(SoftBoxes::kTop), side(SoftBoxes::kRight),
                     side(SoftBoxes::kBottom), box);
}

// Corners of faces f, f + 1, ...; kNowhere where there is none that takes part.
HWY_INLINE void StoreCorners(SoftTag d, const ScreenMesh& mesh, std::size_t f, SoftTree* tree) {
  const SoftIntTag di;
  const std::size_t lanes = hn::Lanes(d);
  const std::int32_t* corners[3] = {mesh.v0.data() + f, mesh.v1.data() + f, mesh.v2.data() + f};
  HWY_ALIGN std::int32_t out_of_it[kSoftLanes];
  std::int32_t vertex[3][kSoftLanes];
  for (std::size_t i = 0; i < lanes; ++i) {
    const bool exists = f + i < mesh.faces();
    out_of_it[i] = exists && (mesh.reject[f + i] & kFaceNotInSoftMask) == 0 ? 0 : -1;
    for (std::size_t k = 0; k < 3; ++k) vertex[k][i] = exists ? corners[k][i] : 0;
  }
  const SoftMask nowhere = hn::RebindMask(d, hn::Lt(hn::Load(di, out_of_it), hn::Zero(di)));
  for (std::size_t k = 0; k < 3; ++k) {
    SoftVec numbers[4];  // x, y, 1 / depth, depth
    LoadQuads(
        d,
        [&](std::size_t i)
            HWY_ATTR { return &mesh.packed[static_cast<std::size_t>(vertex[k][i])].x; },
        0, numbers);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      hn::Store(hn::IfThenElse(nowhere, hn::Set(d, kNowhere), numbers[axis]), d,
                tree->corners.data() + (3 * axis + k) * tree->stride + f);
    }
  }
}

// The box around boxes [from, from + n).
template <class Load>
HWY_INLINE void StoreBox(SoftTag d, std::size_t n, const Load& load, std::size_t at,
                         SoftBoxes* out) {
  for (std::size_t a = 0; a < 4; ++a) {
    const bool low = a < SoftBoxes::kRight;
    SoftVec v = load(0, a);
    for (std::size_t i = hn::Lanes(d); i < n; i += hn::Lanes(d)) {
      v = low ? hn::Min(v, load(i, a)) : hn::Max(v, load(i, a));
    }
    out->array(a)[at] = hn::GetLane(low ? hn::MinOfLanes(d, v) : hn::MaxOfLanes(d, v));
  }
}

HWY_INLINE void StoreNode(SoftTag d, std::size_t node, SoftTree* tree) {
  const std::size_t first = node * kNodeFaces;
  float faces = 0;
  for (std::size_t f = first; f < first + kNodeFaces; ++f) faces += tree->corner(0)[f] < kNowhere;
  tree->nodes.array(SoftBoxes::kFaces)[node] = faces;
  StoreBox(
      d, kNodeFaces,
      [&](std::size_t i, std::size_t a) HWY_ATTR {
        const std::size_t axis = a == SoftBoxes::kLeft || a == SoftBoxes::kRight ? 0 : 3;
        const auto corner = [&](std::size_t k) HWY_ATTR {
          const SoftVec at = hn::Load(d, tree->corner(axis + k) + first + i);
          // On the far side, too, a face that is nowhere widens no box.
          return a < SoftBoxes::kRight
                     ? at
                     : hn::IfThenElse(hn::Eq(at, hn::Set(d, kNowhere)), hn::Set(d, -kNowhere), at);
        };
        return a < SoftBoxes::kRight ? hn::Min(hn::Min(corner(0), corner(1)), corner(2))
                                     : hn::Max(hn::Max(corner(0), corner(1)), corner(2));
      },
      node, &tree->nodes);
}

HWY_INLINE void StoreGroup(SoftTag d, std::size_t group, SoftTree* tree) {
  const std::size_t first = group * kGroupNodes;
  float faces = 0;
  for (std::size_t n = first; n < first + kGroupNodes; ++n) {
    faces += tree->nodes.array(SoftBoxes::kFaces)[n];
  }
  tree->groups.array(SoftBoxes::kFaces)[group] = faces;
  StoreBox(
      d, kGroupNodes,
      [&](std::size_t i, std::size_t a)
          HWY_ATTR { return hn::LoadU(d, tree->nodes.array(a) + first + i); },
      group, &tree->groups);
}

// Groups [begin, end) with all that is in them.
inline void BuildSoftGroupsTarget(const ScreenMesh& mesh, std::size_t begin, std::size_t end,
                                  SoftTree* tree) {
  const SoftTag d;
  for (std::size_t f = begin * kGroupFaces; f < end * kGroupFaces; f += hn::Lanes(d)) {
    StoreCorners(d, mesh, f, tree);
  }
  for (std::size_t n = begin * kGroupNodes; n < end * kGroupNodes; ++n) StoreNode(d, n, tree);
  for (std::size_t g = begin; g < end; ++g) StoreGroup(d, g, tree);
}

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
inline SoftBox CentresOf(const TileRect& rect, const SoftMaskPlan& plan) {
  return {static_cast<float>(rect.x0) + 0.5f, static_cast<float>(rect.y0) + 0.5f,
          static_cast<float>(rect.x1) - 0.5f, static_cast<float>(rect.y1) - 0.5f,
          static_cast<float>(plan.unit_x),    static_cast<float>(plan.unit_y)};
}

// The squared distance behind which groups are dropped, and a little for its rounding.
inline float GroupLimit(const SoftMaskPlan& plan) {
  return static_cast<float>(plan.group_z * (1 + 0x1p-20));
}

// The groups that are not far from all pixels of a region. Distances grow with every box inside it,
// in floating point too, so none that a tile would keep is lost.
inline void FindNearGroups(const SoftTree& tree, const SoftMaskPlan& plan, const TileRect& rect,
                           SoftNearGroups* near) {
  const SoftTag d;
  const SoftBox box = CentresOf(rect, plan);
  const std::size_t count = tree.groups.count;
  near->boxes.Resize(count), near->count = 0;
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

// Appends the nodes of a group that have faces to the `count` found; returns the new count.
HWY_INLINE std::size_t AppendNodes(const SoftTree& tree, std::size_t group, const SoftBox& box,
                                   std::size_t count, AlignedVector<SoftNodeAt>* found) {
  const SoftTag d;
  const SoftIntTag di;
  const float* faces = tree.nodes.array(SoftBoxes::kFaces);
  for (std::size_t n = group * kGroupNodes; n < (group + 1) * kGroupNodes; n += hn::Lanes(d)) {
    HWY_ALIGN std::int32_t whole[kSoftLanes];
    const SoftVec z = hn::Min(BoxDistance(d, tree.nodes, n, box), hn::Set(d, float{kEndZ}));
    hn::Store(hn::ConvertTo(di, z), di, whole);
    for (std::size_t i = 0; i < hn::Lanes(d); ++i) {
      (*found)[count] = {static_cast<std::int32_t>(n + i), whole[i]};
      count += faces[n + i] != 0;
    }
  }
  return count;
}

// Nodes of groups nearer than group_z into `found`; returns how many. Adds a bound on the sum of A
// of the other groups to `dropped`.
HWY_INLINE std::size_t FindNodesOfGroups(const SoftTree& tree, const SoftMaskPlan& plan,
                                         const SoftBox& box, const SoftNearGroups& groups,
                                         AlignedVector<SoftNodeAt>* found, double* dropped) {
  const SoftTag d;
  if (found->size() < tree.nodes.count) found->resize(tree.nodes.count);
  std::size_t count = 0;
  double near_faces = 0;
  for (std::size_t g = 0; g < groups.count; g += hn::Lanes(d)) {
    std::uint32_t bits = NearBits(d, groups.boxes, g, groups.count, box, GroupLimit(plan));
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t i = g + static_cast<std::size_t>(std::countr_zero(bits));
      count = AppendNodes(tree, static_cast<std::size_t>(groups.group[i]), box, count, found);
      near_faces += static_cast<double>(groups.boxes.array(SoftBoxes::kFaces)[i]);
    }
  }
  *dropped += (static_cast<double>(tree.faces) - near_faces) * plan.group_influence;
  return count;
}

// Nodes by the whole part of their z; those from `end` on together.
struct SoftHistogram {
  int end;
  float faces[kEndZ + 1];
  std::int32_t nodes[kEndZ + 1];

  HWY_INLINE SoftHistogram(const SoftBoxes& boxes, std::span<const SoftNodeAt> found, int end_z)
      : end(end_z) {
    std::fill_n(faces, end + 1, 0.0f), std::fill_n(nodes, end + 1, 0);
    const float* in = boxes.array(SoftBoxes::kFaces);
    for (const SoftNodeAt& at : found) {
      const int z = std::min(at.z, end);
      faces[z] += in[at.node], ++nodes[z];
    }
  }
  // Drops the farthest as long as `budget` lasts; returns the first whole z that is dropped, and
  // adds what that costs to `dropped`.
  int DropFar(double budget, double* dropped) const {
    int from = end;
    double influence = std::ldexp(1.0, -end), cost = static_cast<double>(faces[end]) * influence;
    while (from > 0) {
      influence *= 2;
      const double more = static_cast<double>(faces[from - 1]) * influence;
      if (cost + more > budget) break;
      cost += more, --from;
    }
    *dropped += cost;
    return from;
  }
};

// The nodes that a tile with background in `box` must look at, near ones first: a counting sort.
inline SoftNodes FindSoftNodes(const SoftTree& tree, const SoftMaskPlan& plan, const SoftBox& box,
                               SoftMaskScratch* scratch) {
  SoftNodes out;
  const std::size_t count =
      FindNodesOfGroups(tree, plan, box, scratch->groups, &scratch->found, &out.dropped);
  if (count == 0) return out;
  const auto found = std::span<const SoftNodeAt>(scratch->found).first(count);
  // All faces at group_z together are within the budget.
  const SoftHistogram histogram(tree.nodes, found, static_cast<int>(std::ceil(plan.group_z)));
  const int end = histogram.DropFar(plan.node_error / 2, &out.dropped);
  std::size_t begin[kEndZ + 1];
  for (int z = 0; z < end; ++z) {
    out.faces += static_cast<std::size_t>(histogram.faces[z]);
    begin[z] = out.count, out.count += static_cast<std::size_t>(histogram.nodes[z]);
  }
  begin[end] = out.count;  // those that are dropped go behind the others: no branch
  if (scratch->nodes.size() < count) scratch->nodes.resize(count);
  for (const SoftNodeAt& at : found) scratch->nodes[begin[std::min(at.z, end)]++] = at.node;
  return out;
}

}  // namespace tilegrad::raster::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
