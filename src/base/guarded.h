// SPDX-License-Identifier: Apache-2.0
// The border that no exception crosses: the standard library's own (no memory) become a Status.
#pragma once

#include <exception>
#include <new>
#include <stdexcept>
#include <utility>

#include "tilegrad/status.h"

namespace tilegrad {

// What `call` returns. The messages fit into a std::string without memory of its own.
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
