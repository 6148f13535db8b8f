// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/scores.h"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "nn/nn.h"
#include "render/picture/composite.h"
#include "train/data/trained_models.h"
#include "train/losses/l1.h"
#include "train/tasks/classify/perceptual_network.h"

namespace tilegrad::train {
namespace {

constexpr std::int64_t kJudgedAtOnce = 16;  // objects
constexpr std::int64_t kColorCells = 4;     // to a plane: Frechet distances of wide rows take long
constexpr double kLeastDeviation = 0.05;
constexpr int kFirstLevel = 3;  // of the classifier: what lies before compares little but pixels

// 1 for columns that vary within the truth. The others are cells at the edge of what any object
// covers: standardised, they would dominate all distances.
std::vector<std::uint8_t> VariedColumns(const FeatureRows& truth) {
  std::vector<std::uint8_t> out(truth.width);
  const auto n = static_cast<double>(truth.rows());
  for (std::size_t c = 0; c < truth.width; ++c) {
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < truth.rows(); ++i) {
      const double x = truth.Row(i)[c];
      sum += x;
      squares += x * x;
    }
    out[c] = squares / n - (sum / n) * (sum / n) > kLeastDeviation * kLeastDeviation;
  }
  return out;
}

// Sets all other columns to 0.
FeatureRows Only(FeatureRows rows, const std::vector<std::uint8_t>& columns) {
  for (std::size_t i = 0; i < rows.values.size(); ++i) {
    if (columns[i % rows.width] == 0) rows.values[i] = 0;
  }
  return rows;
}

// Features of pictures: the cells of each view, or the levels of a classifier, averaged over the
// pixels of all views.
class GanJudge {
 public:
  // `run`: of task.kind = "classify"; empty: cells.
  static Result<GanJudge> Make(nn::Context& context, const Path& run) {
    GanJudge out(context);
    if (run.empty()) return out;
    TILEGRAD_ASSIGN(out.network_, LoadPerceptualNetwork(context, {"classify", run, kFirstLevel}));
    return out;
  }

  // In words.
  std::string name() const {
    return network_ ? "the levels of a classifier"
                    : "mean and deviation of colours in 4 x 4 cells of each view";
  }

  Result<FeatureRows> Pictures(const ObjectViews& set) const {
    if (network_) return Levels(set);
    return ColorFeatures(set, kColorCells);
  }

 private:
  explicit GanJudge(nn::Context& context) : context_(context) {}

  Result<FeatureRows> Levels(const ObjectViews& set) const {
    const nn::NoGrad off(context_);
    const nn::Shape& shape = set.colors.shape();
    FeatureRows out;
    const nn::Var all = nn::Constant(context_, set.colors);
    for (std::int64_t i = 0; i < shape[0]; i += kJudgedAtOnce) {
      const std::int64_t end = std::min(shape[0], i + kJudgedAtOnce);
      const nn::Var some = nn::Reshape(nn::Slice(all, 0, i, end), {-1, 3, shape[2], shape[3]});
      std::vector<nn::Var> means;
      for (const nn::Var& level : network_(some)) means.push_back(nn::Mean(level, {2, 3}));
      const nn::Var rows = nn::Reshape(nn::Concat(means, 1), {end - i, shape[1] / 3, -1});
      const nn::Var mean = nn::Mean(rows, {1});  // over the views
      TILEGRAD_TRY(context_.TakeStatus());
      out.width = static_cast<std::size_t>(mean.shape()[1]);
      const auto numbers = mean.value().span<float>();
      out.values.insert(out.values.end(), numbers.begin(), numbers.end());
    }
    return out;
  }

  nn::Context& context_;
  FeatureFunction network_;
};

constexpr std::int64_t kAtOnce = 16;
constexpr std::size_t kShown = 8;
constexpr std::uint64_t kFarNumber = std::uint64_t{1} << 41;  // draws that training never sees

void Append(const nn::Tensor& from, std::int64_t at, nn::Tensor* to) {
  const std::span<const float> numbers = from.span<float>();
  std::ranges::copy(numbers, to->data<float>() + static_cast<std::size_t>(at) * numbers.size() /
                                                     static_cast<std::size_t>(from.shape()[0]));
}

class Scorer {
 public:
  Scorer(GeneratorModel& model, const GanScoreJob& job)
      : context_(model.context()), model_(model), job_(job) {}

  Result<GanScores> Run(const Watch& watch) {
    TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(job_.data));
    TILEGRAD_TRY(CheckHeldOut(job_.run, dataset));
    TILEGRAD_ASSIGN(GanJudge judge, GanJudge::Make(context_, job_.judge));
    judge_ = std::make_unique<GanJudge>(std::move(judge));
    TILEGRAD_ASSIGN(const ObjectViews train, True(dataset, Split::kTrain, watch));
    TILEGRAD_ASSIGN(const ObjectViews test, True(dataset, Split::kTest, watch));
    step_.emplace(context_, model_.config(), dataset.info().camera);
    TILEGRAD_ASSIGN(const ObjectViews made, Generated(false));
    out_.judge = judge_->name();
    out_.truth = SpreadOf(train, context_.workers());
    TILEGRAD_TRY(Compare(train, made, &out_.trained));
    TILEGRAD_TRY(Compare(test, made, &out_.held_out));
    return Remember(made, test, train);
  }

 private:
  // Twice `count`, for the floor.
  Result<ObjectViews> True(const Dataset& dataset, Split split, const Watch& watch) {
    const GanConfig& config = model_.config();
    const std::vector<int> models = dataset.Select(split);
    if (models.empty())
      return InvalidArgument("{}: a split has no models", dataset.folder().string());
    TILEGRAD_ASSIGN(
        const MeshCache meshes,
        OpenTexturedMeshes(dataset, models, config.stream.meshes, context_.workers(), watch));
    RealPictures pictures(
        context_,
        {config.stream, dataset.info().camera, config.views, dataset.info().image_size,
         static_cast<std::uint64_t>(config.schedule.seed)},
        meshes);
    return pictures.Draw({kFarNumber, 2 * job_.count});
  }

  // With `mean`, the mean map on every shape: the score of the shapes alone.
  Result<ObjectViews> Generated(bool mean) {
    ObjectViews out;
    for (std::int64_t at = 0; at < job_.count; at += kAtOnce) {
      const std::int64_t end = std::min<std::int64_t>(job_.count, at + kAtOnce);
      std::vector<float> codes;
      for (std::int64_t i = at; i < end; ++i) {
        const auto code = model_.Code(job_.seed, static_cast<std::uint64_t>(i));
        codes.insert(codes.end(), code.begin(), code.end());
      }
      const nn::Tensor noise = context_.From({end - at, model_.noise()}, codes);
      const ObjectViews some = step_->Show(model_.network(), noise,
                                           mean ? GanStep::Texture::kMean : GanStep::Texture::kOwn);
      TILEGRAD_TRY(context_.TakeStatus());
      if (at == 0) out = SetOf(some, job_.count);
      Append(some.colors, at, &out.colors);
      Append(some.cover, at, &out.cover);
    }
    return out;
  }
  ObjectViews SetOf(const ObjectViews& like, std::int64_t count) const {
    nn::Shape colors = like.colors.shape(), cover = like.cover.shape();
    colors[0] = cover[0] = count;
    return {context_.Empty(colors), context_.Empty(cover)};
  }

  Status Compare(const ObjectViews& truth, const ObjectViews& made,
                 std::vector<GanScoreRow>* rows) {
    TILEGRAD_ASSIGN(const FeatureRows pictures, judge_->Pictures(truth));
    const FeatureRows shapes = CoverFeatures(truth);
    TILEGRAD_TRY(Add("generator", {pictures, shapes}, made, rows));
    if (!model_.has_textures()) return {};
    TILEGRAD_ASSIGN(const ObjectViews mean, Generated(true));
    return Add("its shapes, mean texture", {pictures, shapes}, mean, rows);
  }

  struct Truth {
    const FeatureRows &pictures, &shapes;
  };
  Status Add(const std::string& method, const Truth& truth, const ObjectViews& made,
             std::vector<GanScoreRow>* rows) {
    const Workers& workers = context_.workers();
    TILEGRAD_ASSIGN(const FeatureRows pictures, judge_->Pictures(made));
    const auto varied = VariedColumns(truth.pictures), covered = VariedColumns(truth.shapes);
    TILEGRAD_ASSIGN(
        const SetScores of_pictures,
        ScoreSets(Only(truth.pictures, varied), Only(pictures, varied), job_.seed, workers));
    TILEGRAD_ASSIGN(const SetScores of_shapes,
                    ScoreSets(Only(truth.shapes, covered), Only(CoverFeatures(made), covered),
                              job_.seed, workers));
    Spread spread = SpreadOf(made, workers);
    spread.shapes /= out_.truth.shapes;
    spread.colors /= out_.truth.colors;
    if (rows->empty())
      rows->push_back({"true objects (floor)", of_pictures.floor, of_shapes.floor, {1, 1}});
    rows->push_back({method, of_pictures.generated, of_shapes.generated, spread});
    out_.n = of_pictures.n;
    return {};
  }

  Result<GanScores> Remember(const ObjectViews& made, const ObjectViews& test,
                             const ObjectViews& train) {
    TILEGRAD_ASSIGN(const FeatureRows samples, judge_->Pictures(made));
    TILEGRAD_ASSIGN(const FeatureRows held_out, judge_->Pictures(test));
    TILEGRAD_ASSIGN(const FeatureRows known, judge_->Pictures(train));
    const auto varied = VariedColumns(known);
    const auto scaled = [&](const FeatureRows& rows) {
      return Standardised(Only(rows, varied), Only(known, varied));
    };
    TILEGRAD_ASSIGN(out_.memorisation, MeasureMemorisation(scaled(samples), scaled(held_out),
                                                           scaled(known), context_.workers()));
    std::vector<ImageU8> cells;
    for (std::size_t i = 0; i < std::min<std::size_t>(kShown, samples.rows()); ++i) {
      AddViews(made, i, &cells);
      AddViews(train, out_.memorisation.samples[i].row, &cells);
    }
    out_.nearest = TileImages(cells, 4, 2);
    return std::move(out_);
  }

  // The side and the last view, enlarged.
  static void AddViews(const ObjectViews& set, std::size_t object, std::vector<ImageU8>* cells) {
    const auto views = static_cast<std::size_t>(set.cover.shape()[1]);
    const auto size = static_cast<std::size_t>(set.cover.shape()[3]), plane = size * size;
    for (const std::size_t view : {std::min<std::size_t>(1, views - 1), views - 1}) {
      const std::size_t at = object * views + view;
      const auto rgb = set.colors.span<float>().subspan(3 * plane * at, 3 * plane);
      const auto alpha = set.cover.span<float>().subspan(plane * at, plane);
      cells->push_back(Enlarged(
          OverGrey(PlanarRgba<float>{rgb, alpha, static_cast<int>(size), static_cast<int>(size)},
                   kPaper),
          2));
    }
  }

  nn::Context& context_;
  GeneratorModel& model_;
  const GanScoreJob& job_;
  std::unique_ptr<GanJudge> judge_;
  std::optional<GanStep> step_;
  GanScores out_;
};

std::string RowText(const GanScoreRow& row) {
  const SetScore &p = row.pictures, &s = row.shapes;
  return fmt::format(
      "| {} | {:.3g} | {:.3g} | {:.2f} | {:.2f} | {:.3g} | {:.2f} | {:.2f} | {:.0f} % | {:.0f} % "
      "|\n",
      row.method, p.frechet, p.kernel, p.coverage.precision, p.coverage.recall, s.kernel,
      s.coverage.precision, s.coverage.recall, 100 * row.spread.shapes, 100 * row.spread.colors);
}

nlohmann::ordered_json JsonOf(const SetScore& score) {
  return {{"frechet", score.frechet},
          {"kernel", score.kernel},
          {"precision", score.coverage.precision},
          {"recall", score.coverage.recall}};
}

nlohmann::ordered_json JsonOf(const std::vector<GanScoreRow>& rows) {
  auto out = nlohmann::ordered_json::array();
  for (const GanScoreRow& row : rows)
    out.push_back({{"method", row.method},
                   {"pictures", JsonOf(row.pictures)},
                   {"shapes", JsonOf(row.shapes)},
                   {"spread_shapes", row.spread.shapes},
                   {"spread_colors", row.spread.colors}});
  return out;
}

}  // namespace

Result<GanScores> ScoreGenerator(GeneratorModel& model, const GanScoreJob& job,
                                 const Watch& watch) {
  return Scorer(model, job).Run(watch);
}

std::string FormatScores(const GanScores& scores) {
  std::string out = fmt::format(
      "{} objects on each side; pictures by {}, shapes by the cover of 8 x 8 cells of each view; "
      "spread as a share of the training objects'.\n",
      scores.n, scores.judge);
  for (const auto& [title, rows] : {std::pair("training shapes, drawn anew", &scores.trained),
                                    std::pair("held-out shapes", &scores.held_out)}) {
    out += fmt::format(
        "\n| against {} | Frechet | kernel | precision | recall | shapes: kernel | precision | "
        "recall | spread of shapes | of colours |\n| --- | --: | --: | --: | --: | --: | --: | --: "
        "| --: | --: |\n",
        title);
    for (const GanScoreRow& row : *rows) out += RowText(row);
  }
  const Memorisation& m = scores.memorisation;
  out += fmt::format(
      "\nDistance to the nearest training picture, median: samples {:.3g}, held-out objects "
      "{:.3g}; a sample is the nearer one of the two with probability {:.2f}.\n",
      m.sample_median, m.held_out_median, m.nearer);
  return out;
}

nlohmann::ordered_json ScoresJson(const GanScores& scores) {
  const Memorisation& m = scores.memorisation;
  return {
      {"n", scores.n},
      {"judge", scores.judge},
      {"truth", {{"spread_shapes", scores.truth.shapes}, {"spread_colors", scores.truth.colors}}},
      {"trained", JsonOf(scores.trained)},
      {"held_out", JsonOf(scores.held_out)},
      {"memorisation",
       {{"sample_median", m.sample_median},
        {"held_out_median", m.held_out_median},
        {"nearer", m.nearer}}}};
}

}  // namespace tilegrad::train
