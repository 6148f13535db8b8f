// SPDX-License-Identifier: Apache-2.0
#include "base/scratch_bytes.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "support/temp_folder.h"

namespace tilegrad::scratch_bytes_test {

class ScratchBytesTest : public TempFolderTest {
 protected:
  ScratchBytesTest() { ::setenv("TMPDIR", folder_.c_str(), 1); }
  ~ScratchBytesTest() override { ::unsetenv("TMPDIR"); }
  bool Mapped() const {
    std::ifstream maps("/proc/self/maps");
    const std::string text{std::istreambuf_iterator<char>(maps), {}};
    return text.find(folder_.string() + "/tilegrad-") != std::string::npos;
  }
};

void ExpectHolds(ScratchBytes& bytes) {
  EXPECT_TRUE(std::all_of(bytes.begin(), bytes.end(), [](auto b) { return b == 0; }));
  bytes[bytes.size() - 1] = 7;
  ScratchBytes moved;
  moved = std::move(bytes);
  EXPECT_EQ(moved[moved.size() - 1], 7);
}

TEST_F(ScratchBytesTest, ManyAreAFileWithoutAName) {
  {
    ScratchBytes bytes(1000);
    bytes.Resize(1000);
    EXPECT_FALSE(Mapped());
    bytes.Resize(100000);
    EXPECT_TRUE(Mapped());
    EXPECT_TRUE(std::filesystem::is_empty(folder_));
    ExpectHolds(bytes);
  }
  EXPECT_FALSE(Mapped());
}

TEST_F(ScratchBytesTest, WithoutAFolderTheyAreInMemory) {
  ::setenv("TMPDIR", (folder_ / "none").c_str(), 1);
  ScratchBytes bytes(1000);
  bytes.Resize(100000);
  EXPECT_FALSE(Mapped());
  ExpectHolds(bytes);
}

}  // namespace tilegrad::scratch_bytes_test
