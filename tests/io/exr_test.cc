// SPDX-License-Identifier: Apache-2.0
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <gtest/gtest.h>

#include <limits>

#include "io/exr_file.h"
#include "support/temp_folder.h"

namespace tilegrad {
namespace {

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

}  // namespace
}  // namespace tilegrad
