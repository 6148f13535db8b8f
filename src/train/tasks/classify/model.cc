// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/classify/model.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>

#include "base/error.h"
#include "base/rng.h"
#include "render/picture/composite.h"
#include "train/data/dataset_files.h"
#include "train/eval/baselines.h"
#include "train/eval/statistics.h"
#include "train/predictor.h"
#include "train/ranks/process_group.h"
#include "train/tasks/held_out.h"

namespace tilegrad::train {
namespace {

constexpr const char* kClasses = "classes";  // their names, a line each

constexpr std::size_t kSearched = 1000;  // training models whose pictures are searched, at most

Status CheckClasses(const Dataset& dataset, const ClassifierModel& model) {
  if (dataset.info().classes == model.classes()) return {};
  return InvalidArgument("{}: its {} classes are not the {} that the network was trained on",
                         dataset.folder().string(), dataset.info().classes.size(),
                         model.classes().size());
}

Score Accuracy(std::span<const int> said, int truth) {
  Score score;
  score.accuracy = static_cast<double>(std::count(said.begin(), said.end(), truth)) /
                   static_cast<double>(said.size());
  return score;
}

class Examiner {
 public:
  Examiner(const Dataset& dataset, const TaskEvaluation& job, ClassifierModel& model,
           const Workers& workers, const Watch& watch)
      : data_(dataset),
        job_(job),
        model_(model),
        workers_(workers),
        watch_(watch),
        share_(job.group),
        views_(SpreadViews(dataset.info().views,
                           std::clamp(job.views_per_model, 1, dataset.info().views))) {}

  Result<Evaluation> Run() {
    const Split split = job_.split;
    const std::vector<int> models = data_.Select(split);
    if (models.empty())
      return InvalidArgument("{}: its {} split has no models; `tilegrad dataset` makes the splits",
                             data_.folder().string(), SplitName(split));
    TILEGRAD_TRY(LearnBaselines());
    for (auto* scores : {&frequent_, &retrieved_, &said_}) scores->resize(models.size());
    for (std::size_t i = 0; i < models.size(); ++i) {
      TILEGRAD_TRY(watch_.At({"evaluating", i, models.size(), ""}, kNothingWritten));
      if (share_.Has(i)) TILEGRAD_TRY(Examine(i, models[i]));
    }
    for (auto* scores : {&frequent_, &retrieved_, &said_}) TILEGRAD_TRY(share_.Gather(scores));
    out_.split = SplitName(split);
    Fill(models);
    return std::move(out_);
  }

 private:
  // A training model's own picture would be found.
  bool Retrieves() const { return job_.split != Split::kTrain; }

  Status LearnBaselines() {
    const std::vector<int> train = data_.Select(Split::kTrain);
    std::vector<int> counts(data_.info().classes.size(), 0);
    for (const int m : train) ++counts[static_cast<std::size_t>(data_.model(m).class_index)];
    most_frequent_ = static_cast<int>(std::ranges::max_element(counts) - counts.begin());
    const std::size_t searched = Retrieves() ? std::min(train.size(), kSearched) : 0;
    for (std::size_t i = 0; i < searched; ++i) {
      TILEGRAD_TRY(watch_.At({"training pictures", i, searched, ""}, kNothingWritten));
      const int model = train[i * train.size() / searched];
      TILEGRAD_ASSIGN(const auto images, data_.LoadImages(model));
      index_.Add(images, data_.info().views, data_.info().image_size);
      searched_.push_back(data_.model(model).class_index);
    }
    out_.retrieval_models = static_cast<int>(searched);
    return {};
  }

  Status Examine(std::size_t i, int model) {
    const int truth = data_.model(model).class_index;
    TILEGRAD_ASSIGN(const auto all, data_.LoadImages(model));
    const std::vector<std::uint8_t> images = ViewsOf(data_.info(), all, views_);
    std::vector<int> said, found(views_.size());
    const std::size_t bytes = images.size() / views_.size();
    for (std::size_t v = 0; v < views_.size(); v += Model::kImagesAtOnce) {
      const std::size_t count = std::min(Model::kImagesAtOnce, views_.size() - v);
      TILEGRAD_ASSIGN(const auto some,
                      model_.Classify(std::span(images).subspan(v * bytes, count * bytes)));
      said.insert(said.end(), some.begin(), some.end());
    }
    said_[i] = Accuracy(said, truth);
    frequent_[i] = Accuracy(std::vector<int>{most_frequent_}, truth);
    if (!Retrieves()) return {};
    workers_.For(views_.size(), [&](std::size_t v, std::size_t) {
      const auto match =
          index_.Nearest(std::span(images).subspan(v * bytes, bytes), data_.info().image_size);
      found[v] = searched_[static_cast<std::size_t>(match.model)];
    });
    retrieved_[i] = Accuracy(found, truth);
    return {};
  }

  void Fill(std::span<const int> models) {
    const ClassMeans means(data_, models);
    means.Describe(said_, &out_);
    out_.rows = {means.Row("most frequent class", frequent_)};
    if (Retrieves()) out_.rows.push_back(means.Row("nearest training picture", retrieved_));
    out_.rows.push_back(means.Row("tilegrad", said_));
    out_.predictor = job_.predictor.description();
    out_.views_per_model = static_cast<int>(views_.size());
  }

  const Dataset& data_;
  const TaskEvaluation& job_;
  ClassifierModel& model_;
  const Workers& workers_;
  const Watch& watch_;
  const Share share_;  // of models
  std::vector<int> views_;
  int most_frequent_ = 0;
  ImageIndex index_;
  std::vector<int> searched_;  // their classes, in the order of the index
  std::vector<Score> frequent_, retrieved_, said_;
  Evaluation out_;
};

Result<Example> ExampleOf(const Dataset& dataset, int model, ClassifierModel& classifier) {
  const DatasetInfo& info = dataset.info();
  Example out = NamedExample(dataset, model);
  TILEGRAD_ASSIGN(const auto all, dataset.LoadImages(model));
  const std::vector<int> views = ShownViews(info.views);
  const std::vector<std::uint8_t> images = ViewsOf(info, all, views);
  TILEGRAD_ASSIGN(const auto said, classifier.Classify(images));
  const std::size_t bytes = images.size() / views.size();
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto planes = std::span(images).subspan(v * bytes, bytes);
    const std::string& name = classifier.classes()[static_cast<std::size_t>(said[v])];
    out.pictures.push_back(
        {OnPaper(planes, info.image_size), "called " + name, out.name + ": called " + name});
  }
  return out;
}

constexpr std::uint64_t kShiftStream = 0x7368696674;
constexpr int kPictureChannels = 3;

// How one picture is read: numbers of `image` from [4][size][size] bytes.
struct Placement {
  int size;
  bool mirrored;
  Shift shift;

  // The byte shifted to (x, y) of channel c, or 0 from beyond the picture.
  std::uint8_t At(std::span<const std::uint8_t> image, int c, int y, int x) const {
    const int row = y - shift.y, moved = x - shift.x;
    if (row < 0 || row >= size || moved < 0 || moved >= size) return 0;
    const int column = mirrored ? size - 1 - moved : moved;
    return image[static_cast<std::size_t>((c * size + row) * size + column)];
  }
  template <class T>
  void Read(std::span<const std::uint8_t> image, T* to) const {
    for (int c = 0; c < kPictureChannels; ++c) {
      for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x)
          *to++ = static_cast<T>(At(image, c, y, x)) * static_cast<T>(1.0 / 255);
      }
    }
  }
};

// A batch under construction.
struct Gathering {
  const LabelledImages& data;
  std::vector<Sample> batch;
  std::vector<Shift> shifts;
  LabelledBatch out;

  void Run(std::size_t i) {
    const Sample& sample = batch[i];
    const Placement placement{data.images.size, sample.mirrored,
                              shifts.empty() ? Shift() : shifts[i]};
    const std::size_t numbers = out.images.elements() / batch.size();
    nn::WithFloatType(out.images.dtype(), [&]<class T>(T) {
      placement.Read(data.images.Image(sample.model, sample.views[0]),
                     out.images.data<T>() + i * numbers);
    });
    out.labels.data<std::int32_t>()[i] = data.labels[static_cast<std::size_t>(sample.model)];
  }
};

}  // namespace

nn::NamedTensor ClassNames(nn::Context& context, const std::vector<std::string>& classes) {
  std::string text;
  for (const std::string& name : classes) text += name + "\n";
  nn::Tensor bytes = context.Empty({static_cast<std::int64_t>(text.size())}, nn::DType::kU8);
  std::memcpy(bytes.raw(), text.data(), text.size());
  return {kClasses, bytes};
}

Result<std::vector<std::string>> ReadClassNames(const std::vector<nn::NamedTensor>& state) {
  const nn::Tensor* bytes = nn::Find(state, kClasses);
  if (bytes == nullptr || bytes->dtype() != nn::DType::kU8)
    return DataLoss("no tensor \"{}\" of bytes with the names of its classes", kClasses);
  std::vector<std::string> out(1);
  for (std::size_t i = 0; i < bytes->bytes(); ++i) {
    const char c = static_cast<char>(bytes->raw()[i]);
    if (c == '\n')
      out.emplace_back();
    else
      out.back() += c;
  }
  out.pop_back();
  if (out.size() < 2) return DataLoss("tensor \"{}\" names {} classes", kClasses, out.size());
  return out;
}

std::vector<int> MostLikely(const nn::Tensor& scores) {
  const auto classes = static_cast<std::ptrdiff_t>(scores.shape()[1]);
  std::vector<int> out;
  nn::WithFloatType(scores.dtype(), [&]<class T>(T) {
    for (std::int64_t i = 0; i < scores.shape()[0]; ++i) {
      const T* row = scores.data<T>() + i * classes;
      out.push_back(static_cast<int>(std::max_element(row, row + classes) - row));
    }
  });
  return out;
}

ClassifierModel::ClassifierModel(nn::Context& context, const ClassifierConfig& config,
                                 std::vector<std::string> classes, int image_size)
    : context_(context),
      classes_(std::move(classes)),
      image_size_(image_size),
      network_(context, config, static_cast<std::int64_t>(classes_.size()), /*seed=*/0) {}

Result<std::unique_ptr<ClassifierModel>> ClassifierModel::Load(nn::Context& context,
                                                               const ClassifierConfig& config,
                                                               const Checkpoint& checkpoint) {
  TILEGRAD_ASSIGN(std::vector<std::string> classes, ReadClassNames(checkpoint.tensors));
  std::unique_ptr<ClassifierModel> model(new ClassifierModel(
      context, config, std::move(classes), static_cast<int>(checkpoint.info.image_size)));
  TILEGRAD_TRY(context.TakeStatus());
  TILEGRAD_TRY(model->LoadWeights(model->network_, checkpoint.tensors));
  model->weights_.push_back(ClassNames(context, model->classes_));
  return model;
}

Result<std::vector<int>> ClassifierModel::Classify(std::span<const std::uint8_t> images) {
  const nn::NoGrad off(context_);
  const nn::Var scores = network_.Forward(
      nn::Constant(context_, ColorsOf(context_, images, image_size_)), nn::Mode::kEval);
  TILEGRAD_TRY(context_.TakeStatus());
  return MostLikely(scores.value());
}

Result<Evaluation> EvaluateClassifier(const TaskEvaluation& job, ClassifierModel& model,
                                      const Workers& workers, const Watch& watch) {
  if (job.change) return InvalidArgument("a classifier predicts no meshes to refine");
  if (job.voxels) return InvalidArgument("--voxels: classes are scored without shapes");
  if (job.oracle_steps > 0)
    return InvalidArgument("--oracle fits meshes; a classifier predicts none");
  TILEGRAD_ASSIGN(const Dataset dataset, OpenHeldOut(job));
  TILEGRAD_TRY(CheckClasses(dataset, model));
  return Examiner(dataset, job, model, workers, watch).Run();
}

Result<Showcase> ShowClassified(const ShowcaseRequest& request, ClassifierModel& model,
                                const Watch& watch) {
  TILEGRAD_ASSIGN(const Dataset dataset, OpenHeldOut(request));
  TILEGRAD_TRY(CheckClasses(dataset, model));
  Showcase out = AboutDataset(dataset, request.header);
  out.purpose = "to classify an object from one image";
  out.note =
      "The predicted class stands below each picture. The models are spread over the classes in "
      "the dataset's order, not picked by hand.";
  const std::vector<int> chosen = ChooseModels(dataset, request.examples);
  for (const int m : chosen) {
    TILEGRAD_TRY(
        watch.At({"classifying", out.examples.size(), chosen.size(), ""}, kNothingWritten));
    TILEGRAD_ASSIGN(Example example, ExampleOf(dataset, m, model));
    out.examples.push_back(std::move(example));
  }
  return out;
}

Result<LabelledImages> LoadLabelled(const Dataset& dataset, const std::vector<int>& models,
                                    const Workers& workers, const Watch& watch) {
  LabelledImages out;
  TILEGRAD_ASSIGN(out.images, LoadImageStore(dataset, models, workers, watch));
  for (const int m : models) out.labels.push_back(dataset.model(m).class_index);
  return out;
}

Shift RandomShift(std::uint64_t seed, std::uint64_t position, int most) {
  Rng rng(seed ^ kShiftStream, position);
  const auto draw = [&] {
    return static_cast<int>(rng.Below(static_cast<std::uint64_t>(2 * most + 1))) - most;
  };
  const int x = draw();
  return {x, draw()};
}

BatchWork<LabelledBatch> LabelledWork(nn::Context& context, const LabelledImages& data,
                                      std::vector<Sample> batch, std::vector<Shift> shifts) {
  const auto count = static_cast<std::int64_t>(batch.size()),
             size = static_cast<std::int64_t>(data.images.size);
  const auto work =
      std::make_shared<Gathering>(Gathering{data,
                                            std::move(batch),
                                            std::move(shifts),
                                            {context.Empty({count, kPictureChannels, size, size}),
                                             context.Empty({count}, nn::DType::kI32)}});
  return {work->batch.size(), [work](std::size_t i, std::size_t) { work->Run(i); },
          [work] { return Result<LabelledBatch>(std::move(work->out)); }};
}

LabelledBatch GatherLabelled(nn::Context& context, const LabelledImages& data,
                             std::span<const Sample> batch, std::span<const Shift> shifts) {
  return *MakeNow(
      LabelledWork(context, data, {batch.begin(), batch.end()}, {shifts.begin(), shifts.end()}),
      context);
}

nn::Tensor ColorsOf(nn::Context& context, std::span<const std::uint8_t> images, int size) {
  const auto plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  const std::size_t count = images.size() / (4 * plane);
  nn::Tensor out = context.Empty({static_cast<std::int64_t>(count), kPictureChannels, size, size});
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    for (std::size_t i = 0; i < count; ++i)
      Placement{size, false, {}}.Read(images.subspan(4 * plane * i, 4 * plane),
                                      out.data<T>() + kPictureChannels * plane * i);
  });
  return out;
}

}  // namespace tilegrad::train
