// SPDX-License-Identifier: Apache-2.0
#include "io/guarded_process.h"

#include <fcntl.h>
#include <malloc.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <span>
#include <utility>

#include "base/error.h"
#include "base/read_budget.h"
#include "base/sanitizers.h"

namespace tilegrad::io {
namespace {

// Between parent and child: questions and notes go over a packet socket, contents through a memory
// file, so that neither side can be made to block on writing to the other.

constexpr std::size_t kMaxQuestionBytes = 4096;

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
  void Close() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }

 private:
  int fd_;
};

struct Header {
  std::uint64_t magic, size;
};
constexpr std::uint64_t kChannelMagic =
    0x746c67642d626f78;  // any number that no other file starts with

// Transfers all of `bytes` by pread or pwrite, from an offset in the file.
template <class Byte, class Call>
bool AllAt(Call call, int fd, std::span<Byte> bytes, std::size_t at) {
  while (!bytes.empty()) {
    const ssize_t n = call(fd, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += static_cast<std::size_t>(n);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}
bool WriteAt(int fd, std::span<const std::uint8_t> bytes, std::size_t at) {
  return AllAt(::pwrite, fd, bytes, at);
}
bool ReadAt(int fd, std::span<std::uint8_t> bytes, std::size_t at) {
  return AllAt(::pread, fd, bytes, at);
}

// Above the standard streams, which the child replaces: a program may run with those closed.
UniqueFd AboveStreams(int fd) {
  UniqueFd given(fd);
  if (fd < 0 || fd > STDERR_FILENO) return given;
  return UniqueFd(::fcntl(fd, F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
}

Status Refused(const char* what) {
  NoteShortage(errno);
  return IoError("could not get {}: {}", what, std::strerror(errno));
}

// Bytes that one process leaves for the other. The header is written last, so that incomplete
// contents are detected.
class Mailbox {
 public:
  static Result<Mailbox> Open() {
    UniqueFd file = AboveStreams(::memfd_create("tilegrad-guarded", MFD_CLOEXEC));
    if (!file.valid()) return Refused("a memory file");
    return Mailbox(std::move(file));
  }
  int fd() const { return file_.get(); }
  // Replaces the contents; false if the system refuses (memory, limits).
  bool Put(std::span<const std::uint8_t> bytes) const {
    const Header header{kChannelMagic, bytes.size()};
    return ::ftruncate(fd(), 0) == 0 && WriteAt(fd(), bytes, sizeof(header)) &&
           WriteAt(fd(), {reinterpret_cast<const std::uint8_t*>(&header), sizeof(header)}, 0);
  }
  // nullopt if the contents are incomplete or larger than `max_bytes`.
  std::optional<Bytes> Get(std::size_t max_bytes) const {
    struct stat info = {};
    Header header = {};
    if (::fstat(fd(), &info) != 0 ||
        !ReadAt(fd(), {reinterpret_cast<std::uint8_t*>(&header), sizeof(header)}, 0) ||
        header.magic != kChannelMagic || header.size > max_bytes ||
        static_cast<std::uint64_t>(info.st_size) != sizeof(header) + header.size) {
      return std::nullopt;
    }
    Bytes out(header.size);
    return ReadAt(fd(), out, sizeof(header)) ? std::optional(std::move(out)) : std::nullopt;
  }

 private:
  explicit Mailbox(UniqueFd file) : file_(std::move(file)) {}
  UniqueFd file_;
};

// The ends of a packet socket.
struct SocketPair {
  UniqueFd parent, child;
  static Result<SocketPair> Open() {
    int ends[2] = {-1, -1};
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
      return Refused("a socket");
    SocketPair pair{AboveStreams(ends[0]), AboveStreams(ends[1])};
    if (!pair.parent.valid() || !pair.child.valid()) return Refused("a socket");
    return pair;
  }
};

// The child -----------------------------------------------------------------------------------

struct ChildSetup {
  int parent_pid;
  int socket;  // the child's end
  const Mailbox& mailbox;
  std::size_t address_space;  // bytes; 0: no limit
  const GuardLimits& limits;
};

enum ChildExit { kChildDone = 0, kChildThrew = 80, kChildOutOfMemory, kChildCannotDeliver };

// The parent's handlers must not run here. Its own process group keeps the terminal's Ctrl-C away,
// which the parent handles; if the parent dies, so does the child.
void SeparateFromParent(int parent_pid) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent_pid) ::_exit(kChildCannotDeliver);
  for (int signal = 1; signal < NSIG; ++signal) std::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
}

// Closes or redirects all of the parent's descriptors but two: the child can neither read nor
// print.
void CloseDescriptors(int a, int b) {
  const int null = ::open("/dev/null", O_RDWR);
  for (int stream = 0; stream <= STDERR_FILENO; ++stream) ::dup2(null, stream);
  const auto low = static_cast<unsigned>(std::min(a, b)),
             high = static_cast<unsigned>(std::max(a, b));
  if (low > STDERR_FILENO + 1) ::close_range(STDERR_FILENO + 1, low - 1, 0);
  if (high > low + 1) ::close_range(low + 1, high - 1, 0);
  ::close_range(high + 1, ~0u, 0);
}

void Limit(decltype(RLIMIT_CPU) resource, rlim_t soft, rlim_t hard) {
  rlimit limit = {};
  if (::getrlimit(resource, &limit) != 0) return;
  limit.rlim_max = std::min(limit.rlim_max, hard);
  limit.rlim_cur = std::min(limit.rlim_max, soft);
  ::setrlimit(resource, &limit);
}

// If memory runs out all the same, the system kills the child rather than the parent.
void VolunteerForOutOfMemoryKill() {
  const int file = ::open("/proc/self/oom_score_adj", O_WRONLY);
  if (file < 0) return;
  if (::write(file, "1000", 4) < 0) errno = 0;  // where /proc is read-only, it stays as it was
  ::close(file);
}

void SetLimits(const ChildSetup& setup) {
  VolunteerForOutOfMemoryKill();
  ::prctl(PR_SET_DUMPABLE, 0);  // a crash is expected and leaves no core
  Limit(RLIMIT_CORE, 0, 0);
  const auto cpu = static_cast<rlim_t>(setup.limits.cpu_seconds);
  Limit(RLIMIT_CPU, cpu, cpu + 1);
  Limit(RLIMIT_FSIZE, setup.limits.memory_bytes, setup.limits.memory_bytes);
  if (setup.address_space > 0) Limit(RLIMIT_AS, setup.address_space, setup.address_space);
}

std::optional<Bytes> Ask(const ChildSetup& setup, std::string_view question) {
  char known = 0;
  if (question.empty() || question.size() > kMaxQuestionBytes) return std::nullopt;
  if (::send(setup.socket, question.data(), question.size(), MSG_NOSIGNAL) < 0 ||
      ::recv(setup.socket, &known, 1, 0) != 1 || known == 0) {
    return std::nullopt;
  }
  return setup.mailbox.Get(setup.limits.memory_bytes);
}

// Page faults are most of the cost of a short-lived process: every reused page of the parent's heap
// is copied, every new one cleared. So this returns free memory of the parent to the system, makes
// the next block of huge pages, and stops returning memory from then on. An importer that starts
// with a buffer of 16 MiB took 12 ms before, 2 ms since.
void PrepareHeap() {
  constexpr std::size_t kHugePage = std::size_t{2} << 20, kBlock = std::size_t{30} << 20;
  ::malloc_trim(0);
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest allowed value
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
  void* block = std::malloc(kBlock);
  const auto begin = (reinterpret_cast<std::uintptr_t>(block) + kHugePage - 1) & ~(kHugePage - 1);
  if (block != nullptr)
    ::madvise(reinterpret_cast<void*>(begin), kBlock - kHugePage, MADV_HUGEPAGE);
  std::free(block);
}

ChildExit Run(const ChildSetup& setup, ChildFunction run) {
  try {
    const Bytes result = run([&setup](std::string_view question) { return Ask(setup, question); });
    return setup.mailbox.Put(result) ? kChildDone : kChildCannotDeliver;
  } catch (const std::bad_alloc&) {
    return kChildOutOfMemory;
  } catch (...) {
    return kChildThrew;
  }
}

// Runs the child after the fork. Expects all signals blocked.
[[noreturn]] void RunChildProcess(const ChildSetup& setup, ChildFunction run) noexcept {
  SeparateFromParent(setup.parent_pid);
  CloseDescriptors(setup.socket, setup.mailbox.fd());
  SetLimits(setup);
  PrepareHeap();
  ::_exit(Run(setup, run));  // without the parent's destructors, exit handlers and stdio buffers
}

// The parent ----------------------------------------------------------------------------------

using Clock = std::chrono::steady_clock;

constexpr int kMaxQuestions = 4096;

std::atomic<const StopFlag*> g_stop = nullptr;

// The child's address space limit: what this process has mapped, which it inherits, plus the limit.
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
  // child): then it counts as a normal exit, and the mailbox decides.
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

  // Serves the child until it ends.
  Status Watch() {
    while (!child_.Reap(WNOHANG)) {
      if (GuardedMustStop()) return Cancelled("was stopped");
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline_ - Clock::now()).count();
      if (left <= 0) return DataLoss("took more than {} s", limits_.wall_seconds);
      std::array<pollfd, 2> wait = {{{socket_.get(), POLLIN, 0}, {child_.end_fd(), POLLIN, 0}}};
      // Another thread may receive the signal that sets the flag.
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
    // A child that asks without reading answers fills the socket; that must not block us.
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

// This process's own limit if it is lower than the child's grant; else 0.
rlim_t OwnLimit(decltype(RLIMIT_AS) resource, std::size_t granted) {
  rlimit own = {};
  if (::getrlimit(resource, &own) != 0 || own.rlim_cur >= granted) return 0;
  return own.rlim_cur;
}

// If this process may map less than the child was granted, its own limit is to blame, not the file.
Status TooMuchMemory(const GuardLimits& limits) {
  if (const rlim_t own = OwnLimit(RLIMIT_AS, AddressSpace(limits)); own > 0) {
    NoteShortage(ENOMEM);
    return IoError("ran out of memory: {} MB may be mapped here (ulimit -v)", own >> 20);
  }
  return ResourceExhausted("needed more than {} MB of memory", limits.memory_bytes >> 20);
}

// The mailbox counts as a file: the size limit of this process's files applies to it.
Status TooLargeAResult(const GuardLimits& limits) {
  rlimit own = {};
  if (::getrlimit(RLIMIT_FSIZE, &own) != 0 || own.rlim_max >= limits.memory_bytes)
    return TooMuchMemory(limits);
  return IoError("could not return its result: files are limited to {} bytes here (ulimit -f)",
                 own.rlim_max);
}

Status StatusOfSignal(int signal, const GuardLimits& limits) {
  if (signal == SIGXCPU)
    return DataLoss("took more than {} s of processor time", limits.cpu_seconds);
  if (signal == SIGXFSZ) return TooLargeAResult(limits);
  if (signal == SIGKILL) {  // nobody else kills it: it volunteers when memory runs out
    NoteShortage(ENOMEM);
    return IoError("was killed by the system for lack of memory");
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
    return IoError("could not return its result");
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
    const BlockedSignals blocked;  // none of our handlers may run in the child
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
