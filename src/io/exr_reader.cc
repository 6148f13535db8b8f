// SPDX-License-Identifier: Apache-2.0
// Reads EXR. The reading process sends bytes to this one: 'E' and a message, or 'I', width, height,
// the number of channels, their names, each terminated by 0, and the values.
#include <algorithm>
#include <array>
#include <cstring>
#include <exception>

#include "base/error.h"
#include "base/read_budget.h"
#include "io/exr_file.h"
#include "io/guarded_process.h"
#include "io/image_file.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#pragma GCC diagnostic pop

namespace tilegrad::io {
namespace {

constexpr int kMaxChannels = 1024;
constexpr std::uint8_t kImage = 'I', kError = 'E';

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::span<const std::uint8_t> bytes) : Imf::IStream("memory"), in_(bytes) {}
  bool read(char to[], int count) override {
    const auto size = static_cast<std::size_t>(count);
    if (count < 0 || at_ > in_.size() || in_.size() - at_ < size)
      throw std::runtime_error("the file is cut short");
    std::memcpy(to, in_.data() + at_, size);
    at_ += size;
    return at_ < in_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t at) override { at_ = at; }

 private:
  std::span<const std::uint8_t> in_;
  std::uint64_t at_ = 0;
};

std::vector<std::string> NamesOf(const Imf::ChannelList& channels) {
  std::vector<std::string> names;
  for (auto c = channels.begin(); c != channels.end(); ++c) names.emplace_back(c.name());
  return names;
}

Status CheckExrHeader(const Imf::Header& header, const GuardLimits& limits) {
  const auto& window = header.dataWindow();
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1,
                     height = std::int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide) {
    return DataLoss("the header says {} x {} pixels; at most {} a side are read", width, height,
                    kMaxImageSide);
  }
  const auto channels = static_cast<std::int64_t>(NamesOf(header.channels()).size());
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    if (c.channel().xSampling != 1 || c.channel().ySampling != 1)
      return DataLoss("channel \"{}\" has fewer samples than pixels: not read", c.name());
  }
  if (channels < 1 || channels > kMaxChannels)
    return DataLoss("{} channels; 1 to {} are read", channels, kMaxChannels);
  const auto bytes = static_cast<std::size_t>(4 * width * height * channels);
  if (bytes > limits.memory_bytes / 4)  // the library and the transfer need room too
    return ResourceExhausted("{} x {} x {} numbers are too many", width, height, channels);
  return ReadBudget::Take(bytes, fmt::format("{} x {} x {} numbers", width, height, channels));
}

void Append(Bytes& out, const void* data, std::size_t size) {
  const std::size_t at = out.size();
  out.resize(at + size);
  std::copy_n(static_cast<const std::uint8_t*>(data), size, out.data() + at);
}

Bytes ErrorBytes(std::string_view message) {
  Bytes out = {kError};
  Append(out, message.data(), message.size());
  return out;
}

Bytes ReadPixels(Imf::InputFile& in) {
  const auto& window = in.header().dataWindow();
  const std::vector<std::string> names = NamesOf(in.header().channels());
  const std::array<std::int32_t, 3> sizes = {window.max.x - window.min.x + 1,
                                             window.max.y - window.min.y + 1,
                                             static_cast<std::int32_t>(names.size())};
  Bytes out = {kImage};
  Append(out, sizes.data(), sizeof(sizes));
  for (const std::string& name : names) Append(out, name.c_str(), name.size() + 1);
  const std::size_t row = sizeof(float) * static_cast<std::size_t>(sizes[0]),
                    plane = row * static_cast<std::size_t>(sizes[1]);
  std::size_t at = out.size();
  out.resize(at + plane * static_cast<std::size_t>(sizes[2]));
  Imf::FrameBuffer frame;
  for (const std::string& name : names) {
    frame.insert(name, Imf::Slice::Make(Imf::FLOAT, out.data() + at, window, sizeof(float), row));
    at += plane;
  }
  in.setFrameBuffer(frame);
  in.readPixels(window.min.y, window.max.y);
  return out;
}

// Runs in the child process.
Bytes ReadInChild(std::span<const std::uint8_t> bytes, const GuardLimits& limits) {
  try {  // the library throws
    MemoryInput stream(bytes);
    Imf::InputFile in(stream, /*numThreads=*/0);
    const Status status = CheckExrHeader(in.header(), limits);
    return status.ok() ? ReadPixels(in) : ErrorBytes(status.message());
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    return ErrorBytes(error.what());
  }
}

}  // namespace

Result<LoadedExr> ExrFromReader(std::span<const std::uint8_t> bytes) {
  const Status damaged = DataLoss("the reader returned no whole image");
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.size() > 1 && text[0] == static_cast<char>(kError))
    return DataLoss("{}", text.substr(1));
  std::array<std::int32_t, 3> sizes = {};
  std::size_t at = 1 + sizeof(sizes);
  if (bytes.size() < at || bytes[0] != kImage) return damaged;
  std::memcpy(sizes.data(), bytes.data() + 1, sizeof(sizes));
  LoadedExr out;
  out.width = sizes[0], out.height = sizes[1];
  if (out.width < 1 || out.height < 1 || std::max(out.width, out.height) > kMaxImageSide ||
      sizes[2] < 1 || sizes[2] > kMaxChannels)
    return damaged;
  for (int c = 0; c < sizes[2]; ++c) {
    const std::size_t end = text.find('\0', at);
    if (end == std::string_view::npos) return damaged;
    out.names.emplace_back(text.substr(at, end - at));
    at = end + 1;
  }
  const std::size_t count =
      static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height) * out.names.size();
  if ((bytes.size() - at) / sizeof(float) != count || (bytes.size() - at) % sizeof(float) != 0)
    return damaged;
  TILEGRAD_TRY(ReadBudget::Take(count * sizeof(float), "the image"));
  out.values.resize(count);
  std::memcpy(out.values.data(), bytes.data() + at, count * sizeof(float));
  return out;
}

Result<LoadedExr> DecodeExr(std::span<const std::uint8_t> bytes, const std::string& name) {
  constexpr std::array<std::uint8_t, 4> kMagic = {0x76, 0x2f, 0x31, 0x01};
  if (bytes.size() < kMagic.size() || !std::equal(kMagic.begin(), kMagic.end(), bytes.begin()))
    return DataLoss("{}: not an EXR image", name);
  GuardLimits limits;
  limits.memory_bytes = std::size_t{4} << 30;
  const auto result = RunGuarded([&](AskParent) { return ReadInChild(bytes, limits); },
                                 [](std::string_view) { return std::optional<Bytes>(); }, limits);
  const std::string place = name + ": reading an EXR image";
  if (!result.ok()) return result.status().Within(place);
  auto image = ExrFromReader(*result);
  if (!image.ok()) return image.status().Within(place);
  return image;
}

Result<LoadedExr> LoadExr(const Path& path) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(path));
  return DecodeExr(bytes, path.string());
}

}  // namespace tilegrad::io
