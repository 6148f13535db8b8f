// SPDX-License-Identifier: Apache-2.0
// MATLAB's files of version 5, written here byte by byte from the published layout, then damaged;
// and of version 7.3, by the library's own writer.
#include <gtest/gtest.h>
#include <matio.h>
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

class Mat : public TempFolderTest {
 protected:
  Result<MatFile> Read(const std::string& name, const Bytes& bytes) const {
    return LoadMat(Write(name, bytes));
  }

  void ExpectBird(const Path& path) const {
    const auto mat = Ok(LoadMat(path));
    const auto images = Ok(MatPlace::Variable(*mat, "images"));
    EXPECT_EQ(images->Field(0, "rel_path")->Text().value(), "a/b.jpg");
    EXPECT_EQ(images->Field(0, "parts")->Numbers(6).value(),
              (std::vector<double>{10, 20, 1, 30, 40, 0}));
    const auto mask = images->Field(0, "mask");
    EXPECT_TRUE(mask->ExpectSize(2, 3).ok());
    EXPECT_EQ(mask->array().logical, 1);
    EXPECT_EQ(mask->Numbers(6).value(), (std::vector<double>{1, 0, 0, 1, 1, 1}));
  }
};

TEST_F(Mat, ReadsWhatTheLayoutSays) { ExpectBird(Write("a.mat", Header() + BirdStruct())); }
TEST_F(Mat, ReadsPackedVariables) { ExpectBird(Write("a.mat", Header() + Packed(BirdStruct()))); }

// HDF5, as `save -v7.3` writes it.
TEST_F(Mat, ReadsVersion73) {
  const Path path = folder_ / "new.mat";
  mat_t* const file = Mat_CreateVer(path.c_str(), nullptr, MAT_FT_MAT73);
  ASSERT_NE(file, nullptr);
  const char* names[] = {"rel_path", "parts", "mask"};
  std::size_t one[] = {1, 1}, letters[] = {1, 7}, parts[] = {3, 2}, rows[] = {2, 3};
  std::uint16_t text[] = {'a', '/', 'b', '.', 'j', 'p', 'g'};
  double places[] = {10, 20, 1, 30, 40, 0};
  std::uint8_t mask[] = {1, 0, 0, 1, 1, 1};
  matvar_t* const images = Mat_VarCreateStruct("images", 2, one, names, 3);
  matvar_t* const fields[] = {
      Mat_VarCreate(names[0], MAT_C_CHAR, MAT_T_UINT16, 2, letters, text, 0),
      Mat_VarCreate(names[1], MAT_C_DOUBLE, MAT_T_DOUBLE, 2, parts, places, 0),
      Mat_VarCreate(names[2], MAT_C_UINT8, MAT_T_UINT8, 2, rows, mask, MAT_F_LOGICAL)};
  for (std::size_t i = 0; i < 3; ++i) Mat_VarSetStructFieldByIndex(images, i, 0, fields[i]);
  EXPECT_EQ(Mat_VarWrite(file, images, MAT_COMPRESSION_NONE), 0);
  Mat_VarFree(images);
  Mat_Close(file);
  ExpectBird(path);
  const Bytes whole = ReadFile(path).value();
  for (std::size_t size = 600; size < whole.size(); size += whole.size() / 7)
    ExpectMessage(Read("cut.mat", Bytes(whole.begin(), whole.begin() + size)).status(), "cut.mat");
}

TEST_F(Mat, ReadsEveryKindOfNumber) {
  const Bytes cells =
      Matrix(1, {1, 4}, "all",
             Matrix(6, {1, 1}, "", Element(9, OneAndAHalf())) +
                 Matrix(6, {1, 2}, "", Small(3, {0xFF, 0xFF, 2, 0})) +
                 Matrix(12, {1, 1}, "", Small(5, Words({0xFFFFFFFE}))) + Element(14, {}));
  const auto mat = Ok(Read("all.mat", Header() + cells));
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

TEST_F(Mat, WritesWhatItReads) {
  ASSERT_TRUE(SaveMat(folder_ / "b.mat", Birds()).ok());
  const auto mat = Ok(LoadMat(folder_ / "b.mat"));
  const auto images = MatPlace::Variable(*mat, "images");
  EXPECT_EQ(images->places(), 3u);
  EXPECT_EQ(images->Field(2, "rel_path")->Text().value(), "bird2.jpg");
  EXPECT_EQ(images->Field(1, "bbox")->Field(0, "x1")->Number().value(), 1.25);
  EXPECT_EQ(images->Field(1, "mask")->Numbers(4).value(), (std::vector<double>{1, 0, 1, 1}));
  EXPECT_EQ(MatPlace::Variable(*mat, "S")->Numbers(3).value()[2], 1e-300);
  ASSERT_TRUE(SaveMat(folder_ / "again.mat", mat->variables).ok());
  EXPECT_EQ(ReadFile(folder_ / "again.mat").value(), ReadFile(folder_ / "b.mat").value());
  ExpectMessage(SaveMat("/proc/no/b.mat", Birds()), "/proc/no");
}

TEST_F(Mat, ErrorsNameFileAndPlace) {
  ASSERT_TRUE(SaveMat(folder_ / "b.mat", Birds()).ok());
  const auto mat = Ok(LoadMat(folder_ / "b.mat"));
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

TEST_F(Mat, RefusesOtherFiles) {
  Bytes old(200, 0), newer = Header();
  newer[125] = 3;
  ExpectMessage(Read("v4.mat", old).status(), "v4.mat", "version 5 or 7.3");
  ExpectMessage(Read("v9.mat", newer).status(), "v9.mat", "version 5 or 7.3");
  Bytes hdf = Header();
  hdf[125] = 2;
  ExpectMessage(Read("hdf.mat", hdf + Bytes(600, 0)).status(), "hdf.mat");
  ExpectMessage(Read("short.mat", Bytes{1, 2}).status(), "2 bytes");
  ExpectMessage(LoadMat("/no/such.mat").status(), "/no/such.mat");
}

TEST_F(Mat, RefusesWhatIsNotFinishedOrTooLarge) {
  const Bytes whole = Header() + BirdStruct();
  for (std::size_t size = 129; size < whole.size(); size += 3)
    ExpectMessage(Read("cut.mat", Bytes(whole.begin(), whole.begin() + size)).status(), "cut off");
  Bytes huge = Matrix(6, {0x7FFFFFFF, 0x7FFFFFFF}, "m", {});
  ExpectMessage(Read("huge.mat", Header() + huge).status(), "huge.mat");
  Bytes complex_numbers = Matrix(6 | 0x800, {1, 1}, "c", Element(9, OneAndAHalf()));
  ExpectMessage(Read("c.mat", Header() + complex_numbers).status(), "c.mat");
  Bytes nested = Matrix(6, {1, 1}, "", Element(9, OneAndAHalf()));
  for (int i = 0; i < 20; ++i) nested = Matrix(1, {1, 1}, "", nested);
  ExpectMessage(Read("deep.mat", Header() + nested).status(), "16 deep");
}

// What is broken inside of a variable whose length is right.
TEST_F(Mat, DamageWithinAVariableIsAnErrorOrHarmless) {
  const Bytes few = Matrix(6, {3, 3}, "m", Element(9, OneAndAHalf()));
  const auto mat = Read("few.mat", Header() + few);
  if (mat.ok()) {
    EXPECT_EQ(mat->variables.at(0).second.numbers.size(), 9u);
  }
  const Bytes plain = Header() + BirdStruct(), packed = Header() + Packed(BirdStruct());
  for (const Bytes* whole : {&plain, &packed}) {
    for (std::size_t at = 136; at < whole->size(); at += 23) {
      Bytes damaged = *whole;
      damaged[at] ^= 0x41;
      const auto other = Read("damaged.mat", damaged);
      if (!other.ok()) ExpectMessage(other.status(), "damaged.mat");
    }
  }
}

// A hundred kilobytes that unpack to a hundred megabytes are not unpacked beyond what is allowed.
TEST_F(Mat, AsksBeforeItUnpacks) {
  const Bytes zeros = Matrix(9, {10000, 10000}, "z", Element(2, Bytes(100'000'000, 0)));
  const Bytes file = Header() + Packed(zeros);
  EXPECT_LT(file.size(), 200'000u);
  const ReadBudget budget(8 << 20);
  ExpectMessage(Read("bomb.mat", file).status(), "bomb.mat", "z");
}

}  // namespace tilegrad::io::mat_test
