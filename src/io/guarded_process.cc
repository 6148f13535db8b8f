// SPDX-License-Identifier: Apache-2.0
#include "io/guarded_process.h"

#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>

#include "base/error.h"
#include "base/sanitizers.h"
#include "base/shortage.h"
#include "io/guarded_channel.h"

namespace tilegrad::io {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kMaxQuestions = 4096;

std::atomic<const StopFlag*> g_stop = nullptr;

// What the child may map in all: what this process has mapped, which it inherits, and the limit.
// 0, no limit, under sanitizers: they map terabytes.
std::size_t AddressSpace(const GuardLimits& limits) {
  if constexpr (kSanitizer) return 0;
  std::size_t pages = 0;
  if (!(std::ifstream("/proc/self/statm") >> pages)) return 0;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) + limits.memory_bytes;
}

class BlockedSignals {
 public:
  BlockedSignals() {
    sigset_t all;
    sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~BlockedSignals() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;

 private:
  sigset_t before_;
};

class Child {
 public:
  explicit Child(pid_t pid)
      : pid_(pid), end_(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0))) {}
  ~Child() {
    if (reaped_) return;
    ::kill(pid_, SIGKILL);
    Reap(0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // True once it has ended. Somebody else may have reaped it (SIGCHLD ignored, a wait for any
  // child): then it counts as having ended well, and the mailbox tells the rest.
  bool Reap(int flags) {
    if (reaped_) return true;
    pid_t got = 0;
    do {
      got = ::waitpid(pid_, &status_, flags);
    } while (got < 0 && errno == EINTR);
    reaped_ = got != 0;
    return reaped_;
  }
  int status() const { return status_; }
  int end_fd() const { return end_.get(); }  // readable once it has ended; -1 on old kernels

 private:
  pid_t pid_;
  UniqueFd end_;
  int status_ = 0;
  bool reaped_ = false;
};

class Guard {
 public:
  Guard(Child& child, UniqueFd socket, const Mailbox& mailbox, AnswerFunction answer,
        const GuardLimits& limits)
      : child_(child),
        socket_(std::move(socket)),
        mailbox_(mailbox),
        answer_(answer),
        limits_(limits),
        deadline_(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                     std::chrono::duration<double>(limits.wall_seconds))) {}

  // Until the child ends.
  Status Watch() {
    while (!child_.Reap(WNOHANG)) {
      if (GuardedMustStop()) return Cancelled("was stopped");
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline_ - Clock::now()).count();
      if (left <= 0) return DataLoss("took more than {} s", limits_.wall_seconds);
      std::array<pollfd, 2> wait = {{{socket_.get(), POLLIN, 0}, {child_.end_fd(), POLLIN, 0}}};
      // Another thread may get the signal that sets the flag.
      const std::int64_t slice = child_.end_fd() < 0 ? 5 : 50;
      if (::poll(wait.data(), wait.size(), static_cast<int>(std::min<std::int64_t>(left, slice))) >
              0 &&
          wait[0].revents != 0) {
        TILEGRAD_TRY(Serve());
      }
    }
    return {};
  }

 private:
  Status Serve() {
    std::array<char, kMaxQuestionBytes> question;
    const ssize_t size = ::recv(socket_.get(), question.data(), question.size(), MSG_DONTWAIT);
    if (size <= 0) {
      if (size == 0 || errno != EINTR) socket_.Close();  // it asks no more
      return {};
    }
    if (++questions_ > kMaxQuestions) return DataLoss("asked more than {} times", kMaxQuestions);
    const auto content = answer_({question.data(), static_cast<std::size_t>(size)});
    if (content && !mailbox_.Put(*content)) {
      NoteShortage(errno);
      return IoError("could not be given {} bytes: {}", content->size(), std::strerror(errno));
    }
    const char known = content.has_value();
    // A child that asks without taking answers fills the socket; that must not block us.
    if (::send(socket_.get(), &known, 1, MSG_NOSIGNAL | MSG_DONTWAIT) != 1) socket_.Close();
    return {};
  }

  Child& child_;
  UniqueFd socket_;
  const Mailbox& mailbox_;
  AnswerFunction answer_;
  const GuardLimits& limits_;
  Clock::time_point deadline_;
  int questions_ = 0;
};

// The limit of this process that is lower than what the child was to get; 0 if none is.
rlim_t OwnLimit(decltype(RLIMIT_AS) resource, std::size_t granted) {
  rlimit own = {};
  if (::getrlimit(resource, &own) != 0 || own.rlim_cur >= granted) return 0;
  return own.rlim_cur;
}

// Where this process may map less than the child was granted, that was in its way, not the file.
Status TooMuchMemory(const GuardLimits& limits) {
  if (const rlim_t own = OwnLimit(RLIMIT_AS, AddressSpace(limits)); own > 0) {
    NoteShortage(ENOMEM);
    return IoError("had not enough memory: {} MB may be mapped here (ulimit -v)", own >> 20);
  }
  return ResourceExhausted("needed more than {} MB of memory", limits.memory_bytes >> 20);
}

// The mailbox counts as a file: the size limit of this process's files applies to it.
Status TooLargeAResult(const GuardLimits& limits) {
  rlimit own = {};
  if (::getrlimit(RLIMIT_FSIZE, &own) != 0 || own.rlim_max >= limits.memory_bytes) {
    return TooMuchMemory(limits);
  }
  return IoError("could not hand over its result: files may have {} bytes here (ulimit -f)",
                 own.rlim_max);
}

Status StatusOfSignal(int signal, const GuardLimits& limits) {
  if (signal == SIGXCPU)
    return DataLoss("took more than {} s of processor time", limits.cpu_seconds);
  if (signal == SIGXFSZ) return TooLargeAResult(limits);
  if (signal == SIGKILL) {  // nobody else kills it: it volunteers when memory runs out
    NoteShortage(ENOMEM);
    return IoError("was killed by the system, which was short of memory");
  }
  const char* name = ::sigdescr_np(signal);
  return DataLoss("crashed ({})", name == nullptr ? "unknown signal" : name);
}

Status StatusOfExit(int status, const GuardLimits& limits) {
  if (WIFSIGNALED(status)) return StatusOfSignal(WTERMSIG(status), limits);
  const int code = WEXITSTATUS(status);
  if (code == kChildDone) return {};
  if (code == kChildOutOfMemory) return TooMuchMemory(limits);
  if (code == kChildCannotDeliver) {
    NoteShortage(ENOMEM);
    return IoError("could not hand over its result");
  }
  if (code == kChildThrew) return DataLoss("failed with an exception");
  return DataLoss("ended the process with code {}", code);
}

}  // namespace

void StopGuardedBy(const StopFlag* stop) { g_stop = stop; }

bool GuardedMustStop() {
  const StopFlag* const stop = g_stop;
  return stop != nullptr && *stop;
}

Result<Bytes> RunGuarded(ChildFunction run, AnswerFunction answer, const GuardLimits& limits) {
  TILEGRAD_ASSIGN(const Mailbox mailbox, Mailbox::Open());
  TILEGRAD_ASSIGN(SocketPair sockets, SocketPair::Open());
  const ChildSetup setup{::getpid(), sockets.child.get(), mailbox, AddressSpace(limits), limits};
  pid_t pid = -1;
  {
    const BlockedSignals blocked;  // no handler of ours may run in the child
    pid = ::fork();
    if (pid == 0) RunChildProcess(setup, run);
  }
  if (pid < 0) {
    NoteShortage(errno);
    return IoError("could not be started: {}", std::strerror(errno));
  }
  sockets.child.Close();
  Child child(pid);
  TILEGRAD_TRY(Guard(child, std::move(sockets.parent), mailbox, answer, limits).Watch());
  TILEGRAD_TRY(StatusOfExit(child.status(), limits));
  auto result = mailbox.Get(limits.memory_bytes);
  if (!result) return DataLoss("returned an incomplete result");
  return std::move(*result);
}

}  // namespace tilegrad::io
