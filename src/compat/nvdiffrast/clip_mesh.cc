// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/clip_mesh.h"

#include "base/error.h"
#include "base/scalar.h"

namespace tilegrad::compat::nvdiffrast {

Status CheckFaces(FaceList faces, std::size_t vertices) {
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] >= 0 && static_cast<std::size_t>(faces[i]) < vertices) continue;
    return InvalidArgument("face {} has vertex {}, but there are {} vertices", i / 3, faces[i],
                           vertices);
  }
  return {};
}

Status NoSuchFace(std::size_t pixel, double id, std::size_t faces) {
  return InvalidArgument(
      "pixel {} of rast names triangle {} (channel 3), but must name 0 (none) to {}", pixel, id,
      faces);
}

Status CheckFaceIds(std::span<const double> rast, std::size_t faces) {
  for (std::size_t i = 3; i < rast.size(); i += 4) {
    if (!IsFaceId(rast[i], faces)) return NoSuchFace(i / 4, rast[i], faces);
  }
  return {};
}

template <class T>
Status CheckNoPixel(std::span<const std::size_t> bad, std::span<const T> rast, std::size_t faces) {
  for (const std::size_t pixel : bad) {
    if (pixel == kNoPixel) continue;
    return NoSuchFace(pixel, static_cast<double>(rast[4 * pixel + 3]), faces);
  }
  return {};
}
TILEGRAD_INSTANTIATE(CheckNoPixel);

BandSums::BandSums(std::size_t rows, std::size_t channels, std::size_t bands,
                   const Workers& workers)
    : rows_(rows), channels_(channels), bands_(bands), slots_(workers.size()) {}

BandSums::Adder::Adder(BandSums* sums, std::size_t band, std::size_t worker)
    : rows_(sums->bands_[band].rows), sums_(sums->bands_[band].sums), channels_(sums->channels_) {
  AlignedVector<std::int32_t>& slots = sums->slots_[worker];
  if (slots.empty()) slots.resize(sums->rows_);
  slots_ = slots.data();
}

BandSums::Adder::~Adder() {
  for (const std::size_t row : rows_) slots_[row] = 0;
}

void BandSums::Adder::Clear() {
  for (const std::size_t row : rows_) slots_[row] = 0;
  rows_.clear();
  sums_.clear();
}

void BandSums::Adder::MeetRow(std::size_t row) {
  rows_.push_back(row);
  sums_.resize(sums_.size() + channels_);
  slots_[row] = static_cast<std::int32_t>(rows_.size());
}

namespace {

// a += b, clamped to finite values: gradients of positions grow with 1/w.
template <class T>
void AddNumbers(const double* b, std::size_t n, T* a) {
  constexpr double kMost = std::numeric_limits<T>::max();
  for (std::size_t i = 0; i < n; ++i) {
    a[i] = static_cast<T>(std::clamp(static_cast<double>(a[i]) + b[i], -kMost, kMost));
  }
}

}  // namespace

template <class T>
void BandSums::AddRows(std::span<T> out, std::size_t begin, std::size_t end,
                       std::size_t first) const {
  for (const OfBand& band : bands_) {
    for (std::size_t i = 0; i < band.rows.size(); ++i) {
      const std::size_t row = band.rows[i];
      if (row < first + begin || row >= first + end) continue;
      AddNumbers(band.sums.data() + i * channels_, channels_,
                 out.data() + (row - first) * channels_);
    }
  }
}

template <class T>
void BandSums::AddTo(std::span<T> out, const Workers& workers, std::size_t first) const {
  // The division of rows among workers does not matter: each row has its own sum.
  const std::size_t rows = out.size() / channels_;
  const auto count = workers.size();
  workers.ForRanges(rows, (rows + count - 1) / count,
                    [&](std::size_t begin, std::size_t end) { AddRows(out, begin, end, first); });
}

template void BandSums::AddTo(std::span<float>, const Workers&, std::size_t) const;
template void BandSums::AddTo(std::span<double>, const Workers&, std::size_t) const;

}  // namespace tilegrad::compat::nvdiffrast
