// SPDX-License-Identifier: Apache-2.0
#include "cli/photograph_sets.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_guard.h"
#include "cli/console.h"
#include "train/data/photographs/collect.h"

namespace tilegrad::cli {
namespace {

void PrintSummary(const train::CollectionSummary& summary, const Path& folder) {
  const auto [training, validation, test] = summary.photographs;
  Print("{}", summary.broken.Summary());
  for (const auto& [what, count] : summary.notes) Print("{:>7}  {}\n", count, what);
  Print("{} training, {} validation and {} test photographs in {}\n", training, validation, test,
        folder.string());
  PrintResult({{"folder", folder.string()},
               {"training", training},
               {"validation", validation},
               {"test", test}});
}

// A folder without annotations is one of an interrupted call, if it has pictures.
Status CheckOut(const Path& folder, const std::string& source, bool force) {
  const Path pictures = folder / (source == "cub" ? "images" : "Images");
  if (IsFolder(pictures) && !PathExists(folder / "data")) return {};
  return OutputGuard(force).CheckFolder(folder);
}

Status MakeSet(const train::CollectionJob& job, const Path& folder, const Workers& workers,
               bool force) {
  TILEGRAD_TRY(CheckOut(folder, job.source, force));
  ProgressLine line;
  const auto made = train::CollectPhotographs(job, folder, workers, line.Watching());
  line.Finish();
  if (!made.ok()) return made.status();
  PrintSummary(*made, folder);
  return {};
}

}  // namespace

bool IsPhotographSource(const std::string& source) {
  return source == "cub" || source == "pascal3d";
}

Status MakePhotographSets(const PhotographSetOptions& options) {
  const bool pascal = options.source == "pascal3d";
  if (options.input.empty())
    return InvalidArgument("--source {} needs --input FOLDER", options.source);
  if (!pascal && !(options.classes.empty() && options.masks.empty()))
    return InvalidArgument("--classes, --masks: --source {} has one class, and masks",
                           options.source);
  std::vector<std::string> classes = options.classes;
  if (classes.empty()) classes = {"car"};
  const Path out = options.out.empty() ? Path("datasets") / options.source : Path(options.out);
  const Workers workers(options.workers);
  std::size_t made = 0;
  for (const std::string& name : classes) {
    const train::CollectionJob job{options.source, options.input, name, options.masks,
                                   options.allow_broken};
    Status status = MakeSet(job, classes.size() > 1 ? out / name : out, workers, options.force);
    const bool empty = status.code() == StatusCode::kNotFound && classes.size() > 1;
    if (!status.ok() && !empty) return status;
    if (empty) Print("left out: {}\n", status.message());
    made += empty ? 0 : 1;
  }
  return made > 0 ? Status() : NotFound("{}: none of the classes has photographs", options.input);
}

}  // namespace tilegrad::cli
