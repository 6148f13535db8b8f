// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/exchange.h"

#include <algorithm>
#include <chrono>

namespace tilegrad::train {
namespace {

constexpr int kEagerLooks = 200;  // after something moved, more is likely to follow at once
constexpr auto kPause = std::chrono::microseconds(20);

std::span<const std::byte> BytesOf(const float* data, std::size_t n) {
  return std::as_bytes(std::span(data, n));
}

std::span<std::byte> WritableBytesOf(float* data, std::size_t n) {
  return std::as_writable_bytes(std::span(data, n));
}

constexpr auto kMessagePause = std::chrono::microseconds(20);
constexpr std::size_t kMostBytes = std::size_t{1} << 26;  // of one message; MPI counts in int

// data in pieces of at most kMostBytes.
template <class Bytes, class Use>
void InPieces(Bytes data, Use use) {
  while (!data.empty()) {
    const std::size_t count = std::min(data.size(), kMostBytes);
    use(data.first(count));
    data = data.subspan(count);
  }
}

void SendText(Transport& ranks, int peer, const std::string& text) {
  const Address to{peer, MessageKind::kBytes};
  SendValue(ranks, to, static_cast<std::uint64_t>(text.size()));
  SendAndWait(ranks, to, std::as_bytes(std::span(text)));
}

std::string ReceiveText(Transport& ranks, int peer) {
  const Address from{peer, MessageKind::kBytes};
  std::string text(ReceiveValue<std::uint64_t>(ranks, from), '\0');
  ReceiveAndWait(ranks, from, std::as_writable_bytes(std::span(text)));
  return text;
}

}  // namespace

Exchange::Exchange(Transport& ranks, std::vector<Subtree> subtrees)
    : ranks_(ranks), subtrees_(std::move(subtrees)) {
  std::size_t own = 0, foreign = 0;
  for (const Subtree& s : subtrees_) place_.push_back(s.owner == ranks_.rank() ? own++ : foreign++);
  thread_ = std::thread([this] { Run(); });
}

Exchange::~Exchange() {
  {
    const std::scoped_lock lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Exchange::Begin(const Job& job) {
  const std::scoped_lock lock(mutex_);
  job_ = job;
  piece_numbers_ = 0;
  piece_begin_.clear();
  for (std::size_t b = 0; b < job_.layout->buckets(); ++b) {
    piece_begin_.push_back(piece_numbers_);
    piece_numbers_ += Piece(b, ranks_.rank()).size();
  }
  const auto foreign = static_cast<std::size_t>(std::count_if(
      subtrees_.begin(), subtrees_.end(), [&](auto& s) { return s.owner != ranks_.rank(); }));
  foreign_.resize(std::max(foreign_.size(), foreign * piece_numbers_));
  moving_.resize(std::max(moving_.size(), 2 * job_.layout->buckets()));
  started_ = done_ = 0;
}

// This rank's piece of a bucket in the sum of a subtree.
float* Exchange::SumOf(std::size_t subtree, std::size_t bucket) {
  if (subtrees_[subtree].owner == ranks_.rank())
    return job_.own[place_[subtree]] + Piece(bucket, ranks_.rank()).begin;
  return foreign_.data() + place_[subtree] * piece_numbers_ + piece_begin_[bucket];
}

void Exchange::Start(std::size_t bucket) {
  const std::scoped_lock lock(mutex_);
  Moving& m = moving_[started_++];
  m.bucket = bucket;
  m.phase = Phase::kParts;
  const int number = static_cast<int>(bucket), me = ranks_.rank();
  const std::size_t mine = Piece(bucket, me).size();
  for (std::size_t i = 0; i < subtrees_.size(); ++i) {
    const int owner = subtrees_[i].owner;
    if (owner != me && mine > 0)
      m.parts.push_back(ranks_.Receive({owner, MessageKind::kPart, number},
                                       WritableBytesOf(SumOf(i, bucket), mine)));
    for (int peer = 0; owner == me && peer < ranks_.size(); ++peer) {
      const Range piece = Piece(bucket, peer);
      if (peer == me || piece.size() == 0) continue;
      m.rest.push_back(ranks_.Send({peer, MessageKind::kPart, number},
                                   BytesOf(job_.own[place_[i]] + piece.begin, piece.size())));
    }
  }
  changed_.notify_all();
}

void Exchange::Spread(std::size_t bucket) {
  const std::scoped_lock lock(mutex_);
  Moving& m = moving_[started_++];
  m.bucket = bucket;
  m.phase = Phase::kTotals;
  const int number = static_cast<int>(bucket);
  const Range mine = Piece(bucket, ranks_.rank());
  for (int peer = 0; peer < ranks_.size(); ++peer) {
    const Range piece = Piece(bucket, peer);
    if (peer == ranks_.rank()) continue;
    if (piece.size() > 0)
      m.rest.push_back(ranks_.Receive({peer, MessageKind::kTotal, number},
                                      WritableBytesOf(job_.total + piece.begin, piece.size())));
    if (mine.size() > 0)
      m.rest.push_back(ranks_.Send({peer, MessageKind::kTotal, number},
                                   BytesOf(job_.total + mine.begin, mine.size())));
  }
  changed_.notify_all();
}

// Sums this rank's piece.
void Exchange::Fold(std::size_t bucket) {
  const Range piece = Piece(bucket, ranks_.rank());
  const std::size_t n = piece.size();
  if (n == 0) return;
  FoldSubtrees(subtrees_, &scratch_, [&](std::size_t left, std::size_t right) {
    float* a = SumOf(left, bucket);
    const float* b = SumOf(right, bucket);
    for (std::size_t i = 0; i < n; ++i) a[i] += b[i];
  });
  const float* sum = SumOf(0, bucket);
  float* total = job_.total + piece.begin;
  for (std::size_t i = 0; i < n; ++i) total[i] = sum[i] * job_.scale;
}

// Forgets tickets that are done; whether there were some.
bool Exchange::Drop(std::vector<Transport::Ticket>* tickets) {
  return std::erase_if(*tickets, [&](Transport::Ticket t) { return ranks_.Done(t); }) > 0;
}

bool Exchange::Advance() {
  bool moved = false;
  for (std::size_t i = 0; i < started_; ++i) {
    Moving& m = moving_[i];
    if (m.phase == Phase::kDone) continue;
    moved |= Drop(&m.parts);
    moved |= Drop(&m.rest);
    if (m.phase == Phase::kParts && m.parts.empty()) {
      Fold(m.bucket);
      m.phase = Phase::kTotals;
      moved = true;
    }
    if (m.phase == Phase::kTotals && m.rest.empty()) {
      m.phase = Phase::kDone;
      ++done_;
      moved = true;
    }
  }
  return moved;
}

void Exchange::Run() {
  int looks = 0;
  std::unique_lock lock(mutex_);
  while (!closing_) {
    if (done_ == started_) {
      changed_.notify_all();
      changed_.wait(lock, [&] { return closing_ || done_ < started_; });
      looks = 0;
      continue;
    }
    looks = Advance() ? 0 : looks + 1;
    if (looks == 0) continue;
    lock.unlock();
    if (looks < kEagerLooks) {
      std::this_thread::yield();
    } else {
      std::this_thread::sleep_for(kPause);
    }
    lock.lock();
  }
}

bool Exchange::Wait(const std::function<bool()>& meanwhile, std::size_t rounds) {
  std::unique_lock lock(mutex_);
  while (done_ < rounds * job_.layout->buckets()) {
    if (changed_.wait_for(lock, std::chrono::milliseconds(5)) == std::cv_status::timeout &&
        meanwhile && !meanwhile()) {
      return false;
    }
  }
  return true;
}

bool Await(Transport& ranks, Transport::Ticket ticket, const std::function<bool()>& meanwhile) {
  while (!ranks.Done(ticket)) {
    if (meanwhile && !meanwhile()) return false;
    std::this_thread::sleep_for(kMessagePause);
  }
  return true;
}

void SendAndWait(Transport& ranks, const Address& to, std::span<const std::byte> data) {
  InPieces(data, [&](std::span<const std::byte> piece) { Await(ranks, ranks.Send(to, piece)); });
}

bool ReceiveAndWait(Transport& ranks, const Address& from, std::span<std::byte> data,
                    const std::function<bool()>& meanwhile) {
  bool all = true;
  InPieces(data, [&](std::span<std::byte> piece) {
    all = all && Await(ranks, ranks.Receive(from, piece), meanwhile);
  });
  return all;
}

// Rank r has the bytes of r without its lowest bit, and passes them on to r plus each lower one.
void Broadcast(Transport& ranks, std::span<std::byte> data) {
  const int rank = ranks.rank(), size = ranks.size();
  int bit = 1;
  for (; bit < size && (rank & bit) == 0; bit *= 2) {
  }
  if (rank > 0) ReceiveAndWait(ranks, {rank & ~bit, MessageKind::kBytes}, data);
  for (bit /= 2; bit > 0; bit /= 2) {
    if (rank + bit < size) SendAndWait(ranks, {rank + bit, MessageKind::kBytes}, data);
  }
}

std::vector<std::string> GatherTexts(Transport& ranks, const std::string& own) {
  if (ranks.rank() > 0) {
    SendText(ranks, 0, own);
    return {};
  }
  std::vector<std::string> texts = {own};
  for (int peer = 1; peer < ranks.size(); ++peer) texts.push_back(ReceiveText(ranks, peer));
  return texts;
}

}  // namespace tilegrad::train
