// SPDX-License-Identifier: Apache-2.0
// What tilegrad.fragments needs of the engine.
#include <pybind11/stl.h>

#include <utility>

#include "bindings/calls.h"
#include "bindings/shared_workers.h"
#include "compat/pytorch3d/layered_raster.h"

namespace tilegrad::python {

void BindPytorch3d(py::module_& m);

namespace {

namespace pytorch3d = compat::pytorch3d;

constexpr char kForward[] = "fragments";
constexpr char kBackward[] = "the backward pass of fragments";

// [N] pairs of the first packed face and the number of faces.
std::vector<pytorch3d::FaceRange> RangesOf(
    const std::vector<std::pair<std::int64_t, std::int64_t>>& pairs) {
  std::vector<pytorch3d::FaceRange> out;
  for (const auto& [first, count] : pairs) out.push_back({first, count});
  return out;
}

template <class T>
py::tuple Layers(const py::array& faces, const std::vector<pytorch3d::FaceRange>& images,
                 const pytorch3d::LayeredOptions& options, int threads) {
  const auto vertices = SpanOf<T>(faces, kForward, "face_vertices", {kAny, 3, 3});
  const auto n = static_cast<py::ssize_t>(images.size());
  const py::ssize_t height = options.size.height, width = options.size.width;
  const py::ssize_t layers = options.faces_per_pixel;
  auto ids = NewArray<std::int64_t>({n, height, width, layers});
  auto z = NewArray<T>({n, height, width, layers}), dists = NewArray<T>({n, height, width, layers});
  auto bary = NewArray<T>({n, height, width, layers, 3});
  const pytorch3d::LayeredImages<T> out{NumbersOf(ids), NumbersOf(z), NumbersOf(bary),
                                        NumbersOf(dists)};
  const Workers& workers = SharedWorkers(threads);
  Run(kForward,
      [&] { return pytorch3d::RasterizeLayers<T>(vertices, images, options, workers, out); });
  return py::make_tuple(ids, z, bary, dists);
}

struct Cotangents {
  py::array ids, d_z, d_bary, d_dists;
};

template <class T>
py::array_t<T> LayersBackward(const py::array& faces, const Cotangents& given,
                              const pytorch3d::LayeredOptions& options, int threads) {
  const auto vertices = SpanOf<T>(faces, kBackward, "face_vertices", {kAny, 3, 3});
  const py::ssize_t height = options.size.height, width = options.size.width;
  const py::ssize_t layers = options.faces_per_pixel;
  const std::vector<py::ssize_t> shape = {kAny, height, width, layers};
  auto d_vertices = NewArray<T>({faces.shape(0), 3, 3});
  const pytorch3d::LayeredAdjoint<T> adjoint{
      SpanOf<std::int64_t>(given.ids, kBackward, "pix_to_face", shape),
      SpanOf<T>(given.d_z, kBackward, "the gradient of zbuf", shape),
      SpanOf<T>(given.d_bary, kBackward, "the gradient of bary_coords",
                {kAny, height, width, layers, 3}),
      SpanOf<T>(given.d_dists, kBackward, "the gradient of dists", shape), NumbersOf(d_vertices)};
  const Workers& workers = SharedWorkers(threads);
  Run(kBackward,
      [&] { return pytorch3d::RasterizeLayersBackward<T>(vertices, options, workers, adjoint); });
  return d_vertices;
}

void BindLayeredOptions(py::module_& m) {
  py::class_<pytorch3d::LayeredOptions>(m, "LayeredOptions", "What rasterize_layers draws.")
      .def(py::init([](int height, int width, int faces_per_pixel, double blur_radius,
                       bool perspective_correct, bool clip_barycentrics, bool cull_backfaces) {
             return pytorch3d::LayeredOptions{{width, height},
                                              faces_per_pixel,
                                              blur_radius,
                                              cull_backfaces,
                                              {perspective_correct, clip_barycentrics}};
           }),
           py::kw_only(), py::arg("height"), py::arg("width"), py::arg("faces_per_pixel"),
           py::arg("blur_radius"), py::arg("perspective_correct"), py::arg("clip_barycentrics"),
           py::arg("cull_backfaces"));
}

}  // namespace

void BindPytorch3d(py::module_& m) {
  BindLayeredOptions(m);
  m.def(
      "rasterize_layers",
      [](const py::array& faces, const std::vector<std::pair<std::int64_t, std::int64_t>>& images,
         const pytorch3d::LayeredOptions& options, int threads) {
        return Dispatch(faces, kForward, "face_vertices", [&](auto t) {
          return Layers<decltype(t)>(faces, RangesOf(images), options, threads);
        });
      },
      py::arg("face_vertices"), py::arg("images"), py::arg("options"), py::arg("threads"),
      "face_vertices (F, 3, 3), images: the first face and the number of faces of each ->\n"
      "pix_to_face (N, H, W, K) int64, zbuf (N, H, W, K), bary_coords (N, H, W, K, 3), dists\n"
      "(N, H, W, K)");
  m.def(
      "rasterize_layers_backward",
      [](const py::array& faces, py::array ids, py::array d_z, py::array d_bary, py::array d_dists,
         const pytorch3d::LayeredOptions& options, int threads) {
        const Cotangents given{std::move(ids), std::move(d_z), std::move(d_bary),
                               std::move(d_dists)};
        return Dispatch(faces, kBackward, "face_vertices", [&](auto t) -> py::array {
          return LayersBackward<decltype(t)>(faces, given, options, threads);
        });
      },
      py::arg("face_vertices"), py::arg("pix_to_face"), py::arg("d_zbuf"), py::arg("d_bary_coords"),
      py::arg("d_dists"), py::arg("options"), py::arg("threads"),
      "pix_to_face and gradients in the shapes of rasterize_layers -> the gradient of\n"
      "face_vertices (F, 3, 3)");
}

}  // namespace tilegrad::python
