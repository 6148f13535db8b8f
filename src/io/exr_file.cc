// SPDX-License-Identifier: Apache-2.0
#include "io/exr_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>

#include "base/error.h"
#include "base/read_budget.h"
#include "io/guarded_process.h"
#include "io/image_file.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#pragma GCC diagnostic pop

namespace tilegrad::io {
namespace {

class ExrStream : public Imf::OStream {
 public:
  ExrStream() : Imf::OStream("memory") {}
  void write(const char* from, int count) override {
    const auto size = static_cast<std::size_t>(count);
    if (bytes.size() < at_ + size) bytes.resize(at_ + size);
    std::memcpy(bytes.data() + at_, from, size);
    at_ += size;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t at) override { at_ = at; }

  Bytes bytes;

 private:
  std::size_t at_ = 0;
};

// The library would truncate the name at a NUL, and drop one of two names that then agree.
Status CheckName(const std::string& name) {
  constexpr std::size_t kMost = 255;  // Imf::Name::MAX_LENGTH
  if (name.size() > kMost) {
    return InvalidArgument("EXR channel name \"{}...\" has {} bytes; a file holds {}",
                           name.substr(0, 20), name.size(), kMost);
  }
  const std::size_t end = name.find('\0');
  if (end == std::string::npos) return {};
  return InvalidArgument(
      "EXR channel name \"{}\" continues after a NUL, which ends names in a file",
      name.substr(0, end));
}

Status Check(const ExrImage& image) {
  if (image.width < 1 || image.height < 1 || image.channels.empty()) {
    return InvalidArgument("an EXR needs a pixel and a channel, got {} x {} x {}", image.width,
                           image.height, image.channels.size());
  }
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  for (std::size_t i = 0; i < image.channels.size(); ++i) {
    const ExrChannel& c = image.channels[i];
    if (c.values.size() != pixels) {
      return InvalidArgument("EXR channel \"{}\": {} values for {} x {} pixels", c.name,
                             c.values.size(), image.width, image.height);
    }
    TILEGRAD_TRY(CheckName(c.name));
    bool twice = c.name.empty();
    for (std::size_t j = 0; j < i; ++j) twice |= image.channels[j].name == c.name;
    if (twice) return InvalidArgument("EXR channel name \"{}\" is empty or appears twice", c.name);
  }
  return {};
}

void Write(const ExrImage& image, Imf::OStream& stream) {
  Imf::Header header(image.width, image.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer frame;
  for (const ExrChannel& c : image.channels) {
    header.channels().insert(c.name, Imf::Channel(Imf::FLOAT));
    // The library takes a pointer to non-const even for reading.
    frame.insert(
        c.name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(c.values.data())),
                           sizeof(float), sizeof(float) * static_cast<std::size_t>(image.width)));
  }
  Imf::OutputFile file(stream, header);
  file.setFrameBuffer(frame);
  file.writePixels(image.height);
}

// The child sends bytes to this process: 'E' and a message, or 'I', width, height, the numbers of
// channels and of warnings, the names of channels and the warnings, each terminated by 0, and the
// values.

constexpr int kMaxChannels = 1024, kMaxWarnings = 2;
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

using ExrWindow = Imath::Box2i;

struct WindowSize {
  std::int64_t width, height;
};

WindowSize SizeOfWindow(const ExrWindow& window) {
  return {std::int64_t{window.max.x} - window.min.x + 1,
          std::int64_t{window.max.y} - window.min.y + 1};
}

std::string TextOfWindow(const ExrWindow& window) {
  return fmt::format("({}, {}) to ({}, {})", window.min.x, window.min.y, window.max.x,
                     window.max.y);
}

Status CheckExrHeader(const Imf::Header& header, const GuardLimits& limits) {
  std::int64_t pixels = 0;  // the picture's and those of the data
  for (const ExrWindow& window : {header.displayWindow(), header.dataWindow()}) {
    const auto [width, height] = SizeOfWindow(window);
    if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide) {
      return DataLoss("the header says {} x {} pixels; at most {} a side are read", width, height,
                      kMaxImageSide);
    }
    pixels += width * height;
  }
  const auto channels = static_cast<std::int64_t>(NamesOf(header.channels()).size());
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    if (c.channel().xSampling != 1 || c.channel().ySampling != 1)
      return DataLoss("channel \"{}\" has fewer samples than pixels: not read", c.name());
  }
  if (channels < 1 || channels > kMaxChannels)
    return DataLoss("{} channels; 1 to {} are supported", channels, kMaxChannels);
  const auto bytes = static_cast<std::size_t>(4 * pixels * channels);
  if (bytes > limits.memory_bytes / 2)  // the library needs room too
    return ResourceExhausted("{} pixels of {} channels are too many", pixels, channels);
  return ReadBudget::Take(bytes, fmt::format("{} pixels of {} channels", pixels, channels));
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

// All channels of the data window, concatenated.
std::vector<float> ReadData(Imf::InputPart& in, const std::vector<std::string>& names) {
  const ExrWindow& window = in.header().dataWindow();
  const auto [width, height] = SizeOfWindow(window);
  const auto pixels = static_cast<std::size_t>(width * height);
  std::vector<float> data(pixels * names.size());
  Imf::FrameBuffer frame;
  for (std::size_t c = 0; c < names.size(); ++c) {
    frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, &data[c * pixels], window, sizeof(float),
                                            sizeof(float) * static_cast<std::size_t>(width)));
  }
  in.setFrameBuffer(frame);
  in.readPixels(window.min.y, window.max.y);
  return data;
}

// Copies one channel of the data window into the display window, whose floats may be unaligned.
void PlaceInPicture(const float* data, const ExrWindow& from, const ExrWindow& to,
                    std::uint8_t* picture) {
  const auto at = [](const ExrWindow& window, std::int64_t x, std::int64_t y) {
    return (y - window.min.y) * SizeOfWindow(window).width + (x - window.min.x);
  };
  const int left = std::max(from.min.x, to.min.x), right = std::min(from.max.x, to.max.x);
  if (left > right) return;
  const auto bytes = sizeof(float) * (static_cast<std::size_t>(right - left) + 1);
  for (std::int64_t y = std::max(from.min.y, to.min.y); y <= std::min(from.max.y, to.max.y); ++y)
    std::memcpy(picture + sizeof(float) * at(to, left, y), data + at(from, left, y), bytes);
}

std::vector<std::string> ExrWarnings(const Imf::Header& header, int parts) {
  std::vector<std::string> warnings;
  const ExrWindow &data = header.dataWindow(), &display = header.displayWindow();
  if (!display.intersects(data.min) || !display.intersects(data.max)) {
    warnings.push_back(fmt::format("data outside the display window left out: {}, outside {}",
                                   TextOfWindow(data), TextOfWindow(display)));
  }
  if (parts > 1) warnings.push_back(fmt::format("{} parts; the first is read", parts));
  return warnings;
}

Bytes ReadPicture(Imf::InputPart& in, int parts) {
  const ExrWindow &data_window = in.header().dataWindow(), &display = in.header().displayWindow();
  const std::vector<std::string> names = NamesOf(in.header().channels()),
                                 warnings = ExrWarnings(in.header(), parts);
  const auto [width, height] = SizeOfWindow(display);
  const std::array<std::int32_t, 4> sizes = {
      static_cast<std::int32_t>(width), static_cast<std::int32_t>(height),
      static_cast<std::int32_t>(names.size()), static_cast<std::int32_t>(warnings.size())};
  Bytes out = {kImage};
  Append(out, sizes.data(), sizeof(sizes));
  for (const auto* texts : {&names, &warnings}) {
    for (const std::string& text : *texts) Append(out, text.c_str(), text.size() + 1);
  }
  const std::vector<float> data = ReadData(in, names);
  const std::size_t head = out.size(), data_pixels = data.size() / names.size(),
                    plane = sizeof(float) * static_cast<std::size_t>(width * height);
  out.resize(head + names.size() * plane);
  for (std::size_t c = 0; c < names.size(); ++c)
    PlaceInPicture(&data[c * data_pixels], data_window, display, &out[head + c * plane]);
  return out;
}

// Runs in the child process.
Bytes ReadInChild(std::span<const std::uint8_t> bytes, const GuardLimits& limits) {
  try {  // the library throws
    MemoryInput stream(bytes);
    Imf::MultiPartInputFile file(stream, /*numThreads=*/0);
    const Status status = CheckExrHeader(file.header(0), limits);
    if (!status.ok()) return ErrorBytes(status.message());
    Imf::InputPart first(file, 0);
    return ReadPicture(first, file.parts());
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    return ErrorBytes(error.what());
  }
}

}  // namespace

Result<Bytes> EncodeExr(const ExrImage& image) {
  TILEGRAD_TRY(Check(image));
  ExrStream stream;
  try {  // the library throws
    Write(image, stream);
  } catch (const std::exception& error) {
    return InternalError("encoding an EXR of {} x {}: {}", image.width, image.height, error.what());
  }
  return std::move(stream.bytes);
}

Status SaveExr(const Path& path, const ExrImage& image) {
  TILEGRAD_ASSIGN(const Bytes bytes, EncodeExr(image));
  return WriteFileAtomic(path, bytes);
}

Result<LoadedExr> ExrFromReader(std::span<const std::uint8_t> bytes) {
  const Status damaged = DataLoss("the reader returned an incomplete image");
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.size() > 1 && text[0] == static_cast<char>(kError))
    return DataLoss("{}", text.substr(1));
  std::array<std::int32_t, 4> sizes = {};
  std::size_t at = 1 + sizeof(sizes);
  if (bytes.size() < at || bytes[0] != kImage) return damaged;
  std::memcpy(sizes.data(), bytes.data() + 1, sizeof(sizes));
  LoadedExr out;
  out.width = sizes[0];
  out.height = sizes[1];
  if (out.width < 1 || out.height < 1 || std::max(out.width, out.height) > kMaxImageSide ||
      sizes[2] < 1 || sizes[2] > kMaxChannels || sizes[3] < 0 || sizes[3] > kMaxWarnings)
    return damaged;
  for (int i = 0; i < sizes[2] + sizes[3]; ++i) {
    const std::size_t end = text.find('\0', at);
    if (end == std::string_view::npos) return damaged;
    (i < sizes[2] ? out.names : out.warnings).emplace_back(text.substr(at, end - at));
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
