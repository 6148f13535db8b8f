// SPDX-License-Identifier: Apache-2.0
// Messages between the processes ("ranks") of one training run. What carries them is a plugin that
// is loaded when the program was started by mpirun (launch.h), so this header needs the standard
// library alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tilegrad::train {

// What a message is about. Messages of one kind, number and pair of ranks arrive in the order they
// were sent in.
enum class MessageKind : std::uint8_t { kControl, kError, kBytes, kValues, kPart, kTotal };

struct Address {
  int peer = 0;
  MessageKind kind = MessageKind::kBytes;
  int number = 0;  // at most 4095: which bucket of gradients, say
};

// May be used from several threads at once.
class Transport {
 public:
  using Ticket = std::int64_t;

  virtual ~Transport() = default;
  virtual int rank() const = 0;
  virtual int size() const = 0;
  virtual const char* host() const = 0;  // of this rank, for messages

  // Both return at once; the memory belongs to the transport until Done says true, once.
  virtual Ticket Send(const Address& to, std::span<const std::byte> data) = 0;
  virtual Ticket Receive(const Address& from, std::span<std::byte> data) = 0;
  virtual bool Done(Ticket ticket) = 0;

  // Ends the processes of all ranks with this exit code; does not return.
  [[noreturn]] virtual void Abort(int code) = 0;
};

// What the plugin exports, as "TilegradConnectRanks": joins the other ranks, once in a process. Its
// destructor waits for them. Null where that fails; then `error` says why.
using ConnectRanksFunction = Transport* (*)(const char** error);
inline constexpr const char* kConnectRanksName = "TilegradConnectRanks";

}  // namespace tilegrad::train
