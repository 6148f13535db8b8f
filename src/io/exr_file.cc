// SPDX-License-Identifier: Apache-2.0
#include "io/exr_file.h"

#include <cstring>
#include <exception>

#include "base/error.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
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

// The library would cut the name there, and of two that then agree lose one.
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
    // The library takes what it reads from as writable.
    frame.insert(
        c.name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(c.values.data())),
                           sizeof(float), sizeof(float) * static_cast<std::size_t>(image.width)));
  }
  Imf::OutputFile file(stream, header);
  file.setFrameBuffer(frame);
  file.writePixels(image.height);
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

}  // namespace tilegrad::io
