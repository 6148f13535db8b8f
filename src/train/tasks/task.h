// SPDX-License-Identifier: Apache-2.0
// The interface between a task and the rest of the program: its configuration, its steps, its
// state, its predictions, its scores and what a report shows. Training, eval, predict and report
// know tasks only through this file. How to add one: docs/adding.md.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "nn/layers.h"
#include "nn/optim.h"
#include "nn/tape.h"
#include "scene/image.h"
#include "scene/mesh.h"
#include "train/data/dataset.h"
#include "train/eval/evaluation.h"
#include "train/run/checkpoint.h"
#include "train/run/config_fields.h"
#include "train/run/log.h"
#include "train/run/portion.h"
#include "train/run/run.h"
#include "train/run/run_files.h"

namespace tilegrad::train {

class ProcessGroup;
class Predictor;
class ClassifierModel;
class GeneratorModel;
class PhotographModel;
class TexturedModel;

// The inputs of Task::Start.
struct TaskStart {
  nn::Context& context;  // outlives the task
  Schedule schedule;
  Path data;  // dataset folder
  const Watch& watch;
  WarningSink warn = nullptr;  // for likely mistakes of the user
};

// Identifies a portion of a step's batch.
struct BatchIndex {
  std::int64_t step = 0;  // from 0
  Portion portion{};
  bool operator==(const BatchIndex&) const = default;
};

// A step is one or more updates: with an adversary several of its critic and one of its generator.
struct UpdateIndex {
  std::int64_t step = 0;                     // from 0
  int update = 0;                            // of the step, from 0
  Portion portion{};                         // of the batch
  nn::GradientListener* listener = nullptr;  // for nn::Gradients
  nn::UpdateShare* share = nullptr;          // for nn::Adam::Step
  // The batch that this lane uses after this one, if the run has one more: Backward may prefetch
  // it.
  std::optional<BatchIndex> next = std::nullopt;
};

// A trained network as commands use it. For most tasks it predicts meshes from images.
class Model {
 public:
  virtual ~Model() = default;
  std::int64_t parameters() const { return parameters_; }
  // The tensors that Task::LoadModel reads: all that a file of weights needs.
  const std::vector<nn::NamedTensor>& weights() const { return weights_; }
  // The mesh that predictions deform, normalised as they are; without vertices if the task predicts
  // no meshes.
  const Mesh& template_mesh() const { return template_; }
  // images: [N][4][size][size] planar RGBA bytes, RGB over black, of the size it was trained on;
  // N at most kImagesAtOnce. Appends N valid meshes. InvalidArgument if the task predicts none.
  virtual Status Predict(std::span<const std::uint8_t> images, std::vector<Mesh>* meshes);
  // This model as that of a particular task, or null.
  virtual ClassifierModel* classifier() { return nullptr; }
  virtual GeneratorModel* generator() { return nullptr; }
  virtual PhotographModel* photographs() { return nullptr; }
  virtual TexturedModel* textured() { return nullptr; }
  // An error that says why, if predictions cannot be refined on their picture (fit/refine.h).
  virtual Status CheckRefinable() const { return {}; }

  static constexpr std::size_t kImagesAtOnce = 32;  // bounds the memory of activations

 protected:
  // Loads the weights that predict, and sets parameters_ and weights_. Errors say what in the state
  // does not fit.
  Status LoadWeights(nn::Module& network, const std::vector<nn::NamedTensor>& state);
  // Centres and scales it like predictions, to the largest half-extent `half_extent`.
  Status SetTemplate(const Mesh& start, double half_extent);

  std::int64_t parameters_ = 0;
  std::vector<nn::NamedTensor> weights_;
  Mesh template_;
};

// Changes a prediction before it is scored, given its input image. Called from several threads at
// once.
using PredictionChange =
    std::function<Result<Mesh>(const Mesh& prediction, std::span<const std::uint8_t> image)>;

struct TaskEvaluation {
  Path run, data;
  const Predictor& predictor;
  Split split = Split::kTest;  // which models are scored
  int views_per_model = 24;
  PredictionChange change{};  // none: predictions are scored as they are
  // Steps that fit a prediction to all views of each scored model, for an upper-bound row; 0: none.
  // An error for tasks without such a row.
  int oracle_steps = 0;
  ProcessGroup* group =
      nullptr;  // the ranks that score models together; only rank 0 gets complete scores
  // The voxelization rule of the IoU; none: that of the dataset's own voxels.
  std::optional<VoxelRule> voxels = std::nullopt;
};

// A picture of a report.
struct ShownPicture {
  ImageU8 image;
  std::string caption, alt;
};

// One object that a report shows: pictures in a row, and up to two meshes to turn.
struct Example {
  std::string name, class_name, id;    // class_name and id: of its score in Evaluation::models
  std::string creator, license;        // empty where unknown
  Mesh prediction, truth;              // without faces: none
  std::vector<ShownPicture> pictures;  // the first is what the network sees
  std::vector<Camera> cameras = {};    // of the dataset's views in `pictures`
};

struct ShowcaseRequest {
  Path run, data;
  const RunHeader& header;
  const Predictor& predictor;
  int examples = 8;
};

// What a report shows of a run, as plain text, images and meshes.
struct Showcase {
  std::string purpose;  // "to predict shape and colour of an object from one image"
  std::string data;     // sentences: what it was trained on
  std::string note;     // sentences: what the pictures are
  std::vector<std::string> credits;
  std::vector<Example> examples;
  std::string thing = "model";  // what an example is of, in the singular
  bool generated = false;       // the examples are made from noise: none has an input or a truth
  ImageU8 sheet;                // all examples in one picture, a row each; empty: none
  std::string sheet_columns;    // what its columns are
  double fov_y = 40, azimuth = 0, elevation = 20, distance = 2;  // of the viewer of meshes; degrees
};

class Task {
 public:
  virtual ~Task() = default;

  // Its keys, which point into the task and have their defaults at first.
  virtual ConfigFields Fields() = 0;
  // The command that scores its runs: the words between "tilegrad" and "--run".
  virtual const char* ScoreCommand() const { return "eval"; }

  // ---- Training. Start is called first, once, after the fields are set.

  // Opens the data and builds networks and optimisers; the seed determines all randomness.
  virtual Status Start(const TaskStart& start) = 0;
  // Side of its images in pixels; the same in a resumed run.
  virtual int image_size() const = 0;
  // Half-extent of its predictions, world units: that of the dataset's objects. After Start.
  virtual double half_extent() const { return CameraRule().half_extent; }
  virtual RunHeader Header() = 0;  // without name, dataset folder and machine
  // Fingerprint of its training data (train/data/fingerprint.h), which ranks compare. After Start.
  virtual Result<std::string> Fingerprint(const Path& data, const Workers& workers) const;
  // Writes its own files to the run folder; an error if a run cannot be resumed with the files
  // there.
  virtual Status Begin(const Path& run, std::int64_t first_step) = 0;

  virtual int Updates(std::int64_t /*step*/) const { return 1; }
  // The gradients, for the parameters of this update, of the mean loss over `at.portion` of the
  // batch. Sets values->loss and images, and appends terms. A loss or gradient that is not finite
  // is an error. Changes no state that later steps see, except Statistics(). Whatever an update
  // keeps for the step's next one, it keeps per portion. The lanes of TaskStart::context call it
  // side by side, each for other portions: keep whatever else a call needs in nn::PerLane.
  virtual Result<nn::StepVector<nn::Gradient>> Backward(const UpdateIndex& at,
                                                        StepValues* values) = 0;
  // Waits for whatever Backward has started for UpdateIndex::next.
  virtual void Settle() {}
  // The tensors that Backward changes: nn::Buffers of its networks. Each portion starts from their
  // values at the start of the step, and the step ends with the mean over portions. The default is
  // an error: a task must declare that it supports portions.
  virtual Result<std::vector<nn::NamedTensor>> Statistics();
  // Takes an optimiser step along `gradients`, which the caller may have averaged over portions.
  virtual Status Update(const UpdateIndex& at, std::span<const nn::Gradient> gradients) = 0;

  // Everything that later steps depend on, under unique names: weights, statistics, moments of each
  // optimiser, moving averages.
  virtual std::vector<nn::NamedTensor> State() = 0;
  virtual Status LoadState(const std::vector<nn::NamedTensor>& state, std::int64_t steps) = 0;

  // One picture of what the networks do after `steps` steps; empty if there is nothing to show.
  virtual Result<ImageU8> SamplePicture(std::int64_t steps) = 0;

  // ---- After training. Start was not called; the fields are set.

  virtual Result<std::unique_ptr<Model>> LoadModel(nn::Context& context,
                                                   const Checkpoint& checkpoint) = 0;
  // kCancelled when `stop` is set.
  virtual Result<Evaluation> Evaluate(const TaskEvaluation& job, const Workers& workers,
                                      const Watch& watch) = 0;
  virtual Result<Showcase> Show(const ShowcaseRequest& request, const Workers& workers,
                                const Watch& watch) = 0;
};

}  // namespace tilegrad::train
