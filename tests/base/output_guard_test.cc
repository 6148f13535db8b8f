// SPDX-License-Identifier: Apache-2.0
#include "base/output_guard.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <thread>

#include "base/aligned.h"
#include "base/file.h"
#include "base/read_budget.h"
#include "support/temp_folder.h"

namespace tilegrad::output_guard_test {

class Guard : public TempFolderTest {};

TEST_F(Guard, WhatIsNotThereMayBeWritten) {
  const OutputGuard guard;
  EXPECT_TRUE(guard.Check(folder_ / "new.png").ok());
  EXPECT_TRUE(guard.Check(folder_ / "no/folder/new.png").ok());
  EXPECT_TRUE(guard.Check("/dev/null").ok());
}

TEST_F(Guard, WhatIsThereIsKeptUnlessForced) {
  const Path file = Write("a.png", std::string("mine"));
  std::filesystem::create_symlink(file, folder_ / "link.png");
  for (const Path& name : {file, folder_ / "link.png"}) {
    ExpectMessage(OutputGuard().Check(name), name.string() + ": exists", "--force");
    EXPECT_TRUE(OutputGuard(true).Check(name).ok());
  }
  const Path files[] = {folder_ / "new.png", file};
  ExpectMessage(OutputGuard().CheckAll(files), file.string());
}

// Of this file, from processes that are gone.
TEST_F(Guard, WhatKilledCallsLeftOfAFileGoes) {
  const std::string gone = ".4194305.tmp", long_name = std::string(250, 'n') + ".png";
  for (const std::string name : {"a.png", "b.png", "c.png"})
    Write(name + gone, std::string("half"));
  const Path hashed = TemporaryOf(folder_ / long_name);
  Write(hashed.stem().stem().string() + gone, std::string("half"));
  Write("b.png", std::string("mine"));
  const OutputGuard guard;
  EXPECT_TRUE(guard.Check(folder_ / "a.png").ok());
  EXPECT_TRUE(guard.Check(folder_ / long_name).ok());
  EXPECT_FALSE(guard.Check(folder_ / "b.png").ok());
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_))
    left.push_back(entry.path().filename().string());
  std::sort(left.begin(), left.end());
  EXPECT_EQ(left, (std::vector<std::string>{"b.png", "b.png" + gone, "c.png" + gone}));
}

TEST_F(Guard, InputsAreNeverWrittenUnderAnyName) {
  const Path file = Write("texture.png", std::string("input"));
  std::filesystem::create_symlink(file, folder_ / "soft.png");
  std::filesystem::create_hard_link(file, folder_ / "hard.png");
  std::filesystem::create_symlink(folder_, folder_ / "here");
  std::filesystem::create_directories(folder_ / "x");
  OutputGuard guard(true);
  guard.AddInput(file);
  guard.AddInput(folder_ / "missing.png");
  for (const Path& name : {file, folder_ / "soft.png", folder_ / "hard.png",
                           folder_ / "here/texture.png", folder_ / "x/../texture.png"}) {
    ExpectMessage(guard.Check(name), name.string(), "is an input of this command");
    ExpectMessage(guard.CheckNotRead({&name, 1}), name.string(), "is an input of this command");
  }
  EXPECT_TRUE(guard.Check(folder_ / "missing.png").ok());
}

TEST_F(Guard, FilesOfAnInputFolderAreInputs) {
  Write("model/cameras.txt", std::string("1"));
  OutputGuard guard(true);
  guard.AddInput(folder_ / "model");
  ExpectMessage(guard.Check(folder_ / "model/cameras.txt"), "is an input of this command");
  EXPECT_TRUE(guard.Check(folder_ / "model/images.txt").ok());
}

// Also where all is in folders below; a file that a killed call left half-written is none.
TEST_F(Guard, FoldersAreFilledIfNothingIsInThem) {
  EXPECT_TRUE(OutputGuard().CheckFolder(folder_ / "new").ok());
  std::filesystem::create_directories(folder_ / "images/small");
  Write("images/a.png.4194305.tmp", std::string("half"));
  EXPECT_TRUE(OutputGuard().CheckFolder(folder_).ok());
  Write("images/photo.png", std::string("mine"));
  ExpectMessage(OutputGuard().CheckFolder(folder_), "photo.png", "--force");
  EXPECT_TRUE(OutputGuard(true).CheckFolder(folder_).ok());
}

TEST_F(Guard, WritesWhatMayBeWritten) {
  const Path file = folder_ / "a.txt";
  int writes = 0;
  const auto write = [&] {
    ++writes;
    return WriteTextAtomic(file, "text");
  };
  EXPECT_TRUE(WriteGuarded(OutputGuard(), file, write).ok());
  EXPECT_FALSE(WriteGuarded(OutputGuard(), file, write).ok());
  EXPECT_TRUE(WriteGuarded(OutputGuard(true), file, write).ok());
  EXPECT_EQ(writes, 2);
}

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

}  // namespace tilegrad::output_guard_test
