// SPDX-License-Identifier: Apache-2.0
// A trained network that predicts meshes from images.
#include <pybind11/stl/filesystem.h>

#include <memory>
#include <mutex>

#include "bindings/listener.h"
#include "bindings/mesh_dict.h"
#include "bindings/to_python.h"
#include "fit/input.h"
#include "fit/refine.h"
#include "train/data/cutout.h"
#include "train/named_weights.h"
#include "train/predictor.h"
#include "train/tasks/task.h"

namespace tilegrad::python {

void BindPredictor(py::module_& m);

namespace {

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

void BindPredictor(py::module_& m) {
  m.def("prepare_cutout", &PrepareCutout, py::arg("image"), py::arg("mask"), py::arg("size"),
        py::arg("keep_framing"), "(4, size, size) uint8 of a picture (H, W, C) uint8.");
  m.attr("CUTOUT_WEIGHTS") = train::kCutoutWeights;
  m.attr("REFINE_SIZE") = train::kRefineSize;
  py::class_<Model>(m, "Model", "A trained network.")
      .def(py::init(&Model::Load), py::arg("path"), py::arg("threads"),
           "path: as of train::FindRun.")
      .def_property_readonly("image_size", &Model::image_size, "Pixels a side.")
      .def_property_readonly("description", &Model::description, "A one-line description.")
      .def_property_readonly("refine_steps", &Model::refine_steps,
                             "Of a prediction, if no number is given.")
      .def("template_mesh", &Model::TemplateMesh, "The template sphere.")
      .def("predict", &Model::Predict, py::arg("images"),
           "Meshes of images (N, 4, size, size) uint8.")
      .def("predict_refined", &Model::PredictRefined, py::arg("image"), py::arg("picture"),
           py::arg("steps"), "The mesh of image (1, 4, size, size), refined on picture (4, n, n).");
}

}  // namespace tilegrad::python
