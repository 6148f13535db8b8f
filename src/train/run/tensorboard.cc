// SPDX-License-Identifier: Apache-2.0
#include "train/run/tensorboard.h"

#include <array>
#include <bit>

namespace tilegrad::train {
namespace {

constexpr std::array<std::uint32_t, 256> MakeCrcTable() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i;
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0x82F63B78u : 0u);
    table[i] = crc;
  }
  return table;
}
constexpr auto kCrcTable = MakeCrcTable();

std::uint32_t MaskedCrc(std::string_view bytes) {
  const std::uint32_t crc = Crc32c(bytes);
  return (crc >> 15 | crc << 17) + 0xA282EAD8u;
}

template <class T>
void AppendLittleEndian(std::string& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) out += static_cast<char>(value >> (8 * i));
}

// Protocol buffers: a key is field number << 3 | wire type.
enum WireType : std::uint8_t { kVarint = 0, kFixed64 = 1, kLengthDelimited = 2, kFixed32 = 5 };

void AppendVarint(std::string& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
  out += static_cast<char>(value);
}
void AppendKey(std::string& out, int field, WireType type) {
  AppendVarint(out, static_cast<std::uint64_t>(field) << 3 | type);
}
void AppendBytes(std::string& out, int field, std::string_view bytes) {
  AppendKey(out, field, kLengthDelimited);
  AppendVarint(out, bytes.size());
  out += bytes;
}
void AppendDouble(std::string& out, int field, double value) {
  AppendKey(out, field, kFixed64);
  AppendLittleEndian(out, std::bit_cast<std::uint64_t>(value));
}

std::string Record(const std::string& event) {
  std::string length, out;
  AppendLittleEndian(length, static_cast<std::uint64_t>(event.size()));
  out = length;
  AppendLittleEndian(out, MaskedCrc(length));
  out += event;
  AppendLittleEndian(out, MaskedCrc(event));
  return out;
}

}  // namespace

std::uint32_t Crc32c(std::string_view bytes) {
  std::uint32_t crc = ~0u;
  for (const char c : bytes)
    crc = crc >> 8 ^ kCrcTable[(crc ^ static_cast<unsigned char>(c)) & 0xff];
  return ~crc;
}

// Event: wall_time = 1, step = 2, file_version = 3, summary = 5. Summary: value = 1. Value: tag =
// 1, simple_value = 2.
std::string TensorboardVersionRecord(double wall_time) {
  std::string event;
  AppendDouble(event, 1, wall_time);
  AppendBytes(event, 3, "brain.Event:2");
  return Record(event);
}

std::string TensorboardScalarsRecord(double wall_time, std::int64_t step, const Scalars& scalars) {
  std::string summary;
  for (const auto& [tag, value] : scalars) {
    std::string entry;
    AppendBytes(entry, 1, tag);
    AppendKey(entry, 2, kFixed32);
    AppendLittleEndian(entry, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    AppendBytes(summary, 1, entry);
  }
  std::string event;
  AppendDouble(event, 1, wall_time);
  AppendKey(event, 2, kVarint);
  AppendVarint(event, static_cast<std::uint64_t>(step));
  AppendBytes(event, 5, summary);
  return Record(event);
}

}  // namespace tilegrad::train
