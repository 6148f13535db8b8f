// SPDX-License-Identifier: Apache-2.0
// Small and blocking exchanges over a Transport.
#pragma once

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "train/ranks/transport.h"

namespace tilegrad::train {

// Until it is done. It looks again and again with pauses, so that a rank that waits leaves the
// core to others. `meanwhile`: called between looks; false ends the wait.
bool Await(Transport& ranks, Transport::Ticket ticket,
           const std::function<bool()>& meanwhile = nullptr);

void SendAndWait(Transport& ranks, const Address& to, std::span<const std::byte> data);
bool ReceiveAndWait(Transport& ranks, const Address& from, std::span<std::byte> data,
                    const std::function<bool()>& meanwhile = nullptr);  // false as of Await

// A trivially copyable value.
template <class T>
void SendValue(Transport& ranks, const Address& to, const T& value) {
  SendAndWait(ranks, to, std::as_bytes(std::span(&value, 1)));
}
template <class T>
T ReceiveValue(Transport& ranks, const Address& from) {
  T value{};
  ReceiveAndWait(ranks, from, std::as_writable_bytes(std::span(&value, 1)));
  return value;
}

void SendText(Transport& ranks, int peer, const std::string& text);
std::string ReceiveText(Transport& ranks, int peer);

// The bytes of rank 0 to all, along a tree; every rank calls it with as many bytes.
void Broadcast(Transport& ranks, std::span<std::byte> data);

// Every rank calls it; rank 0 gets the texts of all in order, the others nothing.
std::vector<std::string> GatherTexts(Transport& ranks, const std::string& own);

}  // namespace tilegrad::train
