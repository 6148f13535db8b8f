// SPDX-License-Identifier: Apache-2.0
// Fits and training runs with callbacks into Python.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <memory>
#include <mutex>
#include <optional>

#include "base/error.h"
#include "bindings/camera_numbers.h"
#include "bindings/listener.h"
#include "bindings/mesh_dict.h"
#include "bindings/to_python.h"
#include "fit/frames.h"
#include "fit/input.h"
#include "fit/poses/start_cameras.h"
#include "fit/refine.h"
#include "fit/run.h"
#include "train/config.h"
#include "train/data/cutout.h"
#include "train/named_weights.h"
#include "train/predictor.h"
#include "train/tasks/task.h"
#include "train/trainer.h"

namespace tilegrad::python {
namespace {

Camera CameraOf(const CameraRow& row) { return CameraCast<float>(CameraOfNumbers(row)); }

using Words = std::vector<std::string>;  // "key=value"

// ---- Fits.

// Of `count` images, which have none if `cameras` is None.
std::vector<Camera> CamerasOf(const py::object& cameras, std::size_t count, ImageSize size,
                              double fov) {
  if (cameras.is_none()) {
    const auto lens = train::CameraOfFrame(train::BareFrame(fov), size);
    return std::vector<Camera>(count, ValueOrThrow(lens));
  }
  std::vector<Camera> out;
  for (const CameraRow& row : cameras.cast<std::vector<CameraRow>>()) out.push_back(CameraOf(row));
  return out;
}

// views: color [N,3,H,W] straight and alpha [N,H,W], float32; names [N]; cameras [N][17] or None.
Result<train::FitInput> InputOfArrays(const py::dict& views, const train::InputOptions& options,
                                      Listener* listening) {
  const auto names = views["names"].cast<Words>();
  const auto n = static_cast<py::ssize_t>(names.size());
  const auto image = views["color"].cast<py::array>();
  const auto color = SpanOf<float>(image, "fit", "images", {n, 3, kAny, kAny});
  const auto alpha =
      SpanOf<float>(views["alpha"], "fit", "masks", {n, image.shape(2), image.shape(3)});
  train::FitInput input;
  input.images.width = static_cast<int>(image.shape(3));
  input.images.height = static_cast<int>(image.shape(2));
  input.images.color.assign(color.begin(), color.end());
  input.images.alpha.assign(alpha.begin(), alpha.end());
  input.names = names;
  input.posed = !views["cameras"].is_none();
  input.cameras = CamerasOf(views["cameras"], names.size(),
                            {input.images.width, input.images.height}, options.fov);
  TILEGRAD_TRY(listening->Run([&] { return train::FinishInput(options, &input).Within("fit"); }));
  return input;
}

// None: of a folder, as its cameras make plain; cameras that are given in numbers are taken as they
// are, since whoever has them renders with them.
std::optional<UpAxis> UpOf(const py::dict& views) {
  const auto word = views["up"].cast<std::string>();
  if (word.empty()) return views.contains("folder") ? std::nullopt : std::optional(UpAxis::kY);
  const auto up = UpAxisNamed(word);
  if (!up) throw py::value_error(fmt::format("fit: up is '{}', expected y, z or x", word));
  return up;
}

train::InputOptions InputOptionsOf(const py::dict& views) {
  const auto background = views["background"].cast<std::string>();
  const auto known = train::BackgroundNamed(background);
  if (!known)
    throw py::value_error(fmt::format(
        "fit: background is '{}', expected auto, mask, plain, none or views", background));
  return {views["hold_out"].cast<int>(), *known, views["fov"].cast<double>(), UpOf(views), {}};
}

// views: those arrays, or "folder", a path, and "model", of a dataset; "hold_out", "background",
// "fov", "up".
Result<train::FitInput> InputOf(const py::dict& views, Listener* listening) {
  train::InputOptions options = InputOptionsOf(views);
  options.watch = {listening->Sink(), &listening->stop()};
  if (!views.contains("folder")) return InputOfArrays(views, options, listening);
  const auto folder = views["folder"].cast<Path>();
  const auto model = views["model"].cast<std::string>();
  return listening->Run([&] {
    return model.empty() ? train::ReadFitFolder(folder, options)
                         : train::ReadFitDataset(folder, model, options.hold_out);
  });
}

train::ParameterSet ParametersNamed(const Words& names) {
  train::ParameterSet set;
  for (const std::string& name : names) {
    const auto found = std::find_if(train::kParameters.begin(), train::kParameters.end(),
                                    [&](train::Parameter p) { return name == train::NameOf(p); });
    if (found == train::kParameters.end())
      throw py::value_error(fmt::format("fit: \"{}\" cannot be optimised", name));
    set[*found] = true;
  }
  return set;
}

// The value whose name, in the order of the enumeration, request[argument] is.
template <class Enum>
Enum EnumNamed(const py::dict& request, const char* argument, const Words& names) {
  const auto name = request[argument].cast<std::string>();
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end())
    throw py::value_error(
        fmt::format("fit: {} is '{}', expected one of {}", argument, name, fmt::join(names, ", ")));
  return static_cast<Enum>(at - names.begin());
}

train::ExistingRun ExistingOf(const py::dict& request) {
  return request["resume"].cast<bool>() ? train::ExistingRun::kContinue
                                        : train::ExistingRun::kRefuse;
}

// request: out, a path; quality, a word or empty; options, of fit/config.h; optimize, names;
// lighting; start, truth: meshes or None; resume; threads. All but the input.
train::FitJob JobOf(const py::dict& request) {
  train::FitJob job;
  if (const auto quality = request["quality"].cast<std::string>(); !quality.empty())
    job.config.steps = ValueOrThrow(train::StepsOfQuality(quality));
  job.config.parameters = ParametersNamed(request["optimize"].cast<Words>());
  job.config.vertex_colors = job.config.parameters[train::Parameter::kColors];
  job.config.material =
      EnumNamed<train::MaterialKind>(request, "material", {"unlit", "lambert", "phong"});
  job.config.lighting =
      EnumNamed<Lighting>(request, "lighting", {"none", "lambert", "phong", "spherical_harmonics"});
  ThrowIfError(train::OverrideFields(request["options"].cast<Words>(), train::FieldsOf(&job.config))
                   .Within("fit"));
  if (!request["start"].is_none()) job.start = MeshFromDict("fit", request["start"]);
  if (!request["truth"].is_none()) job.truth = MeshFromDict("fit", request["truth"]);
  job.out = request["out"].cast<Path>();
  job.existing = ExistingOf(request);
  return job;
}

py::object ScoresToDict(const std::vector<train::ViewScore>& scores) {
  if (scores.empty()) return py::none();
  return py::dict(py::arg("views") = scores.size(), py::arg("psnr") = train::MeanPsnr(scores),
                  py::arg("silhouette_iou") = train::MeanIou(scores));
}

py::dict Fit(const py::dict& views, const py::dict& request, const py::object& listener) {
  train::FitJob job = JobOf(request);
  Listener listening(listener);
  auto input = InputOf(views, &listening);
  listening.Settle(input.status());
  if (!input.ok()) return py::dict(py::arg("finished") = false);
  job.input = std::move(input).value();
  job.warn = [&job](const std::string& text) { job.input.warnings.push_back(text); };
  const Workers workers(request["threads"].cast<int>());
  const train::CameraSearch search = {views["find_cameras"].cast<bool>(),
                                      request["resume"].cast<bool>()};
  auto outcome = listening.Run([&]() -> Result<train::FitOutcome> {
    TILEGRAD_TRY(train::StartCameras(search, &job, workers, listening.Sink(), listening.stop()));
    return train::RunFit(job, workers, listening.Sink(), listening.stop());
  });
  for (const std::string& warning : job.input.warnings) WarnUser("fit: " + warning);
  listening.Settle(outcome.status());
  if (!outcome.ok()) return py::dict(py::arg("finished") = false);
  if (!outcome->doubt.empty()) WarnUser("fit: " + outcome->doubt);
  py::dict out(py::arg("finished") = outcome->finished, py::arg("steps") = outcome->last_step,
               py::arg("seconds") = outcome->seconds,
               py::arg("training") = ScoresToDict(outcome->training),
               py::arg("held_out") = ScoresToDict(outcome->held_out));
  out["voxel_iou"] = outcome->voxel_iou ? py::cast(*outcome->voxel_iou) : py::none();
  return out;
}

// ---- Trainings.

// request: config, a name or a file; data and out, paths; overrides; resume; max_minutes; threads.
py::dict Train(const py::dict& request, const py::object& listener) {
  train::TrainJob job;
  job.config = ValueOrThrow(train::FindConfig(request["config"].cast<std::string>()));
  ThrowIfError(train::ApplyOverrides(request["overrides"].cast<Words>(), &job.config));
  job.data = request["data"].cast<Path>();
  job.run = request["out"].cast<Path>();
  job.existing = ExistingOf(request);
  job.extends = request["resume"].cast<bool>();
  job.max_minutes = request["max_minutes"].cast<double>();
  Words warnings;
  job.warn = [&warnings](const std::string& text) { warnings.push_back(text); };
  Listener listening(listener);
  const Workers workers(request["threads"].cast<int>());
  auto outcome = listening.Run([&] { return train::Train(job, workers, listening.watch()); });
  for (const std::string& warning : warnings) WarnUser("train: " + warning);
  listening.Settle(outcome.status());
  if (!outcome.ok()) return py::dict(py::arg("finished") = false);
  return py::dict(py::arg("finished") = outcome->finished, py::arg("steps") = outcome->last_step,
                  py::arg("seconds") = outcome->seconds);
}

// A trained network that predicts meshes from images.

// image: [height,width,4], or any number of channels with a mask [height,width,channels].
py::array PrepareCutout(const py::object& image, const py::object& mask, int size,
                        bool keep_framing) {
  ImageU8 cutout = ImageFromPython("prepare", "image", image);
  if (!mask.is_none())
    cutout = ValueOrThrow(train::WithMask(cutout, ImageFromPython("prepare", "mask", mask)));
  const auto framing = keep_framing ? train::Framing::kKeep : train::Framing::kFit;
  auto planar =
      ValueOrThrow(WithoutGil([&] { return train::PrepareCutout(cutout, size, framing); }));
  return OwnedArray<std::uint8_t>(std::move(planar), {4, size, size});
}

// The predictor with the workers that it refers to; one call at a time.
class Model {
 public:
  static std::unique_ptr<Model> Load(const Path& path, int threads) {
    auto workers = std::make_unique<Workers>(threads);
    auto predictor =
        ValueOrThrow(WithoutGil([&] { return train::Predictor::Load(path, *workers); }));
    return std::unique_ptr<Model>(new Model(std::move(workers), std::move(predictor)));
  }

  int image_size() const { return predictor_.image_size(); }
  int refine_steps() const {
    return predictor_.model().CheckRefinable().ok() ? train::kRefineSteps : 0;
  }
  py::str description() const { return Text(predictor_.description()); }
  py::dict TemplateMesh() const { return MeshToDict(predictor_.template_mesh()); }

  // images: [N,4,size,size].
  py::list Predict(const py::object& images) {
    const int size = predictor_.image_size();
    const auto bytes = SpanOf<std::uint8_t>(images, "predict", "images", {kAny, 4, size, size});
    auto meshes = ValueOrThrow(WithoutGil([&] {
      const std::scoped_lock lock(mutex_);
      return predictor_.Predict(bytes);
    }));
    py::list out;
    for (Mesh& mesh : meshes) out.append(MeshToDict(std::move(mesh)));
    return out;
  }

  // image: [1,4,size,size] as the network sees it; picture: [4,n,n], the same in more pixels.
  py::dict PredictRefined(const py::object& image, const py::object& picture, int steps) {
    const int size = predictor_.image_size();
    const auto seen = SpanOf<std::uint8_t>(image, "predict", "image", {1, 4, size, size});
    const auto planes = SpanOf<std::uint8_t>(picture, "predict", "picture", {4, kAny, kAny});
    const auto side = static_cast<int>(py::reinterpret_borrow<py::array>(picture).shape(1));
    Listener listening{py::none()};
    auto refined = listening.Run([&]() -> Result<train::RefinedMesh> {
      const std::scoped_lock lock(mutex_);
      if (const Status status = predictor_.model().CheckRefinable(); !status.ok()) return status;
      auto meshes = predictor_.Predict(seen);
      if (!meshes.ok()) return meshes.status();
      return train::RefineMesh(meshes->front(), train::TargetsOfPlanar(planes, side),
                               {.steps = steps, .watch = {nullptr, &listening.stop()}}, *workers_);
    });
    listening.Settle(refined.status());
    return MeshToDict(std::move(refined->mesh));
  }

 private:
  Model(std::unique_ptr<Workers> workers, train::Predictor predictor)
      : workers_(std::move(workers)), predictor_(std::move(predictor)) {}

  std::unique_ptr<Workers> workers_;
  train::Predictor predictor_;
  std::mutex mutex_;
};

}  // namespace

void BindRuns(py::module_& m) {
  m.def("fit", &Fit, "listener(stage, done, total) is called at each step; returning True stops.");
  m.def("train", &Train, "As fit.");
  m.def(
      "config_names",
      [] {
        Words names;
        for (const auto& config : train::NamedConfigs()) names.emplace_back(config.name);
        return names;
      },
      "Names of the built-in configurations.");
}

void BindPredictor(py::module_& m) {
  m.def("prepare_cutout", &PrepareCutout, "(4, size, size) uint8 of a picture (H, W, C) uint8.");
  m.attr("CUTOUT_WEIGHTS") = train::kCutoutWeights;
  m.attr("REFINE_SIZE") = train::kRefineSize;
  py::class_<Model>(m, "Model", "A trained network.")
      .def(py::init(&Model::Load), "path: as of train::FindRun.")
      .def_property_readonly("image_size", &Model::image_size, "Pixels a side.")
      .def_property_readonly("description", &Model::description, "A one-line description.")
      .def_property_readonly("refine_steps", &Model::refine_steps,
                             "Of a prediction, if no number is given.")
      .def("template_mesh", &Model::TemplateMesh, "The template sphere.")
      .def("predict", &Model::Predict, "Meshes of images (N, 4, size, size) uint8.")
      .def("predict_refined", &Model::PredictRefined,
           "The mesh of image (1, 4, size, size), refined on picture (4, n, n).");
}

}  // namespace tilegrad::python
