// SPDX-License-Identifier: Apache-2.0
// Two runs that must have come to the same: weights and moments to the bit, curves line by line.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "nn/nn.h"
#include "support/expect.h"
#include "train/run/checkpoint.h"
#include "train/run/log.h"

namespace tilegrad::train {

// Of the newest checkpoint, which is of step `steps`; empty where there is none.
inline std::vector<nn::NamedTensor> FinalTensors(nn::Context& context, const Path& run, int steps) {
  auto found = Ok(LoadNewestCheckpoint(context, run));
  EXPECT_EQ(found->checkpoint.info.step, steps);
  return std::move(found->checkpoint.tensors);
}

inline void ExpectSameBits(nn::Context& context, const Path& a, const Path& b, int steps) {
  const auto left = FinalTensors(context, a, steps), right = FinalTensors(context, b, steps);
  ASSERT_FALSE(left.empty());
  ASSERT_EQ(left.size(), right.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    ASSERT_EQ(left[i].name, right[i].name);
    ASSERT_EQ(left[i].value.bytes(), right[i].value.bytes());
    EXPECT_EQ(std::memcmp(left[i].value.raw(), right[i].value.raw(), left[i].value.bytes()), 0)
        << b << ": " << left[i].name;
  }
}

// What a line of the log says but rates and times, which are of the clock.
inline std::map<std::string, double> ByName(const LogEntry& entry) {
  std::map<std::string, double> out;
  for (const auto& [name, value] : entry.values) {
    if (name != "images_per_second" && name != "seconds" && name != "stream_share" &&
        name != "wait_share" && name != "summed_numbers")
      out[name] = value;
  }
  return out;
}

// Every step once, in order, with the same losses.
inline void ExpectSameCurves(const Path& a, const Path& b, int steps) {
  const auto left = ReadLog(a), right = ReadLog(b);
  ASSERT_TRUE(left.ok() && right.ok());
  ASSERT_EQ(left->size(), static_cast<std::size_t>(steps));
  ASSERT_EQ(right->size(), left->size());
  for (std::size_t i = 0; i < left->size(); ++i) {
    EXPECT_EQ(left->at(i).step, static_cast<std::int64_t>(i) + 1);
    EXPECT_EQ(right->at(i).step, left->at(i).step);
    EXPECT_EQ(ByName(left->at(i)), ByName(right->at(i))) << b << ", line " << i + 1;
  }
}

}  // namespace tilegrad::train
