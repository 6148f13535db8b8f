// SPDX-License-Identifier: Apache-2.0
#include "base/read_budget.h"

#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <system_error>

#include "base/error.h"

namespace tilegrad {
namespace {

constexpr std::size_t kDefault = std::size_t{4} << 30;

thread_local ReadBudget* t_outermost = nullptr;

// 0 for what is no number of bytes.
std::size_t ParseBytes(std::string_view text) {
  std::size_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || end - at > 1) return 0;
  if (at == end) return value;
  const std::size_t power = std::string_view("KMGT").find(*at);
  if (power == std::string_view::npos) return 0;
  const std::size_t factor = std::size_t{1} << (10 * (power + 1));
  std::size_t bytes = 0;
  return __builtin_mul_overflow(value, factor, &bytes) ? 0 : bytes;
}

std::string Megabytes(std::size_t bytes) { return fmt::format("{} MB", (bytes >> 20) + 1); }

std::atomic<std::uint64_t> g_count = 0;
std::atomic<int> g_last = 0;

const char* Remedy(int error) {
  if (error == EMFILE) return "allow more open files (ulimit -n) or use fewer workers";
  if (error == ENFILE) return "close other programs' files or use fewer workers";
  if (error == EAGAIN) return "allow more processes (ulimit -u) or use fewer workers";
  return "allow more memory (ulimit -v, the container's limit) or use fewer workers";
}

}  // namespace

Result<std::size_t> ParseByteCount(const std::string& text) {
  if (const std::size_t bytes = ParseBytes(text); bytes > 0) return bytes;
  return InvalidArgument("\"{}\" is not a size; give bytes, such as 4294967296, 500M or 16G", text);
}

Result<std::size_t> ReadLimit() {
  const char* const text = std::getenv(kReadLimitVariable);
  if (text == nullptr || *text == '\0') return kDefault;
  auto bytes = ParseByteCount(text);
  if (!bytes.ok()) return bytes.status().Within(kReadLimitVariable);
  return bytes;
}

ReadBudget::ReadBudget() : outer_(t_outermost), limit_(ReadLimit()) {
  if (outer_ == nullptr) t_outermost = this;
}

ReadBudget::ReadBudget(std::size_t bytes) : outer_(t_outermost), limit_(bytes) {
  if (outer_ == nullptr) t_outermost = this;
}

ReadBudget::~ReadBudget() {
  if (outer_ == nullptr) t_outermost = nullptr;
}

Status ReadBudget::Take(std::size_t bytes, const std::string& what) {
  ReadBudget* const budget = t_outermost;
  if (budget == nullptr) return {};
  Status status = budget->limit_.status();
  if (status.ok() && bytes > *budget->limit_ - budget->taken_) {
    status = ResourceExhausted(
        "{}: needs {} more, above the memory limit of {} per file, referenced files included; "
        "raise it (bytes, or 16G) with --read-limit, in Python max_bytes, or {} in the environment",
        what, Megabytes(bytes), Megabytes(*budget->limit_ - 1), kReadLimitVariable);
  }
  if (status.ok()) budget->taken_ += bytes;
  if (budget->refused_.ok()) budget->refused_ = status;
  return status;
}

Status ReadBudget::status() const { return outer_ != nullptr ? outer_->status() : refused_; }

bool IsShortage(int error) {
  for (const int shortage : {EMFILE, ENFILE, ENOMEM, EAGAIN, ENOBUFS}) {
    if (error == shortage) return true;
  }
  return false;
}

void NoteShortage(int error) {
  if (!IsShortage(error)) return;
  g_last = error;
  ++g_count;
}

ShortageWatch::ShortageWatch() : before_(g_count) {}

Status ShortageWatch::Check(const std::string& place) const {
  if (g_count == before_) return {};
  const int error = g_last;
  return IoError("{}: not read, the system ran out of a resource: {}; {}", place,
                 std::strerror(error), Remedy(error));
}

}  // namespace tilegrad
