// SPDX-License-Identifier: Apache-2.0
#include "train/report/report.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "train/report/assets.h"
#include "train/report/html.h"
#include "train/report/page_data.h"
#include "train/report/sections.h"
#include "train/run/trained_models.h"

namespace tilegrad::train {
namespace {

Result<std::string> Page(const ReportFacts& facts) {
  TILEGRAD_ASSIGN(const std::string models, ModelsHtml(facts));
  return FillTemplate(kReportHtml,
                      {{"name", EscapeHtml(facts.run.config.name)},
                       {"summary", SummaryHtml(facts)},
                       {"comparison", ComparisonHtml(facts)},
                       {"models", models},
                       {"scores", ScoresHtml(facts)},
                       {"commands", CommandsHtml(facts)},
                       {"config", EscapeHtml(facts.run.config_text)},
                       {"machine", MachineHtml(facts)},
                       {"credits", CreditsHtml(facts)},
                       {"data", ScriptJson(PageData(facts.run, *facts.dataset, facts.models))},
                       {"style", std::string(kReportCss)},
                       {"script", std::string(kReportJs)}});
}

}  // namespace

Result<ReportSummary> WriteReport(const ReportJob& job, const Workers& workers,
                                  const ProgressSink& progress, const StopFlag& stop) {
  ReportFacts facts;
  TILEGRAD_ASSIGN(facts.run, ReadRun(job.run));
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(job.data));
  TILEGRAD_TRY(CheckHeldOut(job.run, dataset));
  facts.dataset = &dataset;
  facts.data = job.data.string();
  TILEGRAD_ASSIGN(facts.evaluation, ReadEvaluation(job.run, dataset));
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(job.run, workers));
  facts.predictor = predictor.description();
  const std::vector<int> chosen = ChooseModels(dataset, job.models);
  for (const int model : chosen) {
    if (stop) return Cancelled("stopped while predicting; nothing was written");
    TILEGRAD_ASSIGN(ShownModel shown, MakeShownModel(dataset, model, predictor, workers));
    facts.models.push_back(std::move(shown));
    if (progress) progress({"predicting", facts.models.size(), chosen.size(), ""});
  }
  TILEGRAD_ASSIGN(const std::string page, Page(facts));
  TILEGRAD_TRY(WriteTextAtomic(job.out, page));
  return ReportSummary{page.size(), static_cast<int>(facts.models.size()),
                       facts.evaluation.has_value(), predictor.warnings()};
}

}  // namespace tilegrad::train
