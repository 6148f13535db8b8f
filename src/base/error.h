// SPDX-License-Identifier: Apache-2.0
// Short ways to make a Status with a formatted message: InvalidArgument("faces must be [F,3], got
// {} indices", n).
#pragma once

#include <fmt/format.h>

#include <exception>
#include <new>
#include <stdexcept>
#include <utility>

#include "tilegrad/status.h"

namespace tilegrad {

#define TILEGRAD_ERROR_MAKER(Name, kCode)                                      \
  template <class... A>                                                        \
  Status Name(fmt::format_string<A...> format, A&&... args) {                  \
    return {StatusCode::kCode, fmt::format(format, std::forward<A>(args)...)}; \
  }
TILEGRAD_ERROR_MAKER(InvalidArgument, kInvalidArgument)
TILEGRAD_ERROR_MAKER(NotFound, kNotFound)
TILEGRAD_ERROR_MAKER(DataLoss, kDataLoss)
TILEGRAD_ERROR_MAKER(IoError, kIo)
TILEGRAD_ERROR_MAKER(ResourceExhausted, kResourceExhausted)
TILEGRAD_ERROR_MAKER(Cancelled, kCancelled)
TILEGRAD_ERROR_MAKER(InternalError, kInternal)
#undef TILEGRAD_ERROR_MAKER

// The boundary that no exception crosses: exceptions of the standard library (out of memory) become
// a Status.

// Returns call(). The messages are short enough for std::string to hold without allocating.
template <class Call>
Status Guarded(const Call& call) noexcept {
  try {
    return call();
  } catch (const std::bad_alloc&) {
    return {StatusCode::kResourceExhausted, "out of memory"};
  } catch (const std::length_error&) {
    return {StatusCode::kResourceExhausted, "out of memory"};
  } catch (...) {
    return {StatusCode::kInternal, "internal error"};
  }
}

template <class T, class Call>
Result<T> GuardedResult(const Call& call) noexcept {
  T value;
  const Status status = Guarded([&]() -> Status {
    Result<T> result = call();
    if (!result.ok()) return result.status();
    value = std::move(*result);
    return {};
  });
  if (!status.ok()) return status;
  return value;
}

}  // namespace tilegrad
