// SPDX-License-Identifier: Apache-2.0
#include "base/read_budget.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <thread>

#include "base/file.h"
#include "support/temp_folder.h"

namespace tilegrad::read_budget_test {

class ReadBudgetTest : public TempFolderTest {
 protected:
  void TearDown() override { unsetenv("TILEGRAD_READ_LIMIT"); }
};

TEST_F(ReadBudgetTest, IsASum) {
  EXPECT_TRUE(ReadBudget::Take(std::size_t{1} << 60, "without a budget").ok());
  const ReadBudget budget(100);
  EXPECT_TRUE(ReadBudget::Take(60, "a").ok());
  EXPECT_TRUE(ReadBudget::Take(0, "a").ok());
  EXPECT_TRUE(budget.status().ok());
  const Status over = ReadBudget::Take(41, "b.png");
  EXPECT_EQ(over.code(), StatusCode::kResourceExhausted);
  ExpectMessage(over, "b.png", "TILEGRAD_READ_LIMIT");
  EXPECT_FALSE(ReadBudget::Take(~std::size_t{0}, "c").ok());
  EXPECT_TRUE(ReadBudget::Take(40, "to the last byte").ok());
  EXPECT_FALSE(ReadBudget::Take(1, "d").ok());
  ExpectMessage(budget.status(), "b.png");  // the first
}

TEST_F(ReadBudgetTest, SideFilesBelongToTheFile) {
  std::optional<ReadBudget> file(std::in_place, 100);
  {
    const ReadBudget side(1000);
    EXPECT_TRUE(ReadBudget::Take(90, "a").ok());
    EXPECT_FALSE(ReadBudget::Take(90, "b").ok());
    EXPECT_FALSE(side.status().ok());
  }
  EXPECT_FALSE(ReadBudget::Take(11, "c").ok());
  std::thread([] { EXPECT_TRUE(ReadBudget::Take(1000, "another thread's").ok()); }).join();
  file.reset();
  const ReadBudget next(100);
  EXPECT_TRUE(ReadBudget::Take(100, "the next file").ok());
}

TEST_F(ReadBudgetTest, TheEnvironmentSetsIt) {
  EXPECT_EQ(ReadLimit().value(), std::size_t{4} << 30);
  const std::pair<const char*, std::size_t> good[] = {{"1", 1},
                                                      {"500M", 500u << 20},
                                                      {"16G", std::size_t{16} << 30},
                                                      {"3K", 3072},
                                                      {"", std::size_t{4} << 30}};
  for (const auto& [text, bytes] : good) {
    setenv("TILEGRAD_READ_LIMIT", text, 1);
    EXPECT_EQ(ReadLimit().value(), bytes) << text;
  }
  for (const char* text :
       {"0", "-1", "4 G", "4GB", "x", "1e9", "99999999999999999999", "99999999T"}) {
    setenv("TILEGRAD_READ_LIMIT", text, 1);
    ExpectMessage(ReadLimit().status(), "TILEGRAD_READ_LIMIT", text);
    const ReadBudget budget;
    EXPECT_EQ(ReadBudget::Take(1, "a").code(), StatusCode::kInvalidArgument) << text;
  }
}

TEST_F(ReadBudgetTest, FilesCount) {
  const Path file = Write("a", std::string(60, 'x'));
  EXPECT_TRUE(ReadFile(file).ok());
  const ReadBudget budget(100);
  EXPECT_TRUE(ReadFile(file).ok());
  const auto second = ReadText(file);
  EXPECT_EQ(second.status().code(), StatusCode::kResourceExhausted);
  ExpectMessage(second.status(), file.string());
}

}  // namespace tilegrad::read_budget_test
