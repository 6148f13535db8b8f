// SPDX-License-Identifier: Apache-2.0
// Internal to guarded_process: what lies between parent and child. Questions and notes go over a
// packet socket, contents through a memory file, so that neither side can be made to block on
// writing to the other.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "io/guarded_process.h"

namespace tilegrad::io {

inline constexpr std::size_t kMaxQuestionBytes = 4096;

class UniqueFd {
 public:
  explicit UniqueFd(int fd = -1) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~UniqueFd() { Close(); }
  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }
  void Close();

 private:
  int fd_;
};

// Bytes that one process leaves for the other. A header that is written last tells whole from cut.
class Mailbox {
 public:
  static Result<Mailbox> Open();
  int fd() const { return file_.get(); }
  // Replaces what is there; false if the system refuses (memory, limits).
  bool Put(std::span<const std::uint8_t> bytes) const;
  // Nothing if what is there is not whole or larger than `max_bytes`.
  std::optional<Bytes> Get(std::size_t max_bytes) const;

 private:
  explicit Mailbox(UniqueFd file) : file_(std::move(file)) {}
  UniqueFd file_;
};

// The ends of a packet socket.
struct SocketPair {
  UniqueFd parent, child;
  static Result<SocketPair> Open();
};

struct ChildSetup {
  int parent_pid;
  int socket;  // the child's end
  const Mailbox& mailbox;
  std::size_t address_space;  // bytes; 0: no limit
  const GuardLimits& limits;
};

enum ChildExit { kChildDone = 0, kChildThrew = 80, kChildOutOfMemory, kChildCannotDeliver };

// The whole life of the child after the fork. Expects all signals blocked.
[[noreturn]] void RunChildProcess(const ChildSetup& setup, ChildFunction run) noexcept;

}  // namespace tilegrad::io
