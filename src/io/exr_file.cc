// SPDX-License-Identifier: Apache-2.0
#include "io/exr_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>

#include "base/error.h"
#include "base/read_budget.h"
#include "io/child_record.h"
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

template <>
inline constexpr auto kFieldsOf<LoadedExr> = std::tuple(&LoadedExr::width, &LoadedExr::height,
                                                        &LoadedExr::names, &LoadedExr::values,
                                                        &LoadedExr::warnings);

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

constexpr int kMaxChannels = 1024, kMaxWarnings = 2;

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

// Copies one channel of the data window into the display window.
void PlaceInPicture(const float* data, const ExrWindow& from, const ExrWindow& to, float* picture) {
  const auto at = [](const ExrWindow& window, std::int64_t x, std::int64_t y) {
    return (y - window.min.y) * SizeOfWindow(window).width + (x - window.min.x);
  };
  const int left = std::max(from.min.x, to.min.x), right = std::min(from.max.x, to.max.x);
  if (left > right) return;
  for (std::int64_t y = std::max(from.min.y, to.min.y); y <= std::min(from.max.y, to.max.y); ++y)
    std::copy_n(data + at(from, left, y), right - left + 1, picture + at(to, left, y));
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

LoadedExr ReadPicture(Imf::InputPart& in, int parts) {
  const ExrWindow &data_window = in.header().dataWindow(), &display = in.header().displayWindow();
  const auto [width, height] = SizeOfWindow(display);
  LoadedExr out{static_cast<int>(width),
                static_cast<int>(height),
                NamesOf(in.header().channels()),
                {},
                ExrWarnings(in.header(), parts)};
  const std::vector<float> data = ReadData(in, out.names);
  const auto plane = static_cast<std::size_t>(width * height);
  const std::size_t data_pixels = data.size() / out.names.size();
  out.values.resize(out.names.size() * plane);
  for (std::size_t c = 0; c < out.names.size(); ++c)
    PlaceInPicture(&data[c * data_pixels], data_window, display, &out.values[c * plane]);
  return out;
}

// Runs in the child process.
Result<LoadedExr> ReadInChild(std::span<const std::uint8_t> bytes, const GuardLimits& limits) {
  try {  // the library throws
    MemoryInput stream(bytes);
    Imf::MultiPartInputFile file(stream, /*numThreads=*/0);
    TILEGRAD_TRY(CheckExrHeader(file.header(0), limits));
    Imf::InputPart first(file, 0);
    return ReadPicture(first, file.parts());
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    return DataLoss("{}", error.what());
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

Bytes ExrForReader(const Result<LoadedExr>& image) { return EncodeRecord(image); }

Result<LoadedExr> ExrFromReader(std::span<const std::uint8_t> bytes) {
  TILEGRAD_TRY(ReadBudget::Take(bytes.size(), "the image"));
  TILEGRAD_ASSIGN(LoadedExr out, DecodeRecord<LoadedExr>(bytes));
  const auto is_side = [](int side) { return side >= 1 && side <= kMaxImageSide; };
  if (!is_side(out.width) || !is_side(out.height) || out.names.empty() ||
      out.names.size() > kMaxChannels || out.warnings.size() > kMaxWarnings ||
      out.values.size() != static_cast<std::size_t>(out.width) *
                               static_cast<std::size_t>(out.height) * out.names.size())
    return DataLoss("the reader returned an incomplete image");
  return out;
}

Result<LoadedExr> DecodeExr(std::span<const std::uint8_t> bytes, const std::string& name) {
  constexpr std::array<std::uint8_t, 4> kMagic = {0x76, 0x2f, 0x31, 0x01};
  if (bytes.size() < kMagic.size() || !std::equal(kMagic.begin(), kMagic.end(), bytes.begin()))
    return DataLoss("{}: not an EXR image", name);
  GuardLimits limits;
  limits.memory_bytes = std::size_t{4} << 30;
  const auto result =
      RunGuarded([&](AskParent) { return ExrForReader(ReadInChild(bytes, limits)); },
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
