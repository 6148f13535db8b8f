// SPDX-License-Identifier: Apache-2.0
// MATLAB's files of version 5, written here byte by byte from the published layout, then damaged.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "base/read_budget.h"
#include "io/mat_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io::mat_test {

void Put(Bytes& out, std::uint32_t value, int bytes = 4) {
  for (int i = 0; i < bytes; ++i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}
void PutText(Bytes& out, const std::string& text, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    out.push_back(i < text.size() ? static_cast<std::uint8_t>(text[i]) : 0);
}

Bytes Header() {
  Bytes out;
  PutText(out, "MATLAB 5.0 MAT-file, by hand", 124);
  Put(out, 0x0100, 2);
  PutText(out, "IM", 2);
  return out;
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// A data element with its padding.
Bytes Element(std::uint32_t type, const Bytes& data) {
  Bytes out;
  Put(out, type);
  Put(out, static_cast<std::uint32_t>(data.size()));
  out = out + data;
  out.resize((out.size() + 7) / 8 * 8);
  return out;
}
// The short form: at most four bytes in the tag.
Bytes Small(std::uint32_t type, const Bytes& data) {
  Bytes out;
  Put(out, type | static_cast<std::uint32_t>(data.size()) << 16);
  out = out + data;
  out.resize(8);
  return out;
}
Bytes Words(std::initializer_list<std::uint32_t> words) {
  Bytes out;
  for (const std::uint32_t w : words) Put(out, w);
  return out;
}
Bytes TextBytes(const std::string& text) { return {text.begin(), text.end()}; }

Bytes Matrix(std::uint32_t flags, std::initializer_list<std::uint32_t> dims,
             const std::string& name, const Bytes& content) {
  return Element(14, Element(6, Words({flags, 0})) + Element(5, Words(dims)) +
                         Element(1, TextBytes(name)) + content);
}

Bytes Packed(const Bytes& bytes) {
  uLongf size = compressBound(bytes.size());
  Bytes data(size), out;
  EXPECT_EQ(compress(data.data(), &size, bytes.data(), bytes.size()), Z_OK);
  data.resize(size);
  Put(out, 15);
  Put(out, static_cast<std::uint32_t>(size));
  return out + data;
}

// {rel_path: 'a/b.jpg' in 16-bit characters, parts: 3 x 2 doubles kept as bytes, mask: 2 x 3
// logical}.
Bytes BirdStruct() {
  Bytes path;
  for (const char c : std::string("a/b.jpg")) Put(path, static_cast<std::uint32_t>(c), 2);
  Bytes names;
  for (const char* name : {"rel_path", "parts", "mask"}) PutText(names, name, 16);
  return Matrix(2, {1, 1}, "images",
                Small(5, Words({16})) + Element(1, names) +
                    Matrix(4, {1, 7}, "", Element(17, path)) +
                    Matrix(6, {3, 2}, "", Element(2, {10, 20, 1, 30, 40, 0})) +
                    Matrix(9 | 0x200, {2, 3}, "", Element(2, {1, 0, 0, 1, 1, 1})));
}

// The double 1.5 as its bytes.
Bytes OneAndAHalf() {
  Bytes out(8);
  const double value = 1.5;
  std::memcpy(out.data(), &value, 8);
  return out;
}

void ExpectBird(const Bytes& file) {
  const auto mat = Ok(ReadMat(file, "birds.mat"));
  const auto images = MatPlace::Variable(*mat, "images");
  ASSERT_TRUE(images.ok());
  EXPECT_EQ(images->Field(0, "rel_path")->Text().value(), "a/b.jpg");
  EXPECT_EQ(images->Field(0, "parts")->Numbers(6).value(),
            (std::vector<double>{10, 20, 1, 30, 40, 0}));
  const auto mask = images->Field(0, "mask");
  EXPECT_TRUE(mask->ExpectSize(2, 3).ok());
  EXPECT_TRUE(mask->array().logical);
  EXPECT_EQ(mask->Numbers(6).value(), (std::vector<double>{1, 0, 0, 1, 1, 1}));
}

TEST(Mat, ReadsWhatTheLayoutSays) { ExpectBird(Header() + BirdStruct()); }
TEST(Mat, ReadsPackedVariables) { ExpectBird(Header() + Packed(BirdStruct())); }

TEST(Mat, ReadsEveryKindOfNumber) {
  const Bytes cells =
      Matrix(1, {1, 4}, "all",
             Matrix(6, {1, 1}, "", Element(9, OneAndAHalf())) +
                 Matrix(6, {1, 2}, "", Small(3, {0xFF, 0xFF, 2, 0})) +
                 Matrix(12, {1, 1}, "", Small(5, Words({0xFFFFFFFE}))) + Element(14, {}));
  const auto mat = Ok(ReadMat(Header() + cells, "all.mat"));
  const MatArray& all = mat->variables[0].second;
  ASSERT_EQ(all.elements.size(), 4u);
  EXPECT_EQ(all.elements[0].numbers[0], 1.5);
  EXPECT_EQ(all.elements[1].numbers[0], -1);
  EXPECT_EQ(all.elements[1].numbers[1], 2);
  EXPECT_EQ(all.elements[2].numbers[0], -2);
  EXPECT_EQ(all.elements[3].numbers.size(), 0u);
}

MatVariables Birds() {
  std::vector<MatArray> elements;
  for (int i = 0; i < 3; ++i) {
    elements.push_back(MatArray::Text("bird" + std::to_string(i) + ".jpg"));
    elements.push_back(MatArray::Mask(2, 2, {1, 0, 1, static_cast<std::uint8_t>(i == 1)}));
    elements.push_back(
        MatArray::Structs({"x1", "y1"}, {MatArray::Number(i + 0.25), MatArray::Number(2)}));
  }
  return {{"images", MatArray::Structs({"rel_path", "mask", "bbox"}, std::move(elements))},
          {"S", MatArray::Numbers({3, 1}, std::vector<double>{0.5, -1, 1e-300})}};
}

TEST(Mat, WritesWhatItReads) {
  for (const MatPacking packing : {MatPacking::kPlain, MatPacking::kCompressed}) {
    const auto mat = Ok(ReadMat(EncodeMat(Birds(), packing), "b.mat"));
    const auto images = MatPlace::Variable(*mat, "images");
    EXPECT_EQ(images->places(), 3u);
    EXPECT_EQ(images->Field(2, "rel_path")->Text().value(), "bird2.jpg");
    EXPECT_EQ(images->Field(1, "bbox")->Field(0, "x1")->Number().value(), 1.25);
    EXPECT_EQ(images->Field(1, "mask")->Numbers(4).value(), (std::vector<double>{1, 0, 1, 1}));
    EXPECT_EQ(MatPlace::Variable(*mat, "S")->Numbers(3).value()[2], 1e-300);
  }
}

// Byte for byte: one variable of one number, as the format's description has it.
TEST(Mat, WritesTheBytesOfTheLayout) {
  Bytes want = Matrix(6, {1, 1}, "x", Element(9, OneAndAHalf()));
  Bytes file = EncodeMat({{"x", MatArray::Number(1.5)}}, MatPacking::kPlain);
  ASSERT_EQ(file.size(), 128 + want.size());
  EXPECT_TRUE(std::equal(want.begin(), want.end(), file.begin() + 128));
  EXPECT_EQ(std::string(file.begin() + 126, file.begin() + 128), "IM");
}

TEST(Mat, ErrorsNameFileAndPlace) {
  const auto mat = Ok(ReadMat(EncodeMat(Birds()), "b.mat"));
  ExpectMessage(MatPlace::Variable(*mat, "sfm_anno").status(), "b.mat", "\"sfm_anno\"",
                "images, S");
  const auto images = MatPlace::Variable(*mat, "images");
  ExpectMessage(images->Field(0, "parts").status(), "b.mat: images", "\"parts\"");
  ExpectMessage(images->Field(3, "bbox").status(), "3 elements", "element 4");
  ExpectMessage(images->Field(1, "bbox")->Numbers(4).status(), "images(2).bbox", "a struct");
  ExpectMessage(images->Field(1, "mask")->Numbers(9).status(), "images(2).mask",
                "expected 9 numbers, got 4");
  ExpectMessage(images->Field(1, "mask")->ExpectSize(3, 2), "expected 3 x 2", "2 x 2");
  ExpectMessage(images->Field(1, "mask")->Text().status(), "expected text");
}

TEST(Mat, RefusesOtherFiles) {
  Bytes old(200, 0), hdf = Header(), big = Header();
  hdf[125] = 2;
  big[126] = 'M';
  big[127] = 'I';
  ExpectMessage(ReadMat(old, "v4.mat").status(), "v4.mat", "version 5");
  ExpectMessage(ReadMat(hdf, "new.mat").status(), "7.3", "-v7");
  ExpectMessage(ReadMat(big, "sun.mat").status(), "big-endian");
  ExpectMessage(ReadMat(Bytes{1, 2}, "short.mat").status(), "2 bytes");
  ExpectMessage(LoadMat("/no/such.mat").status(), "/no/such.mat");
}

TEST(Mat, RefusesWhatIsNotFinishedOrTooLarge) {
  const Bytes whole = Header() + BirdStruct();
  for (std::size_t size = 129; size < whole.size(); size += 3)
    EXPECT_FALSE(ReadMat(std::span(whole).first(size), "cut.mat").ok()) << size;
  Bytes numbers = Matrix(6, {3, 3}, "m", Element(9, OneAndAHalf()));
  ExpectMessage(ReadMat(Header() + numbers, "few.mat").status(), "few.mat: m", "9 numbers");
  Bytes huge = Matrix(6, {0x7FFFFFFF, 0x7FFFFFFF}, "m", {});
  ExpectMessage(ReadMat(Header() + huge, "huge.mat").status(), "too large");
  Bytes complex_numbers = Matrix(6 | 0x800, {1, 1}, "c", Element(9, OneAndAHalf()));
  ExpectMessage(ReadMat(Header() + complex_numbers, "c.mat").status(), "complex");
  Bytes nested = Matrix(6, {1, 1}, "", Element(9, OneAndAHalf()));
  for (int i = 0; i < 20; ++i) nested = Matrix(1, {1, 1}, "", nested);
  ExpectMessage(ReadMat(Header() + nested, "deep.mat").status(), "16 deep");
}

// A hundred kilobytes that unpack to a hundred megabytes are not unpacked beyond what is allowed.
TEST(Mat, AsksBeforeItUnpacks) {
  const Bytes zeros = Matrix(9, {10000, 10000}, "z", Element(2, Bytes(100'000'000, 0)));
  const Bytes file = Header() + Packed(zeros);
  EXPECT_LT(file.size(), 200'000u);
  const ReadBudget budget(8 << 20);
  ExpectMessage(ReadMat(file, "bomb.mat").status(), "bomb.mat");
}

}  // namespace tilegrad::io::mat_test
