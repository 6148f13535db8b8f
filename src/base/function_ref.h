// SPDX-License-Identifier: Apache-2.0
// A callable passed down the stack without a heap allocation (std::function may allocate; frames
// must not).
#pragma once

#include <memory>
#include <type_traits>
#include <utility>

namespace tilegrad {

template <class Signature>
class FunctionRef;

// Refers to a callable that must outlive the FunctionRef: use it for parameters only.
template <class R, class... A>
class FunctionRef<R(A...)> {
 public:
  template <class F, class = std::enable_if_t<!std::is_same_v<std::decay_t<F>, FunctionRef>>>
  FunctionRef(F&& f)  // NOLINT: implicit by design
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(f)))),
        call_([](void* o, A... a) -> R {
          return (*static_cast<std::remove_reference_t<F>*>(o))(std::forward<A>(a)...);
        }) {}
  R operator()(A... a) const { return call_(object_, std::forward<A>(a)...); }

 private:
  void* object_;
  R (*call_)(void*, A...);
};

}  // namespace tilegrad
