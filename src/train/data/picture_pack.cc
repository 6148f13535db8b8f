// SPDX-License-Identifier: Apache-2.0
#include "train/data/picture_pack.h"

#include <chrono>
#include <fstream>
#include <thread>

#include "base/error.h"
#include "base/hash.h"
#include "base/parts_file.h"
#include "base/try_all.h"
#include "io/archive.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

constexpr auto kPause = std::chrono::milliseconds(200);

std::size_t BytesOfModel(const DatasetInfo& info) {
  const auto size = static_cast<std::size_t>(info.image_size);
  return 4 * size * size * static_cast<std::size_t>(info.views);
}

std::vector<int> AllModels(const Dataset& dataset) {
  std::vector<int> all(dataset.models().size());
  for (std::size_t m = 0; m < all.size(); ++m) all[m] = static_cast<int>(m);
  return all;
}

// The line at the end of the file.
Result<std::string> LastLine(const Dataset& dataset, const Workers& workers) {
  std::vector<std::string> prints(dataset.models().size());
  const auto read = [&](std::size_t m, std::size_t) -> Status {
    TILEGRAD_ASSIGN(prints[m], io::ZipFingerprint(dataset.ModelPath(static_cast<int>(m))));
    return {};
  };
  TILEGRAD_TRY(TryAll(workers, prints.size(), read));
  Hash all;
  for (const auto& print : prints) all.Add(print);
  return fmt::format("\ntilegrad-pictures-1 {}\n", all.Text());
}

bool EndsWith(const Path& file, std::size_t size, const std::string& line) {
  std::error_code error;
  if (std::filesystem::file_size(file, error) != size + line.size() || error) return false;
  std::ifstream in(file, std::ios::binary);
  std::string found(line.size(), '\0');
  in.seekg(static_cast<std::streamoff>(size));
  return in.read(found.data(), static_cast<std::streamsize>(found.size())) && found == line;
}

Status WritePack(const Dataset& dataset, const std::string& line, const Workers& workers,
                 const Watch& watch, PartsFile* file) {
  const std::size_t each = BytesOfModel(dataset.info());
  const std::vector<int> all = AllModels(dataset);
  TILEGRAD_TRY(UnpackPictures(dataset, all, workers, watch, [&](std::size_t m, auto images) {
    return file->Write(m * each, images);
  }));
  const auto* const end = reinterpret_cast<const std::uint8_t*>(line.data());
  TILEGRAD_TRY(file->Write(all.size() * each, {end, line.size()}));
  return file->Finish();
}

}  // namespace

Status UnpackPictures(const Dataset& dataset, const std::vector<int>& models,
                      const Workers& workers, const Watch& watch,
                      FunctionRef<Status(std::size_t, std::span<const std::uint8_t>)> take) {
  const auto load = [&](std::size_t i, std::size_t) -> Status {
    TILEGRAD_ASSIGN(const auto images, dataset.LoadImages(models[i]));
    return take(i, images);
  };
  const Status loaded = TryAll(workers, models.size(), {"loading images", watch}, load);
  return watch.stopped() ? Cancelled("stopped while loading the dataset") : loaded;
}

Result<std::optional<ScratchBytes>> OpenPicturePack(const Dataset& dataset, const Workers& workers,
                                                    const Watch& watch) {
  const Path file = PicturesPath(dataset.folder());
  const std::size_t size = dataset.models().size() * BytesOfModel(dataset.info());
  TILEGRAD_ASSIGN(const std::string line, LastLine(dataset, workers));
  for (; !watch.stopped(); std::this_thread::sleep_for(kPause)) {
    if (EndsWith(file, size, line)) {
      TILEGRAD_ASSIGN(ScratchBytes mapped, ScratchBytes::OfFile(file, size));
      return std::optional(std::move(mapped));
    }
    const auto lock = FolderLock::Take(dataset.folder());
    if (lock.status().code() == StatusCode::kInvalidArgument) continue;
    RemoveTemporariesOf(file);
    auto created = PartsFile::Create(file, size + line.size());
    if (!created.ok()) return std::optional<ScratchBytes>();
    TILEGRAD_TRY(WritePack(dataset, line, workers, watch, &*created));
  }
  return Cancelled("stopped while loading the dataset");
}

}  // namespace tilegrad::train
