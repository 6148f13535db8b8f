// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "proof/tradeoff_study.h"
#include "train/eval/evaluate.h"
#include "train/models/predictor.h"
#include "train/trainer.h"

namespace tilegrad::cli {
namespace {

Result<train::Evaluation> EvaluateRun(const Path& run, const Path& data, const Workers& workers,
                                      const ProgressSink& progress, const StopFlag& stop) {
  TILEGRAD_ASSIGN(const train::Dataset dataset, train::Dataset::Open(data));
  TILEGRAD_ASSIGN(const train::Predictor predictor, train::Predictor::Load(run, workers));
  train::EvaluationJob job;
  job.dataset = &dataset;
  job.predict = [&](std::span<const std::uint8_t> images) { return predictor.Predict(images); };
  job.template_mesh = predictor.template_mesh();
  job.predictor = predictor.description();
  return train::Evaluate(job, workers, progress, stop);
}

Result<StudyTraining> TrainWith(const TrainingStudyJob& study, double error, const Workers& workers,
                                const ProgressSink& progress, const StopFlag& stop) {
  train::TrainJob job;
  TILEGRAD_ASSIGN(job.config, train::ReadConfig(study.config));
  job.config.render.max_alpha_error = error;
  job.config.schedule.steps = study.steps;
  job.data = study.data;
  job.run = study.out / fmt::format("training_{:g}", error);
  job.existing = train::ExistingRun::kContinue;
  job.warn = study.warn;
  TILEGRAD_ASSIGN(const train::TrainOutcome outcome, train::Train(job, workers, progress, stop));
  TILEGRAD_ASSIGN(const train::Evaluation evaluation,
                  EvaluateRun(job.run, study.data, workers, progress, stop));
  const train::Score& mean = evaluation.rows.back().mean;
  return StudyTraining{error, outcome.seconds, outcome.last_step, mean.iou,
                       mean.f_score.value_or(0)};
}

}  // namespace

Status CheckTrainingStudy(const TrainingStudyJob& job) {
  if (auto dataset = train::Dataset::Open(job.data); !dataset.ok()) return dataset.status();
  return train::ReadConfig(job.config).status();
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
