// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "proof/tradeoff_study.h"
#include "train/named_configs.h"
#include "train/predictor.h"
#include "train/trainer.h"

namespace tilegrad::cli {
namespace {

Result<StudyTraining> TrainWith(const TrainingStudyJob& study, double error, const Workers& workers,
                                const ProgressSink& progress, const StopFlag& stop) {
  train::TrainJob job;
  TILEGRAD_ASSIGN(job.config, train::FindConfig(study.config));
  TILEGRAD_TRY(
      train::ApplyOverrides({fmt::format("render.max_alpha_error={}", error)}, &job.config));
  job.config.schedule.steps = study.steps;
  job.data = study.data;
  job.run = study.out / fmt::format("training_{:g}", error);
  job.existing = train::ExistingRun::kContinue;
  job.warn = study.warn;
  TILEGRAD_ASSIGN(const train::RunOutcome outcome, train::Train(job, workers, progress, stop));
  TILEGRAD_ASSIGN(const train::Predictor predictor, train::Predictor::Load(job.run, workers));
  TILEGRAD_ASSIGN(
      const train::Evaluation evaluation,
      predictor.task().Evaluate({job.run, study.data, predictor}, workers, progress, stop));
  const train::Score& mean = evaluation.rows.back().mean;
  return StudyTraining{error, outcome.seconds, outcome.last_step, mean.iou,
                       mean.f_score.value_or(0)};
}

}  // namespace

Status CheckTrainingStudy(const TrainingStudyJob& job) {
  if (auto dataset = train::Dataset::Open(job.data); !dataset.ok()) return dataset.status();
  return train::FindConfig(job.config).status();
}

Result<std::vector<StudyTraining>> RunTrainingStudy(const TrainingStudyJob& job,
                                                    const Workers& workers,
                                                    const ProgressSink& progress,
                                                    const StopFlag& stop) {
  std::vector<StudyTraining> out;
  for (const double error : job.errors) {
    TILEGRAD_ASSIGN(out.emplace_back(), TrainWith(job, error, workers, progress, stop));
  }
  return out;
}

}  // namespace tilegrad::cli
