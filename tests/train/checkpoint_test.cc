// SPDX-License-Identifier: Apache-2.0
// Checkpoints that cannot be read and may be whole: a run stops there, and nothing is renamed.
// Damaged ones: run_test.cc, and how runs go on, trainer_test.cc.
#include "train/run/checkpoint.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <set>

#include "nn/nn.h"
#include "support/temp_folder.h"

namespace tilegrad::train::checkpoint_test {

class CheckpointTest : public TempFolderTest {
 protected:
  CheckpointTest() : workers_(1), context_(workers_) {
    for (const std::int64_t step : {10, 20}) {
      EXPECT_TRUE(SaveCheckpoint(folder_, {step, 64, "", 0}, Tensors()).ok());
    }
    newest_ = folder_ / "checkpoints/step_00000020.safetensors";
  }

  std::vector<nn::NamedTensor> Tensors() { return {{"w", context_.Full({3}, 1)}}; }

  // The newest checkpoint with another `key`; a tensor of a dtype that this version does not know.
  void Rewrite(const std::string& key, const std::string& value, bool other_dtype = false) {
    nn::TensorFile file =
        nn::ReadSafetensors(context_, folder_ / "checkpoints/step_00000010.safetensors").value();
    file.metadata[key] = value;
    Bytes bytes = nn::EncodeSafetensors(file).value();
    std::string text(bytes.begin(), bytes.end());
    if (other_dtype) text.replace(text.find("\"F32\""), 5, "\"B32\"");
    Write("checkpoints/step_00000020.safetensors", text);
  }

  // Neither an older checkpoint nor none, and all files as they are.
  void ExpectStops(const std::string& reason) {
    std::vector<Path> before = Files();
    const Status status = LoadNewestCheckpoint(context_, folder_).status();
    ExpectMessage(status, "step_00000020", reason, "nothing was changed", "move this file away");
    EXPECT_EQ(Files(), before);
  }
  std::vector<Path> Files() const {
    std::set<Path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "checkpoints"))
      files.insert(entry.path());
    return {files.begin(), files.end()};
  }

  Workers workers_;
  nn::Context context_;
  Path newest_;
};

TEST_F(CheckpointTest, AnotherVersionsIsNotDamaged) {
  Rewrite("format", "tilegrad-checkpoint-2");
  ExpectStops("another version");
  Rewrite("format", "tilegrad-checkpoint-2", /*other_dtype=*/true);
  ExpectStops("\"tilegrad-checkpoint-2\"");
  Rewrite("format", "somebody's");
  ExpectStops("not a checkpoint of tilegrad");
}

TEST_F(CheckpointTest, OneThatTheSystemDoesNotGiveIsNotDamaged) {
  std::filesystem::remove(newest_);
  std::filesystem::create_symlink(newest_, newest_);  // also stops root, unlike permissions
  ExpectStops("cannot open");
  std::filesystem::remove(newest_);
  std::filesystem::create_directory(newest_);
  ExpectStops("not a regular file");
}

TEST_F(CheckpointTest, OneAboveTheLimitIsNotDamaged) {
  std::filesystem::resize_file(newest_, (std::size_t{4} << 30) + 1);  // without taking space
  ExpectStops("more than the limit");
}

TEST_F(CheckpointTest, NoFileHandleIsNoDamage) {
  rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  nn::Context& context = context_;
  const Path folder = folder_, newest = newest_;  // UBSan cannot look at *this without a handle
  const rlimit none = {3, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Status status = LoadNewestCheckpoint(context, folder).status();
  const auto alone = LoadCheckpoint(context, newest).status();
  ::setrlimit(RLIMIT_NOFILE, &before);
  ExpectMessage(status, "cannot list", "nothing was changed");
  EXPECT_EQ(status.code(), StatusCode::kIo);
  EXPECT_EQ(alone.code(), StatusCode::kIo);
  EXPECT_TRUE(LoadNewestCheckpoint(context_, folder_).ok());
}

TEST_F(CheckpointTest, AFolderThatCannotBeListedIsNoNewRun) {
  std::filesystem::remove_all(folder_ / "checkpoints");
  EXPECT_EQ(LoadNewestCheckpoint(context_, folder_).status().code(), StatusCode::kNotFound);
  std::filesystem::create_symlink(folder_ / "checkpoints", folder_ / "checkpoints");
  ExpectMessage(LoadNewestCheckpoint(context_, folder_).status(), "checkpoints", "cannot list");
}

}  // namespace tilegrad::train::checkpoint_test
