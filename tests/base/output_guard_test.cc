// SPDX-License-Identifier: Apache-2.0
#include "base/output_guard.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "support/temp_folder.h"

namespace tilegrad::output_guard_test {

class Guard : public TempFolderTest {
 protected:
  Path Made(const std::string& name, const std::string& text) {
    const Path file = Write(name, text);
    OutputGuard().Note(file);
    return file;
  }
};

TEST_F(Guard, WhatIsNotThereMayBeWritten) {
  const OutputGuard guard;
  EXPECT_TRUE(guard.Check(folder_ / "new.png").ok());
  EXPECT_TRUE(guard.Check(folder_ / "no/folder/new.png").ok());
  EXPECT_TRUE(guard.Check("/dev/null").ok());
}

TEST_F(Guard, WhatSomebodyElseWroteIsKept) {
  const Path file = Write("a.png", std::string("mine"));
  ExpectMessage(OutputGuard().Check(file), file.string(), "--force");
  EXPECT_TRUE(OutputGuard(true).Check(file).ok());
}

TEST_F(Guard, WhatWeWroteIsReplacedUnlessSomebodyEditedIt) {
  const Path file = Made("a.npy", "ours");
  EXPECT_TRUE(OutputGuard().Check(file).ok());
  Write("a.npy", std::string("edited"));
  ExpectMessage(OutputGuard().Check(file), "--force");
  Made("a.npy", "ours again");
  EXPECT_TRUE(OutputGuard().Check(file).ok());
  Write("b.npy", std::string("ours again"));  // under another name it is somebody's copy
  ExpectMessage(OutputGuard().Check(folder_ / "b.npy"), "--force");
}

// Of this file, from processes that are gone; a folder is listed once.
TEST_F(Guard, WhatKilledCallsLeftOfAFileGoes) {
  const std::string gone = ".4194305.tmp", long_name = std::string(250, 'n') + ".png";
  for (const std::string name : {"a.png", "b.png", "c.png"})
    Write(name + gone, std::string("half"));
  const Path hashed = TemporaryOf(folder_ / long_name);
  Write(hashed.stem().stem().string() + gone, std::string("half"));
  OutputGuard guard;
  guard.NoteAll(std::vector{Write("a.png", std::string("whole")), folder_ / "none.png",
                            Write(long_name, std::string("whole"))});
  guard.Note(Write("b.png", std::string("whole")));
  std::vector<Path> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.path().extension() == ".tmp") left.push_back(entry.path().filename());
  }
  EXPECT_EQ(left, std::vector<Path>{"c.png" + gone});
}

// A process that was killed before it could say that it had written the file.
TEST_F(Guard, WhatAKilledCallHasJustWrittenIsOurs) {
  const Path file = folder_ / "a.png";
  ASSERT_TRUE(OutputGuard().Check(file).ok());
  ASSERT_TRUE(WriteTextAtomic(file, "first").ok());
  EXPECT_TRUE(OutputGuard().Check(file).ok());
  ASSERT_TRUE(WriteTextAtomic(file, "second").ok());
  EXPECT_TRUE(OutputGuard().Check(file).ok());
  OutputGuard().Note(file);
  EXPECT_EQ(std::filesystem::file_size(folder_ / ".tilegrad-made"), 135 + 2 * 17);
  ASSERT_TRUE(WriteTextAtomic(folder_ / "b.png", "not asked for").ok());
  ExpectMessage(OutputGuard().Check(folder_ / "b.png"), "--force");
}

// A file without its note would be taken for somebody else's by the next call.
TEST_F(Guard, AFileWhoseNoteHasNoRoomIsNotWritten) {
  const Path notes = folder_ / ".tilegrad-made", file = folder_ / "a.png";
  Made("b.png", "ours");
  ASSERT_TRUE(AppendText(notes, "0123456789", false).ok());  // of a line that had no room
  rlimit before;
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit full = before;
  full.rlim_cur = std::filesystem::file_size(notes) + 5;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &full), 0);
  EXPECT_TRUE(OutputGuard().Check(file).ok());
  const Status status = WriteTextAtomic(file, "small");
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ExpectMessage(status, ".tilegrad-made", "cannot append");
  EXPECT_FALSE(std::filesystem::exists(file));
  ASSERT_TRUE(WriteTextAtomic(file, "small").ok());
  EXPECT_TRUE(OutputGuard().Check(file).ok());
  EXPECT_TRUE(OutputGuard().Check(folder_ / "b.png").ok());
}

// What is written twice is noted once.
TEST_F(Guard, NotesDoNotGrowWithRepetition) {
  Made("a.png", "ours");
  const auto size = std::filesystem::file_size(folder_ / ".tilegrad-made");
  Made("a.png", "ours");
  EXPECT_EQ(std::filesystem::file_size(folder_ / ".tilegrad-made"), size);
  Made("a.png", "other");
  EXPECT_EQ(std::filesystem::file_size(folder_ / ".tilegrad-made"), size + 17);
}

TEST_F(Guard, InputsAreNeverWrittenUnderAnyName) {
  const Path file = Made("texture.png", "input");
  std::filesystem::create_symlink(file, folder_ / "soft.png");
  std::filesystem::create_hard_link(file, folder_ / "hard.png");
  std::filesystem::create_symlink(folder_, folder_ / "here");
  OutputGuard guard(true);
  guard.AddInput(file);
  guard.AddInput(folder_ / "missing.png");
  for (const Path& name : {file, folder_ / "soft.png", folder_ / "hard.png",
                           folder_ / "here/texture.png", folder_ / "x/../texture.png"}) {
    std::filesystem::create_directories(folder_ / "x");
    ExpectMessage(guard.Check(name), name.string(), "is read here");
  }
  EXPECT_TRUE(guard.Check(folder_ / "missing.png").ok());
}

TEST_F(Guard, FilesOfAnInputFolderAreInputs) {
  Write("model/cameras.txt", std::string("1"));
  OutputGuard guard(true);
  guard.AddInput(folder_ / "model");
  ExpectMessage(guard.Check(folder_ / "model/cameras.txt"), "is read here");
  EXPECT_TRUE(guard.Check(folder_ / "model/images.txt").ok());
}

TEST_F(Guard, LinksToOurFilesAreOurs) {
  Made("deep/a.png", "ours");
  std::filesystem::create_symlink(folder_ / "deep/a.png", folder_ / "a.png");
  EXPECT_TRUE(OutputGuard().Check(folder_ / "a.png").ok());
  Write("deep/a.png", std::string("theirs"));
  EXPECT_FALSE(OutputGuard().Check(folder_ / "a.png").ok());
}

TEST_F(Guard, FoldersAreFilledIfNothingInThemIsForeign) {
  EXPECT_TRUE(OutputGuard().CheckFolder(folder_ / "new").ok());
  EXPECT_TRUE(OutputGuard().CheckFolder(folder_).ok());
  Made("images/1.png", "ours");
  EXPECT_TRUE(OutputGuard().CheckFolder(folder_).ok());
  Write("images/photo.png", std::string("mine"));
  ExpectMessage(OutputGuard().CheckFolder(folder_), "photo.png", "--force");
  EXPECT_TRUE(OutputGuard(true).CheckFolder(folder_).ok());
  Write("images/.lock", std::string(""));  // where this program works
  EXPECT_TRUE(OutputGuard().CheckFolder(folder_).ok());
}

TEST_F(Guard, WritesCheckAndNote) {
  const Path file = folder_ / "a.txt";
  int writes = 0;
  const auto write = [&] { return ++writes, WriteTextAtomic(file, "text"); };
  EXPECT_TRUE(WriteGuarded(OutputGuard(), file, write).ok());
  EXPECT_TRUE(WriteGuarded(OutputGuard(), file, write).ok());
  Write("a.txt", std::string("edited"));
  EXPECT_FALSE(WriteGuarded(OutputGuard(), file, write).ok());
  EXPECT_EQ(writes, 2);
  EXPECT_EQ(ReadText(file).value(), "edited");
}

// A link that others planted as the notes is not written through.
TEST_F(Guard, NotesAreNotWrittenThroughLinks) {
  const Path victim = Write("victim", std::string("v"));
  std::filesystem::create_directories(folder_ / "open");
  std::filesystem::create_symlink(victim, folder_ / "open/.tilegrad-made");
  const Path file = Made("open/a.png", "ours");
  EXPECT_EQ(ReadText(victim).value(), "v");
  EXPECT_FALSE(OutputGuard().Check(file).ok());
}

}  // namespace tilegrad::output_guard_test
