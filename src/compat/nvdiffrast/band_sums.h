// SPDX-License-Identifier: Apache-2.0
// Sums of what pixels pull on rows (of vertices, of texels): the same bits for any number of
// workers. Every band sums the rows that it meets on its own, in double and in the order of its
// pixels; the sums of bands are then added in the order of bands.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"

namespace tilegrad::compat::nvdiffrast {

class BandSums {
 public:
  // Rows [0, rows) of `channels` numbers; at most 2^31 - 1 rows of a band are met.
  BandSums(std::size_t rows, std::size_t channels, std::size_t bands, const Workers& workers);

  // What one band adds. While it lives, no other of the same worker does.
  class Adder {
   public:
    Adder(BandSums* sums, std::size_t band, std::size_t worker);
    ~Adder();
    Adder(const Adder&) = delete;
    Adder& operator=(const Adder&) = delete;

    // Forgets what was added.
    void Clear();

    // The sum of a row so far; valid until the next call.
    double* Row(std::size_t row) {
      if (slots_[row] == 0) MeetRow(row);
      return sums_.data() + static_cast<std::size_t>(slots_[row] - 1) * channels_;
    }
    // The rows that were met, in the order they were, and their sums, one after the other.
    std::span<const std::size_t> rows() const { return rows_; }
    const double* sums() const { return sums_.data(); }

   private:
    void MeetRow(std::size_t row);

    std::vector<std::size_t>& rows_;
    std::vector<double>& sums_;
    std::int32_t* slots_;
    std::size_t channels_;
  };

  // out [n,channels] += the sums of all bands, of rows first to first + n - 1. Saturates.
  template <class T>
  void AddTo(std::span<T> out, const Workers& workers, std::size_t first = 0) const;

 private:
  struct OfBand {
    std::vector<std::size_t> rows;  // in the order they were met
    std::vector<double> sums;       // [rows][channels]
  };
  template <class T>
  void AddRows(std::span<T> out, std::size_t begin, std::size_t end, std::size_t first) const;

  std::size_t rows_, channels_;
  std::vector<OfBand> bands_;
  // Of each worker: 1 + where a row stands in the band at work; 0 if it was not met.
  std::vector<AlignedVector<std::int32_t>> slots_;
};

}  // namespace tilegrad::compat::nvdiffrast
