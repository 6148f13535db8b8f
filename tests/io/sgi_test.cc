// SPDX-License-Identifier: Apache-2.0
// SGI images, written here byte by byte from the format's description.
#include <gtest/gtest.h>

#include "io/image_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::sgi_test {

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

TEST(Sgi, HeadersThatLie) {
  const auto with = [](std::size_t at, int value) {
    Bytes file = Encoded({});
    file[at] = static_cast<std::uint8_t>(value);
    return DecodeImage(file, "a.rgb").status();
  };
  ExpectMessage(with(2, 2), "a.rgb", "storage 2");
  ExpectMessage(with(3, 3), "a.rgb", "3 bytes a sample");
  ExpectMessage(with(5, 4), "a.rgb", "4 dimensions");
  ExpectMessage(with(107, 3), "a.rgb", "palette");
  ExpectMessage(with(11, 5), "a.rgb", "5 channels");
  ExpectMessage(with(7, 0), "a.rgb", "0 x 2 pixels");
  ExpectMessage(with(6, 255), "a.rgb", "65283 x 2 pixels");
  ExpectMessage(with(8, 64), "a.rgb", "16386");
  ExpectMessage(with(8, 63), "a.rgb", "of row tables");
  Bytes large = Header({.width = 16384, .height = 16384, .channels = 4}, 0);
  ExpectMessage(DecodeImage(large, "a.rgb").status(), "a.rgb", "truncated");
}

TEST(Sgi, RowsThatDoNotFit) {
  const Picture p;
  const std::size_t tables = 512, rows = 512 + 8 * p.Rows();
  const auto with = [](std::size_t at, int value) {
    Bytes file = Encoded({});
    file[at] = static_cast<std::uint8_t>(value);
    return DecodeImage(file, "a.rgb").status();
  };
  ExpectMessage(with(tables, 1), "a.rgb", "row 0 of channel 0", "beyond the end");
  ExpectMessage(with(tables + 4 * p.Rows() + 5, 1), "a.rgb", "row 1 of channel 0",
                "beyond the end");
  ExpectMessage(with(rows, 4), "a.rgb", "longer than the picture is wide");
  ExpectMessage(with(rows, 0), "a.rgb", "shorter than the picture is wide");
  ExpectMessage(with(tables + 4 * p.Rows() + 3, 3), "a.rgb", "ends within a run");
}

}  // namespace tilegrad::io::sgi_test
