// SPDX-License-Identifier: Apache-2.0
// tilegrad report: one page about a run.
#include <nlohmann/json.hpp>

#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "train/data/trained_models.h"
#include "train/report/report.h"

namespace tilegrad::cli {
namespace {

struct ReportOptions {
  RunOptions on;
  std::string out;
  int models = 8;
  bool force = false;
};

// RUN/summary.png, or PAGE_summary.png beside a page that was named.
Path SheetBeside(const Path& page, bool in_run) {
  const std::string stem = in_run ? "" : page.stem().string() + "_";
  return page.parent_path() / (stem + "summary.png");
}

Status RunReport(const ReportOptions& options) {
  train::ReportJob job;
  TILEGRAD_ASSIGN(job.run, ChooseRun(options.on.run));
  TILEGRAD_ASSIGN(job.data, ChooseDataset(options.on.data, job.run));
  job.out = options.out.empty() ? job.run / "report.html" : Path(options.out);
  job.sheet = SheetBeside(job.out, options.out.empty());
  job.models = options.models;
  const OutputGuard guard(options.force);
  const Path files[] = {job.out, job.sheet};
  if (!options.out.empty()) TILEGRAD_TRY(guard.CheckAll(files));  // else the run's own
  const Workers workers(options.on.workers);
  ProgressLine line;
  const auto summary = train::WriteReport(job, workers, line.Watching());
  line.Finish();
  if (!summary.ok()) return summary.status();
  TILEGRAD_TRY(train::WarnWithoutList(job.run, line.Warnings()));
  for (const std::string& warning : summary->warnings)
    PrintNote("tilegrad: warning: skipped: {}\n", warning);
  Print("{}: {}, {:.1f} MB; open it in a browser\n", job.out.string(),
        Count(static_cast<std::size_t>(summary->models), summary->thing),
        static_cast<double>(summary->bytes) / 1e6);
  if (!summary->sheet_columns.empty())
    Print("{}: the same in one image; columns: {}\n", job.sheet.string(), summary->sheet_columns);
  if (!summary->evaluated) Print("no scores yet: run tilegrad eval, then tilegrad report again\n");
  PrintResult({{"page", job.out.string()},
               {"sheet", summary->sheet_columns.empty() ? "" : job.sheet.string()},
               {"models", summary->models},
               {"bytes", summary->bytes},
               {"evaluated", summary->evaluated}});
  return {};
}

}  // namespace

void AddReport(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "report", "Report of a run on one page: scores, curves, images, interactive meshes",
      RunReport);
  AddRunOptions(command, &options->on);
  command->Add("--models", &options->models, "number of held-out models or photographs to show",
               {Range{0, 200}});
  command->Add("--out", &options->out,
               "output page [RUN/report.html]; the summary image becomes RUN/summary.png, or "
               "PAGE_summary.png beside the page",
               {EndsIn(".html")});
  AddForceOption(command, &options->force);
}

}  // namespace tilegrad::cli
