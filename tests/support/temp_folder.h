// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <span>
#include <string>

#include "base/file.h"
#include "support/expect.h"

namespace tilegrad {

// A fixture with its own folder, removed afterwards.
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
  // Expects that no hidden file is left behind.
  ~TempFolderTest() override {
    std::error_code error;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_, error))
      EXPECT_FALSE(entry.path().filename().string().starts_with('.')) << entry.path();
    std::filesystem::remove_all(folder_);
  }

  // Without fsync, which would be most of the time of a test with many broken files.
  Path Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
    EXPECT_EQ(std::filesystem::file_size(folder_ / name), text.size());
    return folder_ / name;
  }
  Path Write(const std::string& name, const Bytes& bytes) const {
    return Write(name, std::string(bytes.begin(), bytes.end()));
  }

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

  Path folder_;
};

// `read` gives the status of a file's bytes. Expects an error with `part` for every prefix of the
// file, each `step` bytes longer.
template <class Read>
void ExpectCutsRefused(std::span<const std::uint8_t> whole, const std::string& part,
                       const Read& read, std::size_t step = 1) {
  for (std::size_t size = 0; size < whole.size(); size += step) {
    SCOPED_TRACE(size);
    ExpectMessage(read(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))),
                  part);
  }
}

}  // namespace tilegrad
