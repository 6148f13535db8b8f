// SPDX-License-Identifier: Apache-2.0
// A vector for short lists: stores up to N elements in the object itself, more on the heap.
#pragma once

#include <array>
#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace tilegrad {

// T is default-constructible and copyable; unused elements are T().
template <class T, std::size_t N>
class InlineVector {
 public:
  InlineVector() = default;
  explicit InlineVector(std::size_t size) { resize(size); }
  InlineVector(std::initializer_list<T> values) {
    for (const T& value : values) push_back(value);
  }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* data() { return size_ > N ? many_.data() : few_.data(); }
  const T* data() const { return size_ > N ? many_.data() : few_.data(); }
  T& operator[](std::size_t i) { return data()[i]; }
  const T& operator[](std::size_t i) const { return data()[i]; }
  const T& back() const { return data()[size_ - 1]; }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }

  void resize(std::size_t size) {
    if (size > N) {
      // Moves: a copy left behind would keep its resources alive.
      if (size_ <= N) {
        many_.reserve(size);
        for (std::size_t i = 0; i < size_; ++i) many_.push_back(std::exchange(few_[i], T()));
      }
      many_.resize(size);
    } else if (size_ > N) {
      for (std::size_t i = 0; i < size; ++i) few_[i] = std::move(many_[i]);
      many_.clear();
    }
    for (std::size_t i = size; i < size_ && i < N; ++i) few_[i] = T();
    size_ = size;
  }
  void push_back(T value) {
    resize(size_ + 1);
    data()[size_ - 1] = std::move(value);
  }
  void clear() { resize(0); }

 private:
  std::array<T, N> few_{};
  std::vector<T> many_;  // all elements, if there are more than N
  std::size_t size_ = 0;
};

}  // namespace tilegrad
