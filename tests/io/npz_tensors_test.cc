// SPDX-License-Identifier: Apache-2.0
// .npy and .npz files as tensors, and into a network.
#include "io/npz_tensors.h"

#include <gtest/gtest.h>

#include "nn/nn.h"
#include "support/temp_folder.h"

namespace tilegrad::io::npz_tensors_test {

TEST(NpzTensors, OfEveryType) {
  const Workers workers(1);
  const nn::Context context(workers);
  const std::vector<float> f = {1.5f, -2, 3, 4, 5, 6};
  const auto floats =
      TensorFromNpy(context, MakeNpy<float>({2, 3}, std::span<const float>(f)), "x").value();
  EXPECT_EQ(floats.shape(), (nn::Shape{2, 3}));
  EXPECT_EQ(floats.data<float>()[1], -2.0f);
  const std::vector<std::int64_t> i = {1ll << 40};
  const auto wide =
      TensorFromNpy(context, MakeNpy<std::int64_t>({}, std::span<const std::int64_t>(i)), "x")
          .value();
  EXPECT_EQ(wide.dtype(), nn::DType::kI64);
  EXPECT_EQ(wide.data<std::int64_t>()[0], 1ll << 40);
  NpyArray flags{NpyType::kBool, {2}, {1, 0}};
  EXPECT_EQ(TensorFromNpy(context, flags, "x").value().dtype(), nn::DType::kU8);
  flags.type = NpyType::kI8;
  EXPECT_NE(TensorFromNpy(context, flags, "mask").status().message().find("mask: int8"),
            std::string::npos);
  const NpyArray vast{NpyType::kF32, {0, std::size_t{0} - 3}, {}};
  EXPECT_NE(TensorFromNpy(context, vast, "x").status().message().find("a tensor cannot have"),
            std::string::npos);
  const NpyArray deep{NpyType::kU8, {1, 1, 1, 1, 1, 1}, {7}};
  EXPECT_NE(TensorFromNpy(context, deep, "x").status().message().find("6 axes"), std::string::npos);
}

using NpzTensorFiles = TempFolderTest;

TEST_F(NpzTensorFiles, WeightsOfANetwork) {
  const Workers workers(1);
  nn::Context context(workers);
  Rng rng(1);
  nn::LinearLayer layer(context, {.in = 2, .out = 1}, rng);
  const std::vector<double> weight = {0.5, -4}, bias = {3};
  const Path path = folder_ / "weights.npz";
  ASSERT_TRUE(SaveNpz(path, {{"weight", MakeNpy<double>({1, 2}, std::span<const double>(weight))},
                             {"bias", MakeNpy<double>({1}, std::span<const double>(bias))}})
                  .ok());
  const auto tensors = LoadNpyTensors(context, path);
  ASSERT_TRUE(tensors.ok()) << tensors.status().message();
  ASSERT_TRUE(nn::LoadState(layer, *tensors).ok());
  EXPECT_EQ(layer.weight.value().data<float>()[1], -4.0f);
  EXPECT_EQ(layer.bias.value().data<float>()[0], 3.0f);

  const Path single = folder_ / "bias.npy";
  const NpyArray array = MakeNpy<double>({1}, std::span<const double>(bias));
  ASSERT_TRUE(WriteFileAtomic(single, EncodeNpy(array)).ok());
  const auto one = LoadNpyTensors(context, single);
  ASSERT_TRUE(one.ok()) << one.status().message();
  ASSERT_EQ(one->size(), 1u);
  EXPECT_EQ((*one)[0].name, "bias");
  EXPECT_EQ((*one)[0].value.data<double>()[0], 3.0);
}

}  // namespace tilegrad::io::npz_tensors_test
