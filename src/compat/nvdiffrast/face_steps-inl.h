// SPDX-License-Identifier: Apache-2.0
// Vector body of face_steps.h. Lanes are pixels.

#include <hwy/highway.h>

#include "compat/nvdiffrast/face_steps.h"
#include "compat/nvdiffrast/face_steps_ref.h"
#include "compat/nvdiffrast/quads-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE {

using IdTag = HWY_CAPPED(float, 16);
using IdIntTag = hn::RebindToSigned<IdTag>;
using IdInt = hn::Vec<IdIntTag>;

std::size_t ReadRow(std::span<const float> rast, std::size_t faces, FaceRow* out) {
  const IdTag d;
  const IdIntTag di;
  const std::size_t width = rast.size() / 4, lanes = hn::Lanes(d);
  std::size_t bad = kNoPixel, x = 0;
  for (; x + lanes <= width; x += lanes) {
    hn::Vec<IdTag> u, v, depth, id;
    hn::LoadInterleaved4(d, rast.data() + 4 * x, u, v, depth, id);
    const FaceIds ids(d, id, static_cast<float>(faces));
    hn::Store(ids.number, di, &out->ids[x]);
    ids.Find(d, x, &bad);
  }
  const std::size_t bad_after = ReadFaceRowRef(rast, faces, out, x);
  return HWY_MIN(bad, bad_after);
}

// Bit i: lane i.
HWY_INLINE std::uint64_t BitsOf(hn::Mask<IdIntTag> mask) {
  std::uint8_t bytes[8];
  const std::size_t count = hn::StoreMaskBits(IdIntTag(), mask, bytes);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i) bits |= std::uint64_t{bytes[i]} << 8 * i;
  return bits;
}

void FindRowSteps(const FaceRow& row, const FaceRow& above, std::size_t width,
                  std::span<std::uint64_t> steps) {
  const IdIntTag d;
  for (std::size_t first = 0; first < width; first += kStepBits) {
    std::uint64_t bits = 0;
    const std::size_t end = HWY_MIN(width - first, kStepBits);
    for (std::size_t i = 0; i < end; i += hn::Lanes(d)) {
      const std::int32_t* at = &row.ids[first + i];
      const IdInt here = hn::Load(d, at);
      const auto beside = hn::Ne(here, hn::LoadU(d, at + 1));
      const auto before = hn::Ne(here, hn::Load(d, &above.ids[first + i]));
      bits |= BitsOf(hn::Or(beside, before)) << i;
    }
    if (end < kStepBits) bits &= (std::uint64_t{1} << end) - 1;
    steps[first / kStepBits] = bits;
  }
}

}  // namespace tilegrad::compat::nvdiffrast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
