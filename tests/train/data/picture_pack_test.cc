// SPDX-License-Identifier: Apache-2.0
#include "train/data/picture_pack.h"

#include "support/temp_folder.h"
#include "train/data/batches.h"
#include "train/data/dataset_files.h"
#include "train/tiny_run.h"

namespace tilegrad::train::picture_pack_test {

class PicturePack : public TempFolderTest {
 protected:
  void SetUp() override { ASSERT_TRUE(WriteNoiseDataset(Data()).ok()); }
  Path Data() const { return folder_ / "data"; }
  Path File() const { return PicturesPath(Data()); }
  static constexpr std::size_t kPack = 0, kMemory = ScratchBytes::kInMemory;

  Result<ImageStore> Load(std::size_t in_memory, Split split = Split::kTrain) const {
    const Dataset dataset = Ok(Dataset::Open(Data())).value();
    return LoadImageStore(dataset, dataset.Select(split), Workers(2), {nullptr, &stop_}, in_memory);
  }
  static void ExpectSame(const ImageStore& a, const ImageStore& b) {
    ASSERT_EQ(a.models, b.models);
    for (int m = 0; m < a.models; ++m) {
      for (int v = 0; v < a.views; ++v)
        EXPECT_TRUE(std::ranges::equal(a.Image(m, v), b.Image(m, v))) << m << ", " << v;
    }
  }
  // Another model in place of the first.
  void ReplaceModel() const {
    std::filesystem::copy_file(ModelFilePath(Data(), "noise", "m1"),
                               ModelFilePath(Data(), "noise", "m0"),
                               std::filesystem::copy_options::overwrite_existing);
  }

  StopFlag stop_ = false;
};

TEST_F(PicturePack, HoldsWhatTheModelFilesHold) {
  for (const Split split : {Split::kTrain, Split::kTest}) {
    const ImageStore memory = Ok(Load(kMemory, split)).value();
    ExpectSame(Ok(Load(kPack, split)).value(), memory);
  }
  EXPECT_TRUE(PathExists(File()));
}

TEST_F(PicturePack, FewPicturesNeedNone) {
  Ok(Load(kMemory).status());
  EXPECT_FALSE(PathExists(File()));
}

TEST_F(PicturePack, IsTakenAgain) {
  Ok(Load(kPack).status());
  const auto written = std::filesystem::last_write_time(File());
  Ok(Load(kPack, Split::kTest).status());
  EXPECT_EQ(std::filesystem::last_write_time(File()), written);
}

TEST_F(PicturePack, OfOtherModelFilesIsWrittenAnew) {
  const ImageStore before = Ok(Load(kPack)).value();
  ReplaceModel();
  ExpectSame(Ok(Load(kPack)).value(), Ok(Load(kMemory)).value());
  // Who has mapped the file before keeps what was in it.
  EXPECT_FALSE(std::ranges::equal(before.Image(0, 0), before.Image(1, 0)));
}

TEST_F(PicturePack, CutOffItIsWrittenAnew) {
  Ok(Load(kPack).status());
  std::filesystem::resize_file(File(), std::filesystem::file_size(File()) - 1);
  ExpectSame(Ok(Load(kPack)).value(), Ok(Load(kMemory)).value());
}

TEST_F(PicturePack, BrokenModelFilesAreNamedAndNothingIsLeft) {
  const Path model = ModelFilePath(Data(), "noise", "m3");
  Ok(WriteTextAtomic(model, "no zip"));
  ExpectMessage(Load(kPack).status(), "m3.npz");
  EXPECT_FALSE(PathExists(File()));
  EXPECT_FALSE(PathExists(TemporaryOf(File())));
}

// As where the disk is too full or may not be written to.
TEST_F(PicturePack, WithoutRoomPicturesAreUnpackedElsewhere) {
  std::filesystem::create_directory(TemporaryOf(File()));
  ExpectSame(Ok(Load(kPack)).value(), Ok(Load(kMemory)).value());
  EXPECT_FALSE(PathExists(File()));
}

TEST_F(PicturePack, StopsWhileAnotherProcessWrites) {
  const FolderLock writer = Ok(FolderLock::Take(Data())).value();
  stop_ = true;
  EXPECT_EQ(Load(kPack).status().code(), StatusCode::kCancelled);
}

TEST_F(PicturePack, GoesWithTheDataset) {
  Ok(Load(kPack).status());
  Ok(RemoveDataset(Data()));
  EXPECT_FALSE(PathExists(File()));
}

}  // namespace tilegrad::train::picture_pack_test
