// SPDX-License-Identifier: Apache-2.0
// Ranks that are threads of a test.
#pragma once

#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <tuple>
#include <vector>

#include "train/ranks/transport.h"

namespace tilegrad::train {

// What all ranks' messages go through.
struct ThreadMail {
  using Key = std::tuple<int, int, MessageKind, int>;  // from, to, kind, number
  struct Box {
    std::vector<std::vector<std::byte>> sent;
    std::size_t received = 0;  // asked for
  };
  std::mutex mutex;
  std::map<Key, Box> boxes;
};

class ThreadRank : public Transport {
 public:
  ThreadRank(ThreadMail& mail, int rank, int size) : mail_(mail), rank_(rank), size_(size) {}
  int rank() const override { return rank_; }
  int size() const override { return size_; }
  const char* host() const override { return "here"; }

  Ticket Send(const Address& to, std::span<const std::byte> data) override {
    const std::scoped_lock lock(mail_.mutex);
    mail_.boxes[{rank_, to.peer, to.kind, to.number}].sent.emplace_back(data.begin(), data.end());
    return -1;
  }
  Ticket Receive(const Address& from, std::span<std::byte> data) override {
    const std::scoped_lock lock(mail_.mutex);
    const ThreadMail::Key key{from.peer, rank_, from.kind, from.number};
    open_.push_back({key, mail_.boxes[key].received++, data});
    return static_cast<Ticket>(open_.size()) - 1;
  }
  bool Done(Ticket ticket) override {
    if (ticket < 0) return true;
    const std::scoped_lock lock(mail_.mutex);
    const Open& open = open_[static_cast<std::size_t>(ticket)];
    const auto& sent = mail_.boxes[open.key].sent;
    if (sent.size() <= open.which) return false;
    if (sent[open.which].size() != open.data.size()) std::abort();
    std::memcpy(open.data.data(), sent[open.which].data(), open.data.size());
    return true;
  }
  void Abort(int /*code*/) override { std::abort(); }

 private:
  struct Open {
    ThreadMail::Key key;
    std::size_t which;
    std::span<std::byte> data;
  };
  ThreadMail& mail_;
  int rank_, size_;
  std::vector<Open> open_;
};

// work(rank) on as many threads.
inline void OnRanks(int size, const std::function<void(Transport&)>& work) {
  ThreadMail mail;
  std::vector<std::thread> threads;
  for (int rank = 0; rank < size; ++rank) {
    threads.emplace_back([&, rank] {
      ThreadRank transport(mail, rank, size);
      work(transport);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace tilegrad::train
