// SPDX-License-Identifier: Apache-2.0
// Engine functions as Python functions for two dtypes: all arrays of a call are float32, or all are
// float64.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "base/array_checks.h"
#include "base/default_floats.h"
#include "base/parallel.h"
#include "bindings/arrays.h"
#include "bindings/gil.h"

namespace tilegrad::python {

// The process's Workers of `threads` threads (0: one for each core that it may use), made at the
// first call; several threads may use them at the same time. A forked child has its own Workers.
const Workers& SharedWorkers(int threads);

// Recycles the memory of results that a program requests repeatedly, as training steps do: reuses
// the blocks of freed arrays. Fresh pages from the system may cost more than the computation that
// fills them.

inline constexpr std::size_t kLeastKeptBytes = std::size_t{1} << 16;  // malloc keeps smaller ones
// In total; beyond that, the blocks freed first go back to the system.
inline constexpr std::size_t kMostKeptBytes = std::size_t{256} << 20;

// At least `bytes` uninitialised bytes, aligned for kernels, until the capsule dies. With the GIL
// held, which is also held when the capsule dies.
struct KeptBlock {
  void* data;
  py::capsule owner;
};
KeptBlock TakeKeptBlock(std::size_t bytes);

// call(float()) or call(double()), by the dtype of `array`, which is the argument of that name.
template <class Call>
auto Dispatch(const py::array& array, const char* function, const char* argument,
              const Call& call) {
  if (py::isinstance<py::array_t<float>>(array)) return call(float());
  if (py::isinstance<py::array_t<double>>(array)) return call(double());
  throw py::type_error(fmt::format("{}: {} has dtype {}, expected float32 or float64", function,
                                   argument, py::str(array.dtype()).cast<std::string>()));
}

// A result, uninitialised.
template <class T>
py::array_t<T> NewArray(const std::vector<py::ssize_t>& shape) {
  std::size_t bytes = sizeof(T);
  for (const py::ssize_t n : shape) bytes *= static_cast<std::size_t>(n);
  if (bytes < kLeastKeptBytes) return py::array_t<T>(shape);
  const KeptBlock block = TakeKeptBlock(bytes);
  return py::array_t<T>(shape, static_cast<T*>(block.data), block.owner);
}

// One of the shape of another array.
template <class T>
py::array_t<T> NewArrayLike(const py::array& array) {
  return NewArray<T>({array.shape(), array.shape() + array.ndim()});
}

template <class T>
std::span<T> NumbersOf(py::array_t<T>& array) {
  return {array.mutable_data(), static_cast<std::size_t>(array.size())};
}

// The same of an array that may be absent: empty then.
template <class T>
std::span<T> NumbersOf(std::optional<py::array_t<T>>& array) {
  return array.has_value() ? NumbersOf(*array) : std::span<T>();
}
template <class T>
std::span<const T> OptionalSpanOf(const std::optional<py::array>& array, const char* function,
                                  const char* argument, const std::vector<py::ssize_t>& shape) {
  return array.has_value() ? SpanOf<T>(*array, function, argument, shape) : std::span<const T>();
}

// The numbers of `array`, which must be finite. Errors: as SpanOf.
template <class T>
std::span<const T> FiniteSpanOf(const py::object& array, const char* function, const char* argument,
                                const std::vector<py::ssize_t>& shape) {
  const auto numbers = SpanOf<T>(array, function, argument, shape);
  if (AllFinite(numbers)) return numbers;
  throw py::value_error(fmt::format("{}: {} has a number that is not finite", function, argument));
}

// Runs engine work without the GIL; it returns a Status or nothing.
template <class Work>
void Run(const char* function, const Work& work) {
  Status status;
  {
    const GilReleased released;
    const DefaultFloats floats;
    if constexpr (std::is_void_v<decltype(work())>) {
      work();
    } else {
      status = work();
    }
  }
  ThrowIfError(status.Within(function));
}

// The same of work(SharedWorkers(threads)).
template <class Work>
void Run(const char* function, int threads, const Work& work) {
  const Workers& workers = SharedWorkers(threads);
  Run(function, [&] { return work(workers); });
}

}  // namespace tilegrad::python
