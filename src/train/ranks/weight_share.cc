// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/weight_share.h"

#include <algorithm>
#include <chrono>

#include "base/clocks.h"
#include "base/error.h"

namespace tilegrad::train {

void WeightShare::PlacesOf(const BucketLayout& layout, int rank, int ranks,
                           std::vector<Place>* out) {
  for (std::size_t b = 0; b < layout.buckets(); ++b) {
    const Range own = PieceOf(layout.bucket(b), rank, ranks);
    for (std::size_t i = 0; i < layout.parameters(); ++i) {
      const Range whole = layout.parameter(i);
      const Range both{std::max(own.begin, whole.begin), std::min(own.end, whole.end)};
      if (both.begin >= both.end) continue;
      out->push_back({{i, both.begin - whole.begin, both.end - whole.begin}, both.begin, b});
    }
  }
}

void WeightShare::Prepare(Job job) {
  job_ = std::move(job);
  finished_ = false;
  seconds_waited_ = 0;
  own_.clear();
  foreign_.clear();
  for (int rank = 0; rank < ranks_.size(); ++rank)
    PlacesOf(*job_.layout, rank, ranks_.size(), rank == ranks_.rank() ? &own_ : &foreign_);
  const std::size_t buckets = job_.layout->buckets();
  if (buckets > left_size_) {
    left_ = std::make_unique<std::atomic<int>[]>(buckets);
    left_size_ = buckets;
  }
  for (std::size_t b = 0; b < buckets; ++b) left_[b] = 0;
  for (const Place& place : own_) ++left_[place.bucket];
}

void WeightShare::Begin(const nn::Adam& adam) {
  adam_ = &adam;
  const auto known = [&](const Spread& spread) { return spread.adam == &adam; };
  if (std::none_of(spread_.begin(), spread_.end(), known)) spread_.push_back({&adam, *job_.layout});
  for (std::size_t b = 0; b < job_.layout->buckets(); ++b) {
    if (left_[b] == 0) exchange_.Spread(b);
  }
}

void WeightShare::Updated(std::size_t k) {
  const Place& place = own_[k];
  const float* weights = adam_->parameters()[place.piece.parameter].value().data<float>();
  std::copy(weights + place.piece.begin, weights + place.piece.end, job_.numbers + place.flat);
  if (--left_[place.bucket] == 0) exchange_.Spread(place.bucket);
}

Status WeightShare::Finish() {
  const auto start = std::chrono::steady_clock::now();
  if (!exchange_.WaitForSpread(job_.meanwhile)) return Cancelled("another rank ended");
  seconds_waited_ = SecondsSince(start);
  workers_.For(foreign_.size(), [&](std::size_t k, std::size_t) {
    const Place& place = foreign_[k];
    const Piece& piece = place.piece;
    nn::Tensor weights = adam_->parameters()[piece.parameter].value();
    std::copy_n(job_.numbers + place.flat, piece.end - piece.begin,
                weights.data<float>() + piece.begin);
  });
  job_.arrived();
  finished_ = true;
  return {};
}

void WeightShare::GatherMoments() {
  for (const Spread& spread : spread_) {
    for (std::size_t m = 0; m < spread.adam->moments(0).size(); ++m) GatherMoment(spread, m);
  }
}

void WeightShare::GatherMoment(const Spread& spread, std::size_t moment) {
  for (int rank = 1; rank < ranks_.size(); ++rank) {
    if (ranks_.rank() != 0 && ranks_.rank() != rank) continue;
    std::vector<Place> places;
    PlacesOf(spread.layout, rank, ranks_.size(), &places);
    const auto visit = [&](auto use) {
      std::size_t at = 0;
      for (const Place& place : places) {
        nn::Tensor numbers = spread.adam->moments(place.piece.parameter)[moment];
        const std::size_t n = place.piece.end - place.piece.begin;
        use(numbers.data<float>() + place.piece.begin, n, at);
        at += n;
      }
      return at;
    };
    std::vector<float> packed(visit([](float*, std::size_t, std::size_t) {}));
    const auto bytes = std::as_writable_bytes(std::span(packed));
    if (ranks_.rank() == 0) {
      ReceiveAndWait(ranks_, {rank, MessageKind::kBytes}, bytes);
      visit([&](float* to, std::size_t n, std::size_t at) {
        std::copy_n(packed.data() + at, n, to);
      });
    } else {
      visit([&](const float* from, std::size_t n, std::size_t at) {
        std::copy_n(from, n, packed.data() + at);
      });
      SendAndWait(ranks_, {0, MessageKind::kBytes}, bytes);
    }
  }
}

}  // namespace tilegrad::train
