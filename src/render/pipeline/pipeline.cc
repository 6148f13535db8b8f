// SPDX-License-Identifier: Apache-2.0
#include "render/pipeline/pipeline.h"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "base/clocks.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

// A call of Render or Backward.
struct ForwardCall {
  std::span<const PipelineScene> scenes;
  const RenderOptions& options;
  PrepareRequest request;  // with the alpha rule
  Pipeline::Attributes attributes;
  FrameImages* frame;
};

struct BackwardCall {
  std::span<const PipelineScene> scenes;
  BackwardInput input;
  PrepareRequest request;
  std::span<PipelineGradients> d_scenes;
  raster::SquareGrid grid;  // of bins
  std::size_t bands, bins;  // of each image; no bins if alpha has no gradient

  // Bins whose gradients are merged with those of bands on the screen.
  std::size_t summed_bins() const { return bins > 0 && input.alpha->needs().own_sums ? 0 : bins; }
  bool wants_geometry(std::size_t n) const {
    return !d_scenes[n].positions.empty() || d_scenes[n].camera;
  }
  // In clipped meshes, geometry moves the attributes at the cut.
  raster::BackwardRequest request_of(std::size_t n, const raster::ScreenMesh& mesh) const {
    const bool geometry = wants_geometry(n);
    return {geometry, !d_scenes[n].attributes.empty() || (geometry && mesh.was_clipped())};
  }
};

}  // namespace

// Splits the stages of a batch into tasks. An image of one bin is one task, so that it stays in its
// worker's cache from start to end; so are larger ones as long as there are enough for all workers,
// who share the parts of the last ones.
struct Pipeline::Impl {
  explicit Impl(const Workers& w)
      : workers(&w),
        all_faces(MakeAllFacesAlpha(static_cast<std::size_t>(w.count()))),
        paper(MakePaperAlpha()),
        worker_scratch(static_cast<std::size_t>(w.count())) {
    for (std::size_t i = 0; i < worker_scratch.size(); ++i) worker_scratch[i].index = i;
  }

  void Render(const ForwardCall& call) {
    const std::size_t count = call.scenes.size();
    const raster::SquareGrid bins = raster::BinGrid(call.options.width, call.options.height);
    Begin(call.scenes, call.options, call.request.alpha);
    bin_errors.assign(count * bins.cells(), 0.0);
    if (bins.cells() == 1) {
      workers->For(count, [&](std::size_t n, std::size_t worker) {
        RenderWholeImage(call, n, &worker_scratch[worker]);
      });
    } else {
      workers->ForParts(
          count, [&](std::size_t n, const Workers::Part& part) { RenderImage(call, n, part); });
    }
    double* const bound = &call.frame->alpha_error_bound;
    for (const double error : bin_errors) *bound = std::max(*bound, error);
    if (alpha != nullptr && !alpha->needs().bounded)
      *bound = std::numeric_limits<double>::infinity();
  }

  bool Backward(const BackwardCall& call) {
    Begin(call.scenes, call.input.options, call.request.alpha);
    const std::size_t count = call.scenes.size();
    if (call.grid.cells() == 1 && call.bands == 1) {
      workers->For(count, [&](std::size_t n, std::size_t worker) {
        BackwardWholeImage(call, n, &worker_scratch[worker]);
      });
    } else {
      if (band_gradients.size() < count * call.bands) band_gradients.resize(count * call.bands);
      if (bin_gradients.size() < count * call.bins) bin_gradients.resize(count * call.bins);
      workers->ForParts(
          count, [&](std::size_t n, const Workers::Part& part) { BackwardImage(call, n, part); });
    }
    return sound;
  }

  void Prepare(const PipelineScene& scene, const RenderOptions& options,
               const PrepareRequest& request, std::size_t n, WorkerScratch* worker) {
    StageClock clock;
    PrepareImage({n, scene, topologies.of(n)}, options, request, *workers, &images[n],
                 &worker->stats);
    clock.Lap(&worker->times.prepare);
  }

  // The list of drawn faces, the largest array of all, is the worker's, not the image's.
  void RenderWholeImage(const ForwardCall& call, std::size_t n, WorkerScratch* worker) {
    ImageScratch& image = images[n];
    std::swap(image.drawn_faces, worker->drawn_faces);
    std::swap(image.drawn_buffers, worker->drawn_buffers);
    Prepare(call.scenes[n], call.options, call.request, n, worker);
    RenderOneBin(call, {n, 0, {0, 0, call.options.width, call.options.height}}, worker);
    image.prepared.drawn_bins = false;
    std::swap(image.drawn_faces, worker->drawn_faces);
    std::swap(image.drawn_buffers, worker->drawn_buffers);
  }

  void RenderImage(const ForwardCall& call, std::size_t n, const Workers::Part& part) {
    Prepare(call.scenes[n], call.options, call.request, n, &worker_scratch[part.worker()]);
    const raster::SquareGrid bins = raster::BinGrid(call.options.width, call.options.height);
    part.For(bins.cells(), [&](std::size_t bin, std::size_t worker) {
      RenderOneBin(call, {n, bin, bins.rect(bin)}, &worker_scratch[worker]);
    });
  }

  void RenderOneBin(const ForwardCall& call, const BinTask& bin, WorkerScratch* worker) {
    const std::size_t bins = bin_errors.size() / call.scenes.size();
    bin_errors[bin.image * bins + bin.bin] =
        RenderBin({call.scenes[bin.image], call.options, images[bin.image], call.attributes.image,
                   call.attributes.stage, call.request.alpha},
                  bin, worker, call.frame);
  }

  void BackwardWholeImage(const BackwardCall& call, std::size_t n, WorkerScratch* worker) {
    ImageScratch& image = images[n];
    const PipelineScene& scene = call.scenes[n];
    Prepare(scene, call.input.options, call.request, n, worker);
    PrepareRecomputed(scene, &image);
    BackwardBand(call, {n, 0}, worker, &worker->band_gradients);
    if (call.bins > 0) BackwardBin(call, n, 0, worker, &worker->bin_gradients);
    const ImageGradients gradients{{&worker->band_gradients, 1},
                                   {&worker->bin_gradients, call.summed_bins()},
                                   call.request_of(n, image.mesh)};
    PipelineGradients* d_scene = &call.d_scenes[n];
    AlignedVector<float>* const d_vertices = &worker->merge.d_vertices;
    StageClock clock;
    if (gradients.request.geometry) SumGeometry(image, gradients, d_vertices);
    Require(
        MergeGeometry(scene, call.input.options, image, gradients, *d_vertices, worker, d_scene));
    Require(MergeAttributes(image, gradients, worker, d_scene));
    MergeOwnSums(call, n);
    clock.Lap(&worker->times.merge);
  }

  // Bands and bins together.
  void BackwardImage(const BackwardCall& call, std::size_t n, const Workers::Part& part) {
    WorkerScratch* const own = &worker_scratch[part.worker()];
    Prepare(call.scenes[n], call.input.options, call.request, n, own);
    PrepareRecomputed(call.scenes[n], &images[n]);
    BandGradients* const bands = &band_gradients[n * call.bands];
    BinGradients* const bins = bin_gradients.data() + n * call.bins;
    part.For(call.bands + call.bins, [&](std::size_t i, std::size_t worker) {
      if (i < call.bands) {
        BackwardBand(call, {n, i}, &worker_scratch[worker], &bands[i]);
      } else {
        const std::size_t bin = i - call.bands;
        BackwardBin(call, n, bin, &worker_scratch[worker], &bins[bin]);
      }
    });
    if (sound) Merge(call, n, part);
  }

  // Three independent sums that can run in parallel, for batches of one: the longest first.
  void SumParts(const ImageGradients& gradients, std::size_t n, const Workers::Part& part,
                PipelineGradients* d_scene) {
    ImageScratch& image = images[n];
    const bool geometry = gradients.request.geometry;
    part.For(3, [&](std::size_t i, std::size_t w) {
      StageClock clock;
      if (i == 0 && geometry && !gradients.bins.empty()) {
        SumGeometry(image, {{}, gradients.bins, gradients.request}, &image.d_bin_vertices);
      } else if (i == 1 && geometry) {
        SumGeometry(image, {gradients.bands, {}, gradients.request}, &image.d_band_vertices);
      } else if (i == 2) {
        Require(MergeAttributes(image, gradients, &worker_scratch[w], d_scene));
      }
      clock.Lap(&worker_scratch[w].times.merge);
    });
  }

  void Merge(const BackwardCall& call, std::size_t n, const Workers::Part& part) {
    ImageScratch& image = images[n];
    WorkerScratch* const worker = &worker_scratch[part.worker()];
    PipelineGradients* const d_scene = &call.d_scenes[n];
    const ImageGradients gradients{
        std::span(band_gradients).subspan(n * call.bands, call.bands),
        std::span(bin_gradients).subspan(n * call.bins, call.summed_bins()),
        call.request_of(n, image.mesh)};
    SumParts(gradients, n, part, d_scene);
    StageClock clock;
    if (gradients.request.geometry && !gradients.bins.empty()) {
      std::transform(image.d_band_vertices.begin(), image.d_band_vertices.end(),
                     image.d_bin_vertices.begin(), image.d_band_vertices.begin(), std::plus());
    }
    Require(MergeGeometry(call.scenes[n], call.input.options, image, gradients,
                          image.d_band_vertices, worker, d_scene));
    MergeOwnSums(call, n);
    clock.Lap(&worker->times.merge);
  }

  // For a rule that does not pass its sums to MergeGeometry.
  void MergeOwnSums(const BackwardCall& call, std::size_t n) {
    if (call.bins == call.summed_bins() || !call.wants_geometry(n)) return;
    alpha->AddToScene(call.scenes[n], n, images[n], &call.d_scenes[n]);
    Require(IsFiniteGeometry(call.d_scenes[n]));
  }

  void BackwardBand(const BackwardCall& call, const BandTask& task, WorkerScratch* worker,
                    BandGradients* out) {
    const ImageScratch& image = images[task.image];
    Require(RenderBandBackward(call.input, image, task, call.request_of(task.image, image.mesh),
                               worker, out));
  }

  void BackwardBin(const BackwardCall& call, std::size_t n, std::size_t bin, WorkerScratch* worker,
                   BinGradients* out) {
    if (!call.wants_geometry(n)) return;
    StageClock clock;
    RenderBinBackward(call.input, images[n], {n, bin, call.grid.rect(bin)}, worker, out);
    clock.Lap(&worker->times.alpha);
  }

  void Begin(std::span<const PipelineScene> scenes, const RenderOptions& options,
             AlphaStage* rule) {
    const std::size_t count = scenes.size();
    if (images.size() < count) images.resize(count);
    for (WorkerScratch& worker : worker_scratch) {
      worker.stats = {};
      worker.times = {};
    }
    alpha = rule;
    if (alpha != nullptr) alpha->Begin(options, count);
    topologies.Update(scenes, *workers);
    sound = true;
  }
  AlphaStage* RuleOf(AlphaRule rule) const {
    return rule == AlphaRule::kPaper ? paper.get() : all_faces.get();
  }
  void Require(bool holds) {
    if (!holds) sound = false;
  }

  const Workers* workers;
  std::atomic<bool> sound = true;  // false: a number was not finite in a backward pass
  std::unique_ptr<AlphaStage> all_faces, paper;
  AlphaStage* alpha = nullptr;  // of the last call; null: no alpha
  Topologies topologies;
  std::vector<ImageScratch> images;
  std::vector<WorkerScratch> worker_scratch;
  std::vector<double> bin_errors;             // of alpha, [image][bin]
  std::vector<BandGradients> band_gradients;  // [image][band]
  std::vector<BinGradients> bin_gradients;    // [image][bin]
};

Pipeline::Pipeline(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;

void Pipeline::Render(std::span<const PipelineScene> scenes, const RenderOptions& options,
                      const Attributes& attributes, FrameImages* frame) {
  AlphaStage* const alpha = frame->alpha.empty() ? nullptr : impl_->RuleOf(options.alpha_rule);
  const bool transmittance = alpha != nullptr && alpha->needs().transmittance;
  frame->transmittance.resize(transmittance ? frame->alpha.size() : 0);
  impl_->Render({scenes, options, {true, alpha, false}, attributes, frame});
}

bool Pipeline::Backward(std::span<const PipelineScene> scenes, const RenderOptions& options,
                        const FrameImages& frame, const PipelineCotangents& d_frame,
                        std::span<PipelineGradients> d_scenes, PixelStage* stage) {
  const raster::SquareGrid grid = raster::BinGrid(options.width, options.height);
  AlphaStage* const alpha = d_frame.alpha.empty() ? nullptr : impl_->RuleOf(options.alpha_rule);
  return impl_->Backward({scenes,
                          {options, frame, d_frame, stage, alpha},
                          {false, alpha, true},
                          d_scenes,
                          grid,
                          BandGrid(options.width, options.height).count(),
                          alpha != nullptr ? grid.cells() : 0});
}

RenderStats Pipeline::stats() const {
  RenderStats sum;
  for (const WorkerScratch& worker : impl_->worker_scratch) {
    sum.prepared += worker.stats.prepared;
    sum.drawn += worker.stats.drawn;
    sum.interpolated += worker.stats.interpolated;
    sum.alpha_parts += worker.stats.alpha_parts;
    sum.merged += worker.stats.merged;
  }
  if (impl_->alpha != nullptr) {
    sum.alpha_rule = impl_->alpha->name();
    const raster::SoftWork work = impl_->alpha->work();
    sum.pairs = work.pairs;
    sum.powers = work.powers;
  }
  return sum;
}

RenderTimes Pipeline::times() const {
  RenderTimes sum;
  for (const WorkerScratch& worker : impl_->worker_scratch) {
    const RenderTimes& t = worker.times;
    sum.prepare += t.prepare;
    sum.visibility += t.visibility;
    sum.interpolate += t.interpolate;
    sum.stage += t.stage;
    sum.gradients += t.gradients;
    sum.alpha += t.alpha;
    sum.merge += t.merge;
  }
  return sum;
}

}  // namespace tilegrad
