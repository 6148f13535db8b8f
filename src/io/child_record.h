// SPDX-License-Identifier: Apache-2.0
// Internal to io: serialises what a child process (guarded_process.h) returns: a record of numbers,
// texts, lists and other records, or an error.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "base/file.h"

namespace tilegrad::io {

// Pointers to the members of a record in order, for reading and writing; specialised per record.
template <class Record>
inline constexpr auto kFieldsOf = nullptr;

namespace child_record {

constexpr std::uint32_t kMagic = 0x54475332;  // "TGS2"; the digit is the version
constexpr int kMostNested = 64;               // records within records

template <class T>
struct IsList : std::false_type {};
template <class E>
struct IsList<std::vector<E>> : std::true_type {};
template <>
struct IsList<std::string> : std::true_type {};

// Without a buffer only counts bytes, so that the output is allocated once.
class Writer {
 public:
  explicit Writer(std::uint8_t* to) : to_(to) {}
  std::size_t written() const { return written_; }

  template <class T>
  void Write(const T& value) {
    if constexpr (IsList<T>::value) {
      Write(std::uint64_t{value.size()});
      if constexpr (std::is_trivially_copyable_v<typename T::value_type>) {
        Raw(value.data(), value.size() * sizeof(typename T::value_type));
      } else {
        for (const auto& element : value) Write(element);
      }
    } else if constexpr (std::is_trivially_copyable_v<T>) {
      Raw(&value, sizeof(value));
    } else {
      std::apply([&](auto... field) { (Write(value.*field), ...); }, kFieldsOf<T>);
    }
  }

 private:
  void Raw(const void* from, std::size_t size) {
    if (to_ != nullptr && size > 0) std::memcpy(to_ + written_, from, size);
    written_ += size;
  }

  std::uint8_t* to_;
  std::size_t written_ = 0;
};

class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : left_(bytes) {}
  bool whole() const { return good_ && left_.empty(); }
  bool good() const { return good_; }

  template <class T>
  void Read(T& value) {
    if constexpr (IsList<T>::value) {
      ReadList(value);
    } else if constexpr (std::is_trivially_copyable_v<T>) {
      Raw(&value, sizeof(value));
    } else {
      good_ = good_ && ++nested_ <= kMostNested;
      if (!good_) return;
      std::apply([&](auto... field) { (Read(value.*field), ...); }, kFieldsOf<T>);
      --nested_;
    }
  }

 private:
  template <class T>
  void ReadList(T& list) {
    std::uint64_t count = 0;
    Read(count);
    if constexpr (std::is_trivially_copyable_v<typename T::value_type>) {
      if (count > left_.size() / sizeof(typename T::value_type)) good_ = false;
      if (!good_) return;
      list.resize(count);
      Raw(list.data(), count * sizeof(typename T::value_type));
    } else {  // grows per element read, since each takes bytes
      for (; good_ && count > 0; --count) Read(list.emplace_back());
    }
  }
  void Raw(void* to, std::size_t size) {
    if (size > left_.size()) good_ = false;
    if (!good_ || size == 0) return;
    std::memcpy(to, left_.data(), size);
    left_ = left_.subspan(size);
  }

  std::span<const std::uint8_t> left_;
  bool good_ = true;
  int nested_ = 0;
};

}  // namespace child_record

// Format of this version of the program only.
template <class Record>
Bytes EncodeRecord(const Result<Record>& record) {
  const Status status = record.status();
  const auto write = [&](std::uint8_t* to) {
    child_record::Writer writer(to);
    writer.Write(child_record::kMagic);
    writer.Write(static_cast<std::uint32_t>(status.code()));
    writer.Write(std::string(status.message()));
    if (record.ok()) writer.Write(*record);
    return writer.written();
  };
  Bytes out(write(nullptr));
  write(out.data());
  return out;
}

// Decodes untrusted bytes: checks every count against the bytes left before allocating. Errors:
// that of the encoded Result, or kDataLoss. The caller must check what the numbers mean.
template <class Record>
Result<Record> DecodeRecord(std::span<const std::uint8_t> bytes) {
  const Status broken = DataLoss("the importer returned incomplete data");
  child_record::Reader reader(bytes);
  std::uint32_t magic = 0, code = 0;
  std::string message;
  reader.Read(magic);
  reader.Read(code);
  reader.Read(message);
  if (!reader.good() || magic != child_record::kMagic) return broken;
  if (code != static_cast<std::uint32_t>(StatusCode::kOk))
    return message.empty() ? broken : DataLoss("{}", message);
  Record record;
  reader.Read(record);
  if (!reader.whole()) return broken;
  return record;
}

}  // namespace tilegrad::io
