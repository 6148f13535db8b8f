// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <string>

#include "base/file.h"

namespace tilegrad::train {

// A test with an empty folder of its own, gone afterwards.
class FolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    root_ = Path(::testing::TempDir()) / (std::string("tilegrad_") + test->test_suite_name() + "_" +
                                          test->name() + "_" + std::to_string(::getpid()));
    std::filesystem::remove_all(root_);
    ASSERT_TRUE(MakeFolder(root_).ok());
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  // Relative path -> bytes, of all files below `folder`.
  static std::map<std::string, Bytes> Contents(const Path& folder) {
    std::map<std::string, Bytes> out;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      out[std::filesystem::relative(entry.path(), folder).string()] =
          ReadFile(entry.path()).value();
    }
    return out;
  }

  Path root_;
};

}  // namespace tilegrad::train
