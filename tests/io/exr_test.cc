// SPDX-License-Identifier: Apache-2.0
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/exr_file.h"
#include "support/temp_folder.h"

namespace tilegrad::exr_test {

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

TEST_F(Exr, ComesBackAsItWas) {
  const std::vector<float> r = {1, -2.5f, 1e30f, 0, 1e-40f, 7},
                           z = {std::numeric_limits<float>::infinity(), 1, 2, 3, 4, 5};
  const Path file = folder_ / "a.exr";
  ASSERT_TRUE(io::SaveExr(file, {3, 2, {{"Z", z}, {"R", r}}}).ok());
  const auto image = io::LoadExr(file);
  ASSERT_TRUE(image.ok()) << image.status().message();
  EXPECT_EQ(image->width, 3);
  EXPECT_EQ(image->height, 2);
  ASSERT_EQ(image->names, (std::vector<std::string>{"R", "Z"}));
  EXPECT_TRUE(std::equal(r.begin(), r.end(), image->values.begin()));
  EXPECT_TRUE(std::equal(z.begin(), z.end(), image->values.begin() + 6));
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
  for (std::size_t at = 4; at < 400; at += 7) {  // an image or an error, whatever the header says
    Bytes bent = whole;
    bent[at] ^= 0xff;
    const auto image = io::DecodeExr(bent, "a.exr");
    if (image.ok()) {
      EXPECT_EQ(image->values.size(), image->names.size() * static_cast<std::size_t>(image->width) *
                                          static_cast<std::size_t>(image->height));
    } else {
      ExpectMessage(image.status(), "a.exr");
    }
  }
}

}  // namespace tilegrad::exr_test
