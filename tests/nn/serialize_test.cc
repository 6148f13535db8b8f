// SPDX-License-Identifier: Apache-2.0
// safetensors against bytes written by hand, and against files that lie.
#include "nn/serialize.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>

#include "support/expect.h"

namespace tilegrad::nn::serialize_test {

class Safetensors : public ::testing::Test {
 protected:
  Status Decode(const Bytes& bytes) { return DecodeSafetensors(context_, bytes).status(); }
  // A file of this header and `data_bytes` zeros.
  static Bytes File(const std::string& header, std::size_t data_bytes) {
    Bytes bytes(8 + header.size() + data_bytes);
    const std::uint64_t length = header.size();
    std::memcpy(bytes.data(), &length, 8);
    std::memcpy(bytes.data() + 8, header.data(), header.size());
    return bytes;
  }

  Workers workers_{1};
  Context context_{workers_};
};

// Written out by hand from the format's description; spaces to a multiple of 8 bytes.
const char* kByHand = R"({"b":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}  )";

TEST_F(Safetensors, WritesTheBytesOfAFileWrittenByHand) {
  const std::vector<float> values = {1.0f, -2.5f};
  Bytes by_hand = File(kByHand, 8);
  std::memcpy(&by_hand[64], values.data(), 8);
  EXPECT_EQ(EncodeSafetensors({{{"b", context_.From({2}, values)}}, {}}).value(), by_hand);
}

// What the format's own implementation writes and reads (huggingface/safetensors): the bytes that
// its tests of the Rust core and of the Python binding state.
const char* kFromRust =
    "40000000000000007b226174746e2e30223a7b226474797065223a22463332222c227368617065223a5b312c"
    "322c335d2c22646174615f6f666673657473223a5b302c32345d7d7d000000000000803f0000004000004040"
    "000080400000a040";
const char* kFromPython =
    "66000000000000007b225f5f6d657461646174615f5f223a7b226672616d65776f726b223a227074227d2c22"
    "7465737431223a7b226474797065223a22493332222c227368617065223a5b322c325d2c22646174615f6f66"
    "6673657473223a5b302c31365d7d7d2020202020202000000000000000000000000000000000";

Bytes FromHex(const std::string& hex) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

TEST_F(Safetensors, AgreesWithTheFormatsOwnImplementation) {
  const auto file = Ok(DecodeSafetensors(context_, FromHex(kFromRust)));
  ASSERT_EQ(file->tensors.size(), 1u);
  EXPECT_EQ(file->tensors[0].name, "attn.0");
  EXPECT_EQ(file->tensors[0].value.shape(), (Shape{1, 2, 3}));
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(file->tensors[0].value.data<float>()[i], static_cast<float>(i));
  }
  EXPECT_EQ(EncodeSafetensors(*file).value(), FromHex(kFromRust));
}

TEST_F(Safetensors, ReadsMetadataAndPaddingOfOthers) {
  const auto file = Ok(DecodeSafetensors(context_, FromHex(kFromPython)));
  EXPECT_EQ(file->metadata.at("framework"), "pt");
  ASSERT_EQ(file->tensors.size(), 1u);
  EXPECT_EQ(file->tensors[0].value.dtype(), DType::kI32);
  EXPECT_EQ(file->tensors[0].value.shape(), (Shape{2, 2}));
}

TEST_F(Safetensors, RoundTripOfAllTypes) {
  TensorFile file;
  file.metadata = {{"step", "12"}, {"note", "a \"quoted\" one"}};
  for (DType dtype : {DType::kF32, DType::kF64, DType::kU8, DType::kI32, DType::kI64}) {
    for (const Shape& shape : {Shape{}, Shape{3}, Shape{2, 0, 3}, Shape{1, 2, 3, 2, 1}}) {
      Tensor t = context_.Empty(shape, dtype);
      for (std::size_t i = 0; i < t.bytes(); ++i) t.raw()[i] = static_cast<std::byte>(i * 37);
      file.tensors.push_back({NameOf(dtype) + shape.ToString(), t});
    }
  }
  const auto back = Ok(DecodeSafetensors(context_, EncodeSafetensors(file).value()));
  EXPECT_EQ(back->metadata, file.metadata);
  ASSERT_EQ(back->tensors.size(), file.tensors.size());
  for (std::size_t i = 0; i < file.tensors.size(); ++i) {
    const Tensor& want = file.tensors[i].value;
    const Tensor& got = back->tensors[i].value;
    EXPECT_EQ(back->tensors[i].name, file.tensors[i].name);
    EXPECT_EQ(got.dtype(), want.dtype());
    ASSERT_EQ(got.shape(), want.shape());
    EXPECT_EQ(std::memcmp(got.raw(), want.raw(), want.bytes()), 0);
  }
}

TEST_F(Safetensors, ReadsHalvesAsFloats) {
  Bytes bytes = File(R"({"a":{"dtype":"F16","shape":[2,2],"data_offsets":[0,8]}})", 8);
  const std::uint8_t data[] = {0x00, 0x3c, 0x00, 0xc1, 0x01, 0x00, 0xff, 0x7b};
  std::copy(std::begin(data), std::end(data), bytes.end() - 8);
  const auto file = Ok(DecodeSafetensors(context_, bytes));
  ASSERT_EQ(file->tensors.size(), 1u);
  const Tensor& a = file->tensors[0].value;
  EXPECT_EQ(a.dtype(), DType::kF32);
  EXPECT_EQ(a.shape(), (Shape{2, 2}));
  EXPECT_EQ(std::vector<float>(a.span<float>().begin(), a.span<float>().end()),
            (std::vector<float>{1.0f, -2.5f, 0x1p-24f, 65504.0f}));
  EXPECT_EQ(EncodeSafetensors(*file, StoredFloats::kHalf).value().size(),
            (bytes.size() + 7) / 8 * 8);
}

TEST_F(Safetensors, WritesHalvesOfFloatsAlone) {
  const std::vector<float> values = {1.0f / 3, -2.5f, 1e-9f};
  const std::vector<double> doubles = {1.0 / 3};
  const std::vector<std::int32_t> counts = {70000};
  TensorFile file;
  file.tensors = {{"f", context_.From({3}, values)},
                  {"d", context_.Empty({1}, DType::kF64)},
                  {"i", context_.Empty({1}, DType::kI32)}};
  std::memcpy(file.tensors[1].value.raw(), doubles.data(), 8);
  std::memcpy(file.tensors[2].value.raw(), counts.data(), 4);
  const Bytes bytes = EncodeSafetensors(file, StoredFloats::kHalf).value();
  ExpectIn(std::string(bytes.begin(), bytes.end()), R"("f":{"dtype":"F16","shape":[3],)",
           R"("d":{"dtype":"F64")", R"("i":{"dtype":"I32")");
  const auto back = Ok(DecodeSafetensors(context_, bytes));
  EXPECT_EQ(back->tensors[0].value.data<float>()[0], 0.333251953125f);
  EXPECT_EQ(back->tensors[0].value.data<float>()[1], -2.5f);
  EXPECT_EQ(back->tensors[0].value.data<float>()[2], 0.0f);
  EXPECT_EQ(back->tensors[1].value.data<double>()[0], doubles[0]);
  EXPECT_EQ(back->tensors[2].value.data<std::int32_t>()[0], counts[0]);
}

TEST_F(Safetensors, NumbersBeyondHalvesAreRefused) {
  for (const float value : {65520.0f, -1e9f, INFINITY, NAN}) {
    const TensorFile file = {
        {{"fine", context_.Full({2}, 65519.0)}, {"far", context_.Full({2}, value)}}, {}};
    const auto bytes = EncodeSafetensors(file, StoredFloats::kHalf);
    EXPECT_EQ(bytes.status().code(), StatusCode::kInvalidArgument) << value;
    ExpectIn(bytes.status().message(), "tensor \"far\"", "no number of float16");
    EXPECT_TRUE(EncodeSafetensors(file).ok());
  }
}

TEST_F(Safetensors, EveryCutIsNoticed) {
  const Bytes whole = File(kByHand, 8);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    EXPECT_EQ(Decode(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n))).code(),
              StatusCode::kDataLoss)
        << n;
  }
}

TEST_F(Safetensors, HeadersThatLie) {
  const struct {
    const char* header;
    const char* message;
  } cases[] = {
      {"[]", "not a JSON object"},
      {"{\"a\":", "not a JSON object"},
      {R"({"a":3})", "\"a\": dtype, shape or data_offsets is missing"},
      {R"({"a":{"dtype":"F8","shape":[2],"data_offsets":[0,8]}})", "none of F32"},
      {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,800]}})", "beyond the file's end"},
      {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[8,0]}})", "beyond the file's end"},
      {R"({"a":{"dtype":"F32","shape":[3],"data_offsets":[0,8]}})", "differ in size"},
      {R"({"a":{"dtype":"F16","shape":[2],"data_offsets":[0,8]}})", "differ in size"},
      {R"({"a":{"dtype":"F32","shape":[-2],"data_offsets":[0,8]}})", "not a count"},
      {R"({"a":{"dtype":"F32","shape":[4294967296,4294967296],"data_offsets":[0,8]}})", "larger"},
      {R"({"a":{"dtype":"F32","shape":[0,4294967296,4294967296],"data_offsets":[0,0]}})", "larger"},
      {R"({"a":{"dtype":"F32","shape":[0,18446744073709551615],"data_offsets":[0,0]}})", "larger"},
      {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]},
           "a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})",
       "a name twice"},
      {R"({"a":{"dtype":"F32","shape":[1,1,1,1,1,2],"data_offsets":[0,8]}})", "five axes"},
      {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8.5]}})", "two counts"},
      {R"({"__metadata__":{"a":1}})", "not a string"},
  };
  for (const auto& c : cases) {
    const Status status = Decode(File(c.header, 8));
    EXPECT_EQ(status.code(), StatusCode::kDataLoss) << c.header;
    ExpectIn(status.message(), c.message);
  }
  Bytes huge = File("{}", 0);
  huge[7] = 0xff;  // a header of 2^63 bytes
  EXPECT_EQ(Decode(huge).code(), StatusCode::kDataLoss);
}

// Of bytes that many tensors share every tensor would get a copy.
TEST_F(Safetensors, SharedBytesAreRefused) {
  const auto two = [&](const char* a, const char* b, const char* shapes = "[2]") {
    return Decode(
        File(fmt::format("{{\"a\":{{\"dtype\":\"F32\",\"shape\":{2},\"data_offsets\":{0}}},"
                         "\"b\":{{\"dtype\":\"F32\",\"shape\":{2},\"data_offsets\":{1}}}}}",
                         a, b, shapes),
             16));
  };
  EXPECT_TRUE(two("[0,8]", "[8,16]").ok());
  EXPECT_TRUE(two("[8,16]", "[0,8]").ok());  // in any order
  EXPECT_TRUE(two("[4,4]", "[4,4]", "[0]").ok());
  for (const auto& [a, b] :
       {std::pair("[0,8]", "[0,8]"), std::pair("[0,8]", "[4,12]"), std::pair("[7,15]", "[0,8]")}) {
    const Status status = two(a, b);
    EXPECT_EQ(status.code(), StatusCode::kDataLoss) << a << b;
    ExpectIn(status.message(), "overlaps");
  }
  // One without bytes between two that overlap hides nothing.
  const Status hidden =
      Decode(File("{\"a\":{\"dtype\":\"U8\",\"shape\":[10],\"data_offsets\":[0,10]},"
                  "\"e\":{\"dtype\":\"U8\",\"shape\":[0],\"data_offsets\":[5,5]},"
                  "\"b\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[6,8]}}",
                  16));
  ExpectIn(hidden.message(), "\"b\": its data overlaps that of \"a\"");
}

TEST_F(Safetensors, Files) {
  const Path path = std::filesystem::temp_directory_path() / "tilegrad_safetensors_test" / "a.st";
  const TensorFile file{{{"x", context_.Full({2, 2}, 7.0)}}, {{"k", "v"}}};
  ASSERT_TRUE(WriteSafetensors(path, file).ok());
  const auto back = Ok(ReadSafetensors(context_, path));
  EXPECT_EQ(back->tensors[0].value.data<float>()[3], 7.0f);
  ASSERT_TRUE(WriteTextAtomic(path, "not that").ok());
  ExpectIn(ReadSafetensors(context_, path).status().message(), path.string());
  std::filesystem::remove_all(path.parent_path());
  EXPECT_EQ(ReadSafetensors(context_, path).status().code(), StatusCode::kNotFound);
}

TEST_F(Safetensors, NamesMustBeUnique) {
  const Tensor t = context_.Full({1}, 0);
  EXPECT_FALSE(EncodeSafetensors({{{"a", t}, {"a", t}}, {}}).ok());
  EXPECT_FALSE(EncodeSafetensors({{{"__metadata__", t}}, {}}).ok());
}

// Two names that are no UTF-8 would be written as one.
TEST_F(Safetensors, NamesAndMetadataMustBeUtf8) {
  const Tensor t = context_.Full({1}, 0);
  EXPECT_FALSE(EncodeSafetensors({{{"a\xff", t}, {"a\xfe", t}}, {}}).ok());
  EXPECT_FALSE(EncodeSafetensors({{{"a", t}}, {{"\xff", ""}}}).ok());
  EXPECT_FALSE(EncodeSafetensors({{{"a", t}}, {{"k", "\xff"}}}).ok());
  EXPECT_TRUE(EncodeSafetensors({{{"g\xc3\xb6\"\\", t}}, {{"k", "\xc3\xb6"}}}).ok());
}

TEST_F(Safetensors, HeadersThatNoReaderTakesAreNotWritten) {
  TensorFile file{{}, {{"note", std::string(std::size_t{100} << 20, 'n')}}};
  const auto bytes = EncodeSafetensors(file);
  ASSERT_FALSE(bytes.ok());
  ExpectIn(bytes.status().message(), "at most");
}

// Time must grow linearly with the number of tensors: quadratic time took minutes here, and a
// hostile file chooses the number. Processor time, since other programs may have most of the
// machine; a sanitizer takes ten times as much.
TEST_F(Safetensors, ManyTensorsKeepTheirOrderInLinearTime) {
  constexpr int kMany = 100000;
  TensorFile file;
  const Tensor one = context_.Full({1}, 1), none = context_.Zeros({0});
  for (int i = 0; i < kMany; ++i)
    file.tensors.push_back({std::to_string(kMany - i), i % 2 == 0 ? one : none});
  const std::clock_t start = std::clock();
  const auto bytes = Ok(EncodeSafetensors(file));
  const auto read = DecodeSafetensors(context_, *bytes);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  ASSERT_TRUE(read.ok()) << read.status().message();
  ASSERT_EQ(read->tensors.size(), file.tensors.size());
  EXPECT_EQ(read->tensors[0].name, std::to_string(kMany));
  EXPECT_EQ(read->tensors.back().name, "1");
  EXPECT_LT(seconds, 30);  // in linear time it takes about 2
}

}  // namespace tilegrad::nn::serialize_test
