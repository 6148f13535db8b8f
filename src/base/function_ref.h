// SPDX-License-Identifier: Apache-2.0
// A callable passed down the stack without a heap allocation (std::function may allocate; frames
// must not).
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <tuple>
#include <type_traits>
#include <utility>

namespace tilegrad {

template <class Signature>
class FunctionRef;

// Refers to a callable that must outlive the FunctionRef: use it for parameters only. The callable
// may leave out the last parameter.
template <class R, class... A>
class FunctionRef<R(A...)> {
 public:
  template <class F, class = std::enable_if_t<!std::is_same_v<std::decay_t<F>, FunctionRef>>>
  FunctionRef(F&& f)  // NOLINT: implicit by design
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(f)))),
        call_([](void* o, A... a) -> R {
          auto& function = *static_cast<std::remove_reference_t<F>*>(o);
          if constexpr (std::is_invocable_v<decltype(function), A...>) {
            return function(std::forward<A>(a)...);
          } else {
            return CallWithoutLast(function, std::forward_as_tuple(std::forward<A>(a)...),
                                   std::make_index_sequence<sizeof...(A) - 1>());
          }
        }) {}
  R operator()(A... a) const { return call_(object_, std::forward<A>(a)...); }

 private:
  template <class F, std::size_t... kIndex>
  static R CallWithoutLast(F& function, std::tuple<A&&...> a, std::index_sequence<kIndex...>) {
    return function(std::get<kIndex>(std::move(a))...);
  }

  void* object_;
  R (*call_)(void*, A...);
};

// An owning callable that never allocates on the heap.

template <class Signature, std::size_t kBytes>
class InlineFunction;

// Holds any callable of at most kBytes; a larger one does not compile.
template <class R, class... A, std::size_t kBytes>
class InlineFunction<R(A...), kBytes> {
 public:
  InlineFunction() = default;
  InlineFunction(std::nullptr_t) {}  // NOLINT: implicit, as std::function's
  template <class F, class = std::enable_if_t<!std::is_same_v<std::decay_t<F>, InlineFunction>>>
  InlineFunction(F&& f) {  // NOLINT: implicit by design
    using Held = std::decay_t<F>;
    static_assert(sizeof(Held) <= kBytes && alignof(Held) <= alignof(std::max_align_t));
    ::new (static_cast<void*>(bytes_)) Held(std::forward<F>(f));
    call_ = [](std::byte* held, A... a) -> R {
      return (*Pointer<Held>(held))(std::forward<A>(a)...);
    };
    move_ = [](std::byte* held, std::byte* to) {
      if (to != nullptr) ::new (static_cast<void*>(to)) Held(std::move(*Pointer<Held>(held)));
      std::destroy_at(Pointer<Held>(held));
    };
  }
  InlineFunction(InlineFunction&& other) noexcept { Take(other); }
  InlineFunction& operator=(InlineFunction&& other) noexcept {
    if (this != &other) {
      Reset();
      Take(other);
    }
    return *this;
  }
  ~InlineFunction() { Reset(); }

  explicit operator bool() const { return call_ != nullptr; }
  R operator()(A... a) { return call_(bytes_, std::forward<A>(a)...); }

 private:
  template <class Held>
  static Held* Pointer(std::byte* held) {
    return std::launder(reinterpret_cast<Held*>(held));
  }
  void Reset() {
    call_ = nullptr;
    if (auto* move = std::exchange(move_, nullptr); move != nullptr) move(bytes_, nullptr);
  }
  void Take(InlineFunction& other) {
    if (other.move_ == nullptr) return;
    call_ = std::exchange(other.call_, nullptr);
    move_ = std::exchange(other.move_, nullptr);
    move_(other.bytes_, bytes_);
  }

  alignas(std::max_align_t) std::byte bytes_[kBytes];
  R (*call_)(std::byte* held, A... a) = nullptr;
  void (*move_)(std::byte* held, std::byte* to) = nullptr;  // destroys; moves to `to` first unless
                                                            // null
};

}  // namespace tilegrad
