// SPDX-License-Identifier: Apache-2.0
// Figures 7 and 8 of the paper in numbers and pictures: what a trained network of task.kind =
// "textured_image" says of one held-out object under eight lights, from eight views, and at several
// values of shininess. A texture that were free of light and view would not change at all.
//
//   separation_study runs/textured datasets/cars separation
//
// prints a table and writes separation_lights.png, separation_views.png and, of a Phong run,
// separation_shininess.png: a row for the input, then texture + light, texture and light.
#include <fmt/core.h>

#include <cmath>
#include <cstdlib>
#include <numbers>

#include "base/error.h"
#include "io/image_file.h"
#include "render/picture/composite.h"
#include "train/predictor.h"
#include "train/tasks/held_out.h"
#include "train/tasks/textured_image/held_out_views.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"
#include "train/tasks/textured_image/step.h"

namespace tilegrad::train {
namespace {

constexpr int kModels = 8, kChanges = 8, kZoom = 2;

enum class Change { kLights, kViews, kShininess };

// Lights on a ring, 50 degrees from the camera's axis.
DrawnLight RingLight(const DrawnLight& like, const LightConfig& config, int k) {
  const double turn = 2 * std::numbers::pi * k / kChanges, tilt = 50 * std::numbers::pi / 180;
  DrawnLight light = like;
  light.direction = {static_cast<float>(std::sin(tilt) * std::cos(turn)),
                     static_cast<float>(std::sin(tilt) * std::sin(turn)),
                     static_cast<float>(std::cos(tilt))};
  light.sh = SkyAndLight((config.sky_low + config.sky_high) / 2, light.direction);
  return light;
}

// `drawn`: eight views of one object.
std::vector<TexturedView> Changed(const std::vector<TexturedView>& drawn, Change change,
                                  const LightConfig& light) {
  std::vector<TexturedView> out = drawn;
  for (int k = 0; k < kChanges; ++k) {
    TexturedView& view = out[static_cast<std::size_t>(k)];
    if (change != Change::kViews) view.camera = drawn[0].camera;
    view.light = RingLight(drawn[0].light, light, change == Change::kLights ? k : 1);
    if (change != Change::kShininess) continue;
    view.light.shininess = static_cast<float>(light.shininess_low *
                                              std::pow(light.shininess_high / light.shininess_low,
                                                       static_cast<double>(k) / (kChanges - 1)));
  }
  return out;
}

// Sums over models; means when printed.
struct Tally {
  double spread = 0, texture_l1 = 0, angle = 0, shininess = 0;
  int models = 0;
};

class Study {
 public:
  Study(const TexturedImageConfig& config, const Dataset& dataset, TexturedModel& model)
      : config_(config),
        size_(dataset.info().image_size),
        model_(model),
        pictures_(config.light, size_, static_cast<int>(config.stream.draw.samples)) {}

  // Rows of pictures of the first model that comes.
  Status Add(const HeldOutViews::Views& truth) {
    TILEGRAD_ASSIGN(const auto objects, model_.PredictObjects(ToBytes(truth.lit)));
    std::vector<std::vector<float>> textures;
    for (std::size_t k = 0; k < objects.size(); ++k) {
      TexturedView view = truth.views[k];
      // All seen by the first camera: textures are compared, not views.
      TILEGRAD_ASSIGN(auto same,
                      pictures_.Draw(objects[k].mesh, truth.views[0], Appearance::kTexture));
      textures.push_back(std::move(same));
      const Lighting lighting = LightingOf(config_.light);
      tally_.angle +=
          AngleBetween(DirectionOf(objects[k].light, lighting), DirectionOf(view.light, lighting)) /
          kChanges;
      tally_.shininess +=
          std::abs(std::log(objects[k].light.shininess / view.light.shininess)) / kChanges;
      view.light = objects[k].light;
      if (tally_.models == 0) TILEGRAD_TRY(Show(objects[k], view, truth, k));
    }
    Compare(textures, truth.Of(truth.texture, 0));
    ++tally_.models;
    return {};
  }
  const Tally& tally() const { return tally_; }
  ImageU8 Sheet() const {
    std::vector<ImageU8> cells;
    for (const auto& row : rows_) cells.insert(cells.end(), row.begin(), row.end());
    return TileImages(cells, kChanges, 2);
  }

 private:
  Status Show(const PredictedObject& object, const TexturedView& view,
              const HeldOutViews::Views& truth, std::size_t k) {
    const auto add = [&](std::size_t row, std::span<const float> rgba) {
      rows_[row].push_back(Enlarged(OnPaper(rgba, size_), kZoom));
    };
    add(0, truth.Of(truth.lit, k));
    for (const auto& [row, appearance] :
         {std::pair(1, Appearance::kLit), {2, Appearance::kTexture}, {3, Appearance::kLight}}) {
      TILEGRAD_ASSIGN(const auto rgba, pictures_.Draw(object.mesh, view, appearance));
      add(static_cast<std::size_t>(row), rgba);
    }
    add(4, truth.Of(truth.light, k));
    return {};
  }
  // Mean |difference| over the image: of the textures from their mean, and from the truth.
  void Compare(const std::vector<std::vector<float>>& textures, std::span<const float> truth) {
    const std::size_t numbers = truth.size() / 4 * 3;
    const auto count = static_cast<double>(textures.size());
    for (std::size_t i = 0; i < numbers; ++i) {
      double mean = 0;
      for (const auto& texture : textures) mean += static_cast<double>(texture[i]) / count;
      for (const auto& texture : textures) {
        const double scale = 1 / (count * static_cast<double>(numbers));
        tally_.spread += scale * std::abs(static_cast<double>(texture[i]) - mean);
        tally_.texture_l1 +=
            scale * std::abs(static_cast<double>(texture[i]) - static_cast<double>(truth[i]));
      }
    }
  }

  const TexturedImageConfig& config_;
  int size_;
  TexturedModel& model_;
  ObjectPictures pictures_;
  Tally tally_;
  std::vector<ImageU8> rows_[5];
};

struct Job {
  const TexturedImageConfig& config;
  const Dataset& dataset;
  TexturedModel& model;
  HeldOutViews& held_out;
  std::string out;
};

Status Run(const Job& job, Change change, const char* name) {
  Study study(job.config, job.dataset, job.model);
  for (std::size_t i = 0; i < job.held_out.models().size(); ++i) {
    TILEGRAD_ASSIGN(const auto drawn, job.held_out.Draw(i, kChanges));
    TILEGRAD_ASSIGN(const auto truth,
                    job.held_out.Show(i, Changed(drawn.views, change, job.config.light)));
    TILEGRAD_TRY(study.Add(truth));
  }
  const Tally& t = study.tally();
  const bool phong = LightingOf(job.config.light) == Lighting::kPhong;
  fmt::print("| {} | {:.4f} | {:.4f} | {:.1f} | {} |\n", name, t.spread / t.models,
             t.texture_l1 / t.models, t.angle / t.models,
             phong ? fmt::format("{:.2f}", t.shininess / t.models) : "");
  return io::SavePng(fmt::format("{}_{}.png", job.out, name), study.Sheet());
}

Status RunAll(const Path& run, const Path& folder, const std::string& out) {
  const Workers workers;
  TILEGRAD_ASSIGN(const Predictor predictor, Predictor::Load(run, workers));
  auto* model = predictor.model().textured();
  if (model == nullptr)
    return InvalidArgument("{}: not of task.kind = \"textured_image\"", run.string());
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder));
  TILEGRAD_TRY(predictor.CheckImageSize(dataset));
  const TexturedImageConfig& config = model->config();
  TILEGRAD_ASSIGN(
      HeldOutViews held_out,
      HeldOutViews::Load({config, dataset, ChooseModels(dataset, kModels)}, workers, {}));
  const Job job{config, dataset, *model, held_out, out};
  fmt::print(
      "| what changes | spread of the texture | texture L1 | angle of the light | "
      "ln shininess off by |\n| --- | --: | --: | --: | --: |\n");
  TILEGRAD_TRY(Run(job, Change::kLights, "lights"));
  TILEGRAD_TRY(Run(job, Change::kViews, "views"));
  if (LightingOf(config.light) != Lighting::kPhong) return {};
  return Run(job, Change::kShininess, "shininess");
}

}  // namespace
}  // namespace tilegrad::train

int main(int argc, char** argv) {
  if (argc != 4) {
    fmt::print(stderr, "usage: {} RUN DATASET OUT\n", argv[0]);
    return EXIT_FAILURE;
  }
  const tilegrad::Status status = tilegrad::train::RunAll(argv[1], argv[2], argv[3]);
  if (status.ok()) return EXIT_SUCCESS;
  fmt::print(stderr, "{}\n", status.message());
  return EXIT_FAILURE;
}
