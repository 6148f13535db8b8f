// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/messages.h"

#include <algorithm>
#include <chrono>
#include <thread>

namespace tilegrad::train {
namespace {

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

}  // namespace

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
