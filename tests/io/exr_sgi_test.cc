// SPDX-License-Identifier: Apache-2.0
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/exr_file.h"
#include "io/image_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::exr_sgi_test {

class Exr : public TempFolderTest {};

TEST_F(Exr, KeepsEveryBitAndTheRowOnTop) {
  const std::vector<float> r = {1, -2.5f, 1e30f, 0, 1e-40f, 7},
                           z = {std::numeric_limits<float>::infinity(), 1, 2, 3, 4, 5};
  const Path file = folder_ / "a.exr";
  ASSERT_TRUE(io::SaveExr(file, {3, 2, {{"R", r}, {"normal.X", z}}}).ok());
  Imf::InputFile in(file.c_str());
  ASSERT_EQ(in.header().dataWindow().max.x, 2);
  ASSERT_EQ(in.header().dataWindow().max.y, 1);
  std::vector<float> got_r(6), got_z(6);
  Imf::FrameBuffer frame;
  const auto slice = [](std::vector<float>& v) {
    return Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(v.data()), 4, 12);
  };
  frame.insert("R", slice(got_r));
  frame.insert("normal.X", slice(got_z));
  in.setFrameBuffer(frame);
  in.readPixels(0, 1);
  EXPECT_EQ(got_r, r);
  EXPECT_EQ(got_z, z);
}

TEST_F(Exr, WhatIsNoImageIsRefused) {
  const std::vector<float> six(6);
  EXPECT_FALSE(io::EncodeExr({0, 2, {{"R", {}}}}).ok());
  EXPECT_FALSE(io::EncodeExr({3, 2, {}}).ok());
  ExpectMessage(io::EncodeExr({2, 2, {{"R", six}}}).status(), "6 values");
  ExpectMessage(io::EncodeExr({3, 2, {{"R", six}, {"R", six}}}).status(), "twice");
}

TEST_F(Exr, DamagedFilesAreErrors) {
  std::vector<float> values(64 * 64);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::sin(0.37f * float(i * i));
  const Bytes whole = io::EncodeExr({64, 64, {{"R", values}}}).value();
  EXPECT_TRUE(io::DecodeExr(whole, "a.exr").ok());
  ExpectMessage(io::DecodeExr(Bytes{1, 2, 3}, "a.exr").status(), "a.exr: not an EXR");
  ExpectMessage(io::LoadExr(folder_ / "none.exr").status(), "none.exr");
  for (std::size_t size = 4; size < whole.size(); size += whole.size() / 23) {
    const auto cut = io::DecodeExr(std::span(whole).first(size), "a.exr");
    ASSERT_FALSE(cut.ok()) << size;
    ExpectMessage(cut.status(), "a.exr: reading an EXR image");
  }
}

// --- windows: the picture is the display window, wherever the data lies ---

using ExrWindow = Imath::Box2i;

ExrWindow WindowFrom(int left, int top, int right, int bottom) {
  return {Imath::V2i(left, top), Imath::V2i(right, bottom)};
}

// What a channel has at a place of the plane that windows lie in; never 0.
float Truth(int x, int y, char channel) {
  return static_cast<float>(1000 * x + 10 * y + (channel == 'R' ? 1 : 2));
}

// The data window's numbers of a channel.
std::vector<float> DataOf(const ExrWindow& window, char channel) {
  std::vector<float> values;
  for (int y = window.min.y; y <= window.max.y; ++y) {
    for (int x = window.min.x; x <= window.max.x; ++x) values.push_back(Truth(x, y, channel));
  }
  return values;
}

// As another program writes it.
void WriteWindows(const Path& file, const ExrWindow& display, const ExrWindow& data) {
  Imf::Header header(display, data);
  const std::vector<float> r = DataOf(data, 'R'), g = DataOf(data, 'G');
  const std::size_t row = sizeof(float) * (static_cast<std::size_t>(data.max.x - data.min.x) + 1);
  Imf::FrameBuffer frame;
  for (const auto& [name, values] : {std::pair("R", &r), std::pair("G", &g)}) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    frame.insert(name, Imf::Slice::Make(Imf::FLOAT, values->data(), data, sizeof(float), row));
  }
  Imf::OutputFile out(file.c_str(), header);
  out.setFrameBuffer(frame);
  out.writePixels(data.max.y - data.min.y + 1);
}

void ExpectWindow(const io::LoadedExr& image, const ExrWindow& display, const ExrWindow& data) {
  ASSERT_EQ(image.width, display.max.x - display.min.x + 1);
  ASSERT_EQ(image.height, display.max.y - display.min.y + 1);
  ASSERT_EQ(image.names, (std::vector<std::string>{"G", "R"}));
  std::size_t at = 0;
  for (const char channel : {'G', 'R'}) {
    for (int y = display.min.y; y <= display.max.y; ++y) {
      for (int x = display.min.x; x <= display.max.x; ++x) {
        const float want = data.intersects(Imath::V2i(x, y)) ? Truth(x, y, channel) : 0;
        ASSERT_EQ(image.values[at++], want) << channel << " at " << x << ", " << y;
      }
    }
  }
}

TEST_F(Exr, TheDisplayWindowIsThePicture) {
  struct Case {
    ExrWindow display, data;
    bool outside = false;
  };
  const Path file = folder_ / "w.exr";
  for (const Case& c : std::vector<Case>{
           {WindowFrom(0, 0, 7, 5), WindowFrom(0, 0, 7, 5)},            // the same
           {WindowFrom(0, 0, 7, 5), WindowFrom(4, 1, 6, 2)},            // within
           {WindowFrom(10, 20, 17, 25), WindowFrom(10, 20, 17, 25)},    // the same, elsewhere
           {WindowFrom(-8, -6, -1, -1), WindowFrom(-5, -6, -3, -2)},    // negative
           {WindowFrom(-2, -2, 3, 3), WindowFrom(0, 0, 3, 1)},          // to its corner
           {WindowFrom(0, 0, 3, 2), WindowFrom(-2, -1, 5, 4), true},    // beyond it on all sides
           {WindowFrom(0, 0, 3, 2), WindowFrom(2, 1, 8, 1), true},      // beyond one
           {WindowFrom(0, 0, 3, 2), WindowFrom(1, -3, 1, 9), true},     // a column through it
           {WindowFrom(0, 0, 3, 2), WindowFrom(20, 20, 22, 21), true},  // apart
           {WindowFrom(0, 0, 0, 0), WindowFrom(-1000000, -9, -999999, -8), true}}) {
    SCOPED_TRACE(c.data.min.x);
    WriteWindows(file, c.display, c.data);
    const auto image = Ok(io::LoadExr(file));
    ExpectWindow(*image, c.display, c.data);
    EXPECT_EQ(image->warnings.size(), c.outside ? 1u : 0u);
  }
  WriteWindows(file, WindowFrom(0, 0, 3, 2), WindowFrom(-2, -1, 5, 4));
  EXPECT_EQ(
      io::LoadExr(file)->warnings.at(0),
      "data outside the display window left out: (-2, -1) to (5, 4), outside (0, 0) to (3, 2)");
}

TEST_F(Exr, WindowsHaveLimits) {
  const Path file = folder_ / "w.exr";
  WriteWindows(file, WindowFrom(0, 0, 100'000'000, 1), WindowFrom(0, 0, 1, 1));
  ExpectMessage(io::LoadExr(file).status(), "w.exr", "100000001 x 2 pixels");
  WriteWindows(file, WindowFrom(0, 0, 16383, 16383), WindowFrom(0, 0, 1, 1));  // 2 GiB of zeros
  ExpectMessage(io::LoadExr(file).status(), "w.exr");
}

TEST_F(Exr, OtherPartsAreSaid) {
  const Path file = folder_ / "p.exr";
  std::vector<Imf::Header> headers(2, Imf::Header(3, 2));
  const ExrWindow window = WindowFrom(0, 0, 2, 1);
  const std::vector<float> left = DataOf(window, 'R'), right(6, 9.0f);
  for (std::size_t p = 0; p < 2; ++p) {
    headers[p].setName(p == 0 ? "left" : "right");
    headers[p].setType(Imf::SCANLINEIMAGE);
    headers[p].channels().insert("R", Imf::Channel(Imf::FLOAT));
  }
  {
    Imf::MultiPartOutputFile out(file.c_str(), headers.data(), 2);
    for (int p = 0; p < 2; ++p) {
      Imf::FrameBuffer frame;
      frame.insert("R", Imf::Slice::Make(Imf::FLOAT, (p == 0 ? left : right).data(), window,
                                         sizeof(float), 3 * sizeof(float)));
      Imf::OutputPart part(out, p);
      part.setFrameBuffer(frame);
      part.writePixels(2);
    }
  }
  const auto image = Ok(io::LoadExr(file));
  EXPECT_EQ(image->values, left);
  ASSERT_EQ(image->warnings.size(), 1u);
  EXPECT_EQ(image->warnings[0], "2 parts; the first is read");
}

// SGI images, written here byte by byte from the format's description.

void PutBig(Bytes& out, std::uint32_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

struct Picture {
  int width = 3, height = 2, channels = 3;
  int sample_bytes = 1;
  int dimensions = 3;

  // A number for each sample that no other has in its low byte.
  std::uint32_t Sample(int x, int y, int c) const {
    const auto n = static_cast<std::uint32_t>((y * width + x) * channels + c + 1);
    return sample_bytes == 1 ? n : n * 257;
  }
  std::size_t Rows() const { return static_cast<std::size_t>(height * channels); }
};

Bytes Header(const Picture& p, int storage) {
  Bytes out;
  PutBig(out, 474, 2);
  out.push_back(static_cast<std::uint8_t>(storage));
  out.push_back(static_cast<std::uint8_t>(p.sample_bytes));
  for (const int v : {p.dimensions, p.width, p.height, p.channels})
    PutBig(out, static_cast<std::uint32_t>(v), 2);
  out.resize(512, 0);
  return out;
}

// Rows channel by channel, from the bottom up.
template <class Visit>
void ForRows(const Picture& p, Visit visit) {
  for (int c = 0; c < p.channels; ++c) {
    for (int y = p.height - 1; y >= 0; --y) visit(y, c);
  }
}

Bytes Plain(const Picture& p) {
  Bytes out = Header(p, 0);
  ForRows(p, [&](int y, int c) {
    for (int x = 0; x < p.width; ++x) PutBig(out, p.Sample(x, y, c), p.sample_bytes);
  });
  return out;
}

// The first sample as a run of one, the others as they are, and the end.
Bytes Encoded(const Picture& p) {
  Bytes out = Header(p, 1), rows;
  std::vector<std::size_t> starts;
  const std::size_t base = out.size() + 8 * p.Rows();
  ForRows(p, [&](int y, int c) {
    starts.push_back(base + rows.size());
    PutBig(rows, 1, p.sample_bytes);
    PutBig(rows, p.Sample(0, y, c), p.sample_bytes);
    PutBig(rows, 0x80u | static_cast<std::uint32_t>(p.width - 1), p.sample_bytes);
    for (int x = 1; x < p.width; ++x) PutBig(rows, p.Sample(x, y, c), p.sample_bytes);
    PutBig(rows, 0, p.sample_bytes);
  });
  starts.push_back(base + rows.size());
  for (std::size_t i = 0; i < p.Rows(); ++i) PutBig(out, static_cast<std::uint32_t>(starts[i]), 4);
  for (std::size_t i = 0; i < p.Rows(); ++i)
    PutBig(out, static_cast<std::uint32_t>(starts[i + 1] - starts[i]), 4);
  out.insert(out.end(), rows.begin(), rows.end());
  return out;
}

void ExpectPicture(const Bytes& file, const Picture& p) {
  const auto image = Ok(DecodeImage(file, "a.rgb"));
  ASSERT_EQ(image->width, p.width);
  ASSERT_EQ(image->height, p.height);
  ASSERT_EQ(image->channels, p.channels);
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      for (int c = 0; c < p.channels; ++c) EXPECT_EQ(image->at(x, y)[c], p.Sample(x, y, c) & 0xff);
    }
  }
}

TEST(Sgi, EveryNumberOfChannelsAndBits) {
  for (int channels = 1; channels <= 4; ++channels) {
    for (const int sample_bytes : {1, 2}) {
      const Picture p{.channels = channels, .sample_bytes = sample_bytes};
      SCOPED_TRACE(testing::Message() << channels << " channels of " << sample_bytes << " bytes");
      for (Bytes file : {Plain(p), Encoded(p)}) {
        ExpectPicture(file, p);
        file.pop_back();
        ExpectCutsRefused(file, "cut.rgb",
                          [](const Bytes& cut) { return DecodeImage(cut, "cut.rgb").status(); });
      }
    }
  }
}

TEST(Sgi, OneAndTwoDimensionsAreARowAndGrey) {
  Picture row{.height = 1, .channels = 1, .dimensions = 1};
  Bytes file = Plain(row);
  file[9] = file[11] = 77;  // sizes that a row does not have
  ExpectPicture(file, row);
  const Picture grey{.channels = 1, .dimensions = 2};
  file = Encoded(grey);
  file[11] = 77;
  ExpectPicture(file, grey);
}

TEST(Sgi, RunsRepeatAndSixteenBitsAreRounded) {
  const Picture p{.width = 100, .height = 1, .channels = 1, .sample_bytes = 2, .dimensions = 2};
  Bytes file = Header(p, 1);
  PutBig(file, 520, 4);
  PutBig(file, 6, 4);
  PutBig(file, 100, 2);
  PutBig(file, 0x0180, 2);  // 384 * 255 / 65535 = 1.49
  PutBig(file, 0, 2);
  const auto image = Ok(DecodeImage(file, "a.rgb"));
  EXPECT_EQ(image->pixels, Bytes(100, 1));
}

// Of a file with another byte.
Status With(std::size_t at, int value) {
  Bytes file = Encoded({});
  file[at] = static_cast<std::uint8_t>(value);
  return DecodeImage(file, "a.rgb").status();
}

TEST(Sgi, HeadersThatLie) {
  ExpectMessage(With(2, 2), "a.rgb", "storage 2");
  ExpectMessage(With(3, 3), "a.rgb", "3 bytes a sample");
  ExpectMessage(With(5, 4), "a.rgb", "4 dimensions");
  ExpectMessage(With(107, 3), "a.rgb", "palette");
  ExpectMessage(With(11, 5), "a.rgb", "5 channels");
  ExpectMessage(With(7, 0), "a.rgb", "0 x 2 pixels");
  ExpectMessage(With(6, 255), "a.rgb", "65283 x 2 pixels");
  ExpectMessage(With(8, 64), "a.rgb", "16386");
  ExpectMessage(With(8, 63), "a.rgb", "of row tables");
  Bytes large = Header({.width = 16384, .height = 16384, .channels = 4}, 0);
  ExpectMessage(DecodeImage(large, "a.rgb").status(), "a.rgb", "truncated");
}

TEST(Sgi, RowsThatDoNotFit) {
  const Picture p;
  const std::size_t tables = 512, rows = 512 + 8 * p.Rows();
  ExpectMessage(With(tables, 1), "a.rgb", "row 0 of channel 0", "beyond the end");
  ExpectMessage(With(tables + 4 * p.Rows() + 5, 1), "a.rgb", "row 1 of channel 0",
                "beyond the end");
  ExpectMessage(With(rows, 4), "a.rgb", "longer than the picture is wide");
  ExpectMessage(With(rows, 0), "a.rgb", "shorter than the picture is wide");
  ExpectMessage(With(tables + 4 * p.Rows() + 3, 3), "a.rgb", "ends within a run");
}

}  // namespace tilegrad::io::exr_sgi_test
