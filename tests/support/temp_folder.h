// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "base/file.h"

namespace tilegrad {

// A fixture with a folder of its own that is gone afterwards.
class TempFolderTest : public testing::Test {
 protected:
  TempFolderTest()
      : folder_(Path(testing::TempDir()) /
                (std::string("tilegrad_") +
                 testing::UnitTest::GetInstance()->current_test_info()->name() + "_" +
                 std::to_string(::getpid()))) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  ~TempFolderTest() override { std::filesystem::remove_all(folder_); }

  Path Write(const std::string& name, const std::string& text) const {
    EXPECT_TRUE(WriteTextAtomic(folder_ / name, text).ok());
    return folder_ / name;
  }
  Path Write(const std::string& name, const Bytes& bytes) const {
    EXPECT_TRUE(WriteFileAtomic(folder_ / name, bytes).ok());
    return folder_ / name;
  }

  Path folder_;
};

// The message of a status names all of these.
template <class... Parts>
void ExpectMessage(const Status& status, const Parts&... parts) {
  EXPECT_FALSE(status.ok());
  for (const std::string& part : {std::string(parts)...}) {
    EXPECT_NE(status.message().find(part), std::string::npos)
        << "\"" << part << "\" is not in: " << status.message();
  }
}

}  // namespace tilegrad
