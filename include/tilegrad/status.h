// SPDX-License-Identifier: Apache-2.0
// Errors as values. Nothing in the library throws across its surface, prints or aborts: a function
// that can fail returns Status or Result<T>, whose message names the file or argument, the place in
// it, and what to do.
#pragma once

#include <cassert>
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace tilegrad {

enum class StatusCode {
  kOk = 0,
  kInvalidArgument,    // the caller's value or configuration is wrong
  kNotFound,           // a file or name does not exist
  kDataLoss,           // a file exists but is truncated, corrupt or not of the format it claims
  kIo,                 // the operating system refused: permission, full disk
  kResourceExhausted,  // larger than the memory or the limit allows
  kCancelled,          // a signal or the caller asked to stop
  kInternal,           // a bug in tilegrad
};

class [[nodiscard]] Status {
 public:
  Status() = default;  // OK
  Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}

  bool ok() const { return code_ == StatusCode::kOk; }
  StatusCode code() const { return code_; }
  const std::string& message() const { return message_; }

  // Prefixes the place of the error: "reading chair.obj: line 3: ...". OK stays OK.
  Status Within(const std::string& place) const {
    return ok() ? *this : Status(code_, place + ": " + message_);
  }

 private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

// Either a T or the Status that says why there is none. Call value() only if ok().
template <class T>
class [[nodiscard]] Result {
 public:
  // Implicit, so that a function can return either.
  Result(T value) : state_(std::move(value)) {}                         // NOLINT
  Result(Status status) : state_(std::move(status)) { assert(!ok()); }  // NOLINT

  bool ok() const { return std::holds_alternative<T>(state_); }
  Status status() const { return ok() ? Status() : std::get<Status>(state_); }
  T& value() & { return std::get<T>(state_); }
  const T& value() const& { return std::get<T>(state_); }
  T&& value() && { return std::get<T>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<T, Status> state_;
};

// Return early on an error; ASSIGN also declares or sets `lhs` from a Result.
#define TILEGRAD_CONCAT_INNER(a, b) a##b
#define TILEGRAD_CONCAT(a, b) TILEGRAD_CONCAT_INNER(a, b)
#define TILEGRAD_TRY(expr)                                   \
  do {                                                       \
    if (::tilegrad::Status s_ = (expr); !s_.ok()) return s_; \
  } while (false)
#define TILEGRAD_ASSIGN_INNER(tmp, lhs, expr) \
  auto tmp = (expr);                          \
  if (!tmp.ok()) return tmp.status();         \
  lhs = std::move(tmp).value()
#define TILEGRAD_ASSIGN(lhs, expr) \
  TILEGRAD_ASSIGN_INNER(TILEGRAD_CONCAT(result_, __LINE__), lhs, expr)

}  // namespace tilegrad
