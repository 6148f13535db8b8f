// SPDX-License-Identifier: Apache-2.0
#include "train/report/report.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"
#include "io/image_file.h"
#include "train/predictor.h"
#include "train/report/html.h"
#include "train/report/page_data.h"
#include "train/report/sections.h"
#include "train/run/run_files.h"

namespace tilegrad::train {
namespace {

// run.json, config.toml, metrics.jsonl; errors name the file and the key or line.
Result<RunFacts> ReadRun(const Path& run) {
  RunFacts facts;
  facts.folder = run;
  TILEGRAD_ASSIGN(facts.header, ReadHeader(run));
  const Path config = run / kTrainSettings;
  TILEGRAD_ASSIGN(facts.config_text, ReadText(config));
  TILEGRAD_ASSIGN(facts.config, ParseConfig(facts.config_text, config.string()));
  TILEGRAD_ASSIGN(facts.log, ReadLog(run));
  return facts;
}

Result<std::string> Page(const ReportFacts& facts) {
  TILEGRAD_ASSIGN(const std::string models, ModelsHtml(facts));
  const bool made = facts.showcase.generated;
  return FillTemplate(
      kReportHtml,
      {{"name", EscapeHtml(facts.run.config.name)},
       {"summary", SummaryHtml(facts)},
       {"comparison", ComparisonHtml(facts)},
       {"meshes_title", made ? "Generated meshes, interactive" : "Predicted meshes, interactive"},
       {"models_title", made ? "Generated objects" : "Held-out models"},
       {"models", models},
       {"scores", ScoresHtml(facts)},
       {"commands", CommandsHtml(facts)},
       {"config", EscapeHtml(facts.run.config_text)},
       {"machine", MachineHtml(facts)},
       {"credits", CreditsHtml(facts)},
       {"data", ScriptJson(PageData(facts))},
       {"style", std::string(kReportCss)},
       {"script", std::string(kPartsJs) + std::string(kReportJs)}});
}

}  // namespace

Result<ReportSummary> WriteReport(const ReportJob& job, const Workers& workers,
                                  const ProgressSink& progress, const StopFlag& stop) {
  ReportFacts facts;
  TILEGRAD_ASSIGN(facts.run, ReadRun(job.run));
  facts.data = job.data.string();
  TILEGRAD_ASSIGN(facts.evaluation, ReadEvaluation(job.run));
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(job.run, workers));
  facts.predictor = predictor.description();
  facts.step = predictor.step();
  const ShowcaseRequest request{job.run, job.data, facts.run.header, predictor, job.models};
  TILEGRAD_ASSIGN(facts.showcase, predictor.task().Show(request, workers, progress, stop));
  TILEGRAD_ASSIGN(const std::string page, Page(facts));
  ReportSummary summary;
  summary.bytes = page.size();
  summary.models = static_cast<int>(facts.showcase.examples.size());
  summary.evaluated = facts.evaluation.has_value() || facts.showcase.generated;
  summary.warnings = predictor.warnings();
  RemoveTemporariesOf(job.out);  // of killed calls
  TILEGRAD_TRY(WriteTextAtomic(job.out, page));
  if (!job.sheet.empty() && !facts.showcase.sheet.empty()) {
    RemoveTemporariesOf(job.sheet);
    TILEGRAD_TRY(io::SavePng(job.sheet, facts.showcase.sheet));
    summary.sheet_columns = facts.showcase.sheet_columns;
  }
  return summary;
}

}  // namespace tilegrad::train
