// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/members.h"

#include <mutex>

#include "base/error.h"
#include "base/file.h"
#include "base/read_budget.h"
#include "io/image_file.h"

namespace tilegrad::train {

Status TakeMembers(const std::vector<std::string>& names, const MemberWork& work,
                   FunctionRef<Status(std::size_t, std::size_t)> take, BrokenMembers* broken) {
  const ShortageWatch shortage;
  std::vector<Status> failures(names.size());
  std::mutex mutex;
  std::uint64_t done = 0;
  work.workers.For(names.size(), [&](std::size_t i, std::size_t worker) {
    if (work.stop) return;
    failures[i] = take(i, worker);
    const std::scoped_lock lock(mutex);
    if (work.progress) work.progress({"reading photographs", ++done, names.size(), ""});
  });
  if (work.stop) return Cancelled("stopped while reading photographs");
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (failures[i].ok()) continue;
    TILEGRAD_TRY(shortage.Check(names[i]));
    if (failures[i].code() == StatusCode::kResourceExhausted) return failures[i];
    broken->Add(names[i], std::string(failures[i].message()));
  }
  return {};
}

Result<ImageSize> TakePicture(const Path& from, const Path& to) {
  TILEGRAD_ASSIGN(const io::StoredImage read, io::LoadStoredImage(from));
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(from));
  std::error_code error;
  if (std::filesystem::file_size(to, error) != bytes.size() || error)
    TILEGRAD_TRY(WriteFileAtomic(to, bytes));
  return ImageSize{read.image.width, read.image.height};
}

}  // namespace tilegrad::train
