// SPDX-License-Identifier: Apache-2.0
// Datasets of rendered views (docs/datasets.md), read.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "bindings/camera_numbers.h"
#include "bindings/mesh_dict.h"
#include "bindings/to_python.h"
#include "train/data/batches.h"
#include "train/data/dataset_files.h"

namespace tilegrad::python {
namespace {

using train::Dataset;

py::ssize_t Side(const Dataset& d) { return d.info().image_size; }
py::ssize_t Views(const Dataset& d) { return d.info().views; }

// Raises for an index out of range.
int CheckedModel(const Dataset& d, int model) {
  if (model < 0 || model >= static_cast<int>(d.models().size()))
    throw py::index_error(
        fmt::format("{}: model {} of {}", d.folder().string(), model, d.models().size()));
  return model;
}

py::dict InfoDict(const Dataset& d) {
  const train::DatasetInfo& info = d.info();
  return py::dict(py::arg("source") = Text(info.source), py::arg("image_size") = info.image_size,
                  py::arg("views") = info.views, py::arg("classes") = info.classes,
                  py::arg("credits") = info.credits, py::arg("recipe") = Text(info.recipe));
}

py::list ModelList(const Dataset& d) {
  py::list out;
  for (const train::ModelInfo& model : d.models()) {
    out.append(py::dict(
        py::arg("id") = Text(model.id), py::arg("name") = Text(model.name),
        py::arg("class_index") = model.class_index,
        py::arg("split") = train::SplitName(model.split), py::arg("license") = Text(model.license),
        py::arg("creator") = Text(model.creator), py::arg("source_faces") = model.source_faces));
  }
  return out;
}

// [views,17] as cameras of the renderer.
py::array CameraArray(const Dataset& d, const std::vector<Camera>& cameras) {
  std::vector<double> out;
  for (const Camera& camera : cameras) {
    const auto numbers = NumbersOf(CameraCast<double>(camera));
    out.insert(out.end(), numbers.begin(), numbers.end());
  }
  return OwnedArray<double>(std::move(out), {Views(d), static_cast<py::ssize_t>(kCameraNumbers)});
}

py::array Cameras(const Dataset& d) { return CameraArray(d, train::CamerasOf(d.info(), {})); }

py::array LoadModelCameras(const Dataset& d, int model) {
  const int checked = CheckedModel(d, model);
  return CameraArray(d, ValueOrThrow(WithoutGil([&] { return d.LoadCameras(checked); })));
}

py::array LoadImages(const Dataset& d, int model) {
  const int checked = CheckedModel(d, model);
  auto images = ValueOrThrow(WithoutGil([&] { return d.LoadImages(checked); }));
  return OwnedArray<std::uint8_t>(std::move(images), {Views(d), 4, Side(d), Side(d)});
}

py::array LoadAllImages(const Dataset& d, const std::vector<int>& models, int threads) {
  for (const int model : models) CheckedModel(d, model);
  auto store = ValueOrThrow(WithoutGil([&] {
    const Workers workers(threads);
    return train::LoadImageStore(d, models, workers, {});
  }));
  return OwnedArray<std::uint8_t>(std::move(store.bytes),
                                  {store.models, store.views, 4, store.size, store.size});
}

py::dict LoadTruth(const Dataset& d, int model) {
  const int checked = CheckedModel(d, model);
  train::ModelData data = ValueOrThrow(WithoutGil([&] { return d.Load(checked); }));
  const auto points = static_cast<py::ssize_t>(data.points.size());
  constexpr py::ssize_t kSide = train::kOccupancyResolution;
  py::dict out;
  out["occupancy"] = OwnedArray<std::uint8_t>(std::move(data.occupancy), {kSide, kSide, kSide});
  out["points"] = OwnedArray<float>(std::move(data.points), {points, 3});
  out["mesh"] = data.mesh.faces.empty() ? py::object(py::none()) : MeshToDict(std::move(data.mesh));
  return out;
}

// The models and views that training shows at a step: [size], [size,views] int32.
py::tuple Batch(train::BatchOrder& order, std::int64_t step, int size, int views) {
  std::vector<std::int32_t> models, shown;
  for (const train::Sample& sample : order.Batch(step, size, views)) {
    models.push_back(sample.model);
    shown.insert(shown.end(), sample.views.begin(), sample.views.end());
  }
  return py::make_tuple(OwnedArray<std::int32_t>(std::move(models), {size}),
                        OwnedArray<std::int32_t>(std::move(shown), {size, views}));
}

}  // namespace

void BindDataset(py::module_& m) {
  py::class_<Dataset>(m, "DatasetFiles", "A dataset on disk.")
      .def(py::init([](const Path& folder) { return ValueOrThrow(Dataset::Open(folder)); }))
      .def_property_readonly("info", &InfoDict, "Source, camera and image settings.")
      .def_property_readonly("models", &ModelList, "Metadata of each model.")
      .def_property_readonly("cameras", &Cameras, "(views, 17) float64.")
      .def("load_images", &LoadImages, "(views, 4, H, W) uint8.")
      .def("load_all_images", &LoadAllImages, "(models, views, 4, H, W) uint8.")
      .def("load_cameras", &LoadModelCameras, "Of its views, (views, 17) float64.")
      .def("load_truth", &LoadTruth, "Occupancy, points, mesh.");
  py::class_<train::BatchOrder>(m, "BatchOrder", "Training batches, one per step.")
      .def(py::init<int, int, std::uint64_t>())
      .def("batch", &Batch, "Models (size,) and their views (size, views), int32.");
}

}  // namespace tilegrad::python
