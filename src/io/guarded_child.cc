// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <new>

#include "io/guarded_channel.h"

namespace tilegrad::io {
namespace {

// The parent's handlers must not run here. A group of its own keeps the terminal's Ctrl-C away,
// which is the parent's to act on; if the parent goes, so does the child.
void SeparateFromParent(int parent_pid) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent_pid) ::_exit(kChildCannotDeliver);
  for (int signal = 1; signal < NSIG; ++signal) std::signal(signal, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
}

// Closes or redirects every descriptor of the parent but two: nothing is read or printed.
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

// Page faults are most of what a short-lived process costs: every page of the parent's heap that it
// reuses is copied, every new one cleared. So what the parent left free is given back, the next
// block is made of huge pages, and nothing is given back from then on. An importer that begins with
// a buffer of 16 MiB took 12 ms before, 2 ms since.
void PrepareHeap() {
  constexpr std::size_t kHugePage = std::size_t{2} << 20, kBlock = std::size_t{30} << 20;
  ::malloc_trim(0);
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest that it takes
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

}  // namespace

void RunChildProcess(const ChildSetup& setup, ChildFunction run) noexcept {
  SeparateFromParent(setup.parent_pid);
  CloseDescriptors(setup.socket, setup.mailbox.fd());
  SetLimits(setup);
  PrepareHeap();
  ::_exit(Run(setup, run));  // without the parent's destructors, exit handlers and stdio buffers
}

}  // namespace tilegrad::io
