// SPDX-License-Identifier: Apache-2.0
// What tilegrad.fragments needs of the engine.
#include <pybind11/stl.h>

#include <utility>

#include "bindings/calls.h"
#include "compat/pytorch3d/layered_raster.h"

namespace tilegrad::python {

void BindPytorch3d(py::module_& m);

namespace {

namespace pytorch3d = compat::pytorch3d;

constexpr char kForward[] = "fragments";
constexpr char kBackward[] = "the backward pass of fragments";

// [N] pairs of the first packed face and the number of faces.
using Ranges = std::vector<std::pair<std::int64_t, std::int64_t>>;

py::tuple Layers(const py::array& faces, const Ranges& ranges,
                 const pytorch3d::LayeredOptions& options, int threads) {
  std::vector<pytorch3d::FaceRange> images;
  for (const auto& [first, count] : ranges) images.push_back({first, count});
  return Dispatch(faces, kForward, "face_vertices", [&]<class T>(T) {
    const auto vertices = SpanOf<T>(faces, kForward, "face_vertices", {kAny, 3, 3});
    const std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(images.size()),
                                            options.size.height, options.size.width,
                                            options.faces_per_pixel};
    auto ids = NewArray<std::int64_t>(shape);
    auto z = NewArray<T>(shape), dists = NewArray<T>(shape);
    auto bary = NewArray<T>({shape[0], shape[1], shape[2], shape[3], 3});
    const pytorch3d::LayeredImages<T> out{NumbersOf(ids), NumbersOf(z), NumbersOf(bary),
                                          NumbersOf(dists)};
    const Workers& workers = SharedWorkers(threads);
    Run(kForward,
        [&] { return pytorch3d::RasterizeLayers<T>(vertices, images, options, workers, out); });
    return py::make_tuple(ids, z, bary, dists);
  });
}

py::array LayersBackward(const py::array& faces, const py::array& ids, const py::array& d_z,
                         const py::array& d_bary, const py::array& d_dists,
                         const pytorch3d::LayeredOptions& options, int threads) {
  return Dispatch(faces, kBackward, "face_vertices", [&]<class T>(T) -> py::array {
    const auto vertices = SpanOf<T>(faces, kBackward, "face_vertices", {kAny, 3, 3});
    const std::vector<py::ssize_t> shape = {kAny, options.size.height, options.size.width,
                                            options.faces_per_pixel};
    auto d_vertices = NewArray<T>({faces.shape(0), 3, 3});
    const pytorch3d::LayeredAdjoint<T> adjoint{
        SpanOf<std::int64_t>(ids, kBackward, "pix_to_face", shape),
        SpanOf<T>(d_z, kBackward, "the gradient of zbuf", shape),
        SpanOf<T>(d_bary, kBackward, "the gradient of bary_coords",
                  {kAny, shape[1], shape[2], shape[3], 3}),
        SpanOf<T>(d_dists, kBackward, "the gradient of dists", shape), NumbersOf(d_vertices)};
    const Workers& workers = SharedWorkers(threads);
    Run(kBackward,
        [&] { return pytorch3d::RasterizeLayersBackward<T>(vertices, options, workers, adjoint); });
    return d_vertices;
  });
}

void BindLayeredOptions(py::module_& m) {
  py::class_<pytorch3d::LayeredOptions>(m, "LayeredOptions", "Options of rasterize_layers.")
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
  m.def("rasterize_layers", &Layers, py::arg("face_vertices"), py::arg("images"),
        py::arg("options"), py::arg("threads"),
        "face_vertices (F, 3, 3), images: the first face and the number of faces of each ->\n"
        "pix_to_face (N, H, W, K) int64, zbuf (N, H, W, K), bary_coords (N, H, W, K, 3), dists\n"
        "(N, H, W, K)");
  m.def("rasterize_layers_backward", &LayersBackward, py::arg("face_vertices"),
        py::arg("pix_to_face"), py::arg("d_zbuf"), py::arg("d_bary_coords"), py::arg("d_dists"),
        py::arg("options"), py::arg("threads"),
        "pix_to_face and gradients in the shapes of rasterize_layers -> the gradient of\n"
        "face_vertices (F, 3, 3)");
}

}  // namespace tilegrad::python
