// SPDX-License-Identifier: Apache-2.0
// What tilegrad.compat.kaolin needs of the engine: faces that come projected. Arrays are float32 or
// float64, all of a call the same; the Python side has named and converted what the caller gave.
#include <pybind11/stl.h>

#include <optional>
#include <utility>

#include "bindings/calls.h"
#include "compat/kaolin/projected_raster.h"
#include "compat/pytorch3d_raster.h"

namespace tilegrad::python {
namespace {

namespace kaolin = compat::kaolin;

using py::ssize_t;

constexpr char kFaces[] = "face_vertices_image";  // the argument that all functions begin with

// Lengths of the axes that arrays share.
struct Lengths {
  ssize_t images, faces;

  explicit Lengths(const py::array& xy)
      : images(xy.ndim() == 4 ? xy.shape(0) : 0), faces(xy.ndim() == 4 ? xy.shape(1) : 0) {}
};

// The corners of the faces, all that the functions have in common.
template <class T>
compat::ProjectedBatchT<T> BatchOf(const char* function, const py::array& xy, const Lengths& of) {
  const auto images = static_cast<std::size_t>(of.images);
  const auto faces = static_cast<std::size_t>(of.faces);
  return {images, faces, SpanOf<T>(xy, function, kFaces, {of.images, of.faces, 3, 2}), {}, {}};
}

py::tuple RasterizeFaces(const py::array& xy, const py::array& z, const py::array& features,
                         const std::optional<py::array>& valid, int height, int width, double eps,
                         int threads) {
  constexpr char kName[] = "rasterize";
  return Dispatch(xy, kName, kFaces, [&]<class T>(T) {
    const Lengths of(xy);
    auto batch = BatchOf<T>(kName, xy, of);
    batch.z = SpanOf<T>(z, kName, "face_vertices_z", {of.images, of.faces, 3});
    batch.valid = OptionalSpanOf<std::uint8_t>(valid, kName, "valid_faces", {of.images, of.faces});
    const auto values = SpanOf<T>(features, kName, "face_features", {of.images, of.faces, 3, kAny});
    const ssize_t channels = features.shape(3);
    auto image = NewArray<T>({of.images, height, width, channels});
    auto ids = NewArray<std::int32_t>({of.images, height, width});
    const auto to_image = NumbersOf(image);
    const auto to_ids = NumbersOf(ids);
    Run(kName, threads, [&](const Workers& workers) {
      return kaolin::RasterizeProjected<T>(batch, {{width, height}, eps}, values,
                                           static_cast<std::size_t>(channels), workers, to_ids,
                                           to_image);
    });
    return py::make_tuple(image, ids);
  });
}

py::tuple RasterizeFacesBackward(const py::array& xy, const py::array& features,
                                 const py::array& ids, const py::array& d_image, double eps,
                                 bool wants_xy, bool wants_features, int threads) {
  constexpr char kName[] = "rasterize's backward pass";
  return Dispatch(xy, kName, kFaces, [&]<class T>(T) {
    const Lengths of(xy);
    const auto batch = BatchOf<T>(kName, xy, of);
    const auto values = SpanOf<T>(features, kName, "face_features", {of.images, of.faces, 3, kAny});
    const ssize_t channels = features.shape(3);
    kaolin::ProjectedRasterAdjoint<T> adjoint;
    adjoint.face_ids = SpanOf<std::int32_t>(ids, kName, "face_idx", {of.images, kAny, kAny});
    const ssize_t height = ids.shape(1), width = ids.shape(2);
    adjoint.d_image =
        SpanOf<T>(d_image, kName, "the gradient", {of.images, height, width, channels});
    auto d_xy = NewArray<T>({wants_xy ? of.images : 0, of.faces, 3, 2});
    auto d_features = NewArray<T>({wants_features ? of.images : 0, of.faces, 3, channels});
    adjoint.d_xy = NumbersOf(d_xy);
    adjoint.d_features = NumbersOf(d_features);
    Run(kName, threads, [&](const Workers& workers) {
      return kaolin::RasterizeProjectedBackward<T>(
          batch, {{static_cast<int>(width), static_cast<int>(height)}, eps}, values,
          static_cast<std::size_t>(channels), workers, adjoint);
    });
    return py::make_tuple(d_xy, d_features);
  });
}

// Faces, and the images that their mask is for.
template <class T>
struct MaskInput {
  Lengths of;
  compat::ProjectedBatchT<T> batch;
  std::span<const std::int32_t> ids;
  ssize_t height, width;
  kaolin::ProjectedMaskOptions options;

  MaskInput(const char* name, const py::array& xy, const py::array& face_ids,
            const kaolin::ProjectedMaskOptions& rule)
      : of(xy), batch(BatchOf<T>(name, xy, of)), options(rule) {
    ids = SpanOf<std::int32_t>(face_ids, name, "selected_face_idx", {of.images, kAny, kAny});
    height = face_ids.shape(1);
    width = face_ids.shape(2);
    options.size = {static_cast<int>(width), static_cast<int>(height)};
  }
};

py::tuple SoftMask(const py::array& xy, const py::array& ids,
                   const kaolin::ProjectedMaskOptions& options, int threads) {
  constexpr char kName[] = "dibr_soft_mask";
  return Dispatch(xy, kName, kFaces, [&]<class T>(T) {
    const MaskInput<T> in(kName, xy, ids, options);
    auto mask = NewArray<T>({in.of.images, in.height, in.width});
    const auto to = NumbersOf(mask);
    double bound = 0;
    Run(kName, threads, [&](const Workers& workers) -> Status {
      TILEGRAD_ASSIGN(bound,
                      kaolin::ProjectedSoftMask<T>(in.batch, in.options, in.ids, workers, to));
      return {};
    });
    return py::make_tuple(mask, bound);
  });
}

py::array SoftMaskBackward(const py::array& xy, const py::array& ids, const py::array& mask,
                           const py::array& d_mask, const kaolin::ProjectedMaskOptions& options,
                           int threads) {
  constexpr char kName[] = "dibr_soft_mask's backward pass";
  return Dispatch(xy, kName, kFaces, [&]<class T>(T) -> py::array {
    const MaskInput<T> in(kName, xy, ids, options);
    const auto alpha = SpanOf<T>(mask, kName, "the mask", {in.of.images, in.height, in.width});
    const auto d_alpha =
        SpanOf<T>(d_mask, kName, "the gradient", {in.of.images, in.height, in.width});
    auto d_xy = NewArray<T>({in.of.images, in.of.faces, 3, 2});
    const auto to = NumbersOf(d_xy);
    Run(kName, threads, [&](const Workers& workers) {
      return kaolin::ProjectedSoftMaskBackward<T>(in.batch, in.options, workers,
                                                  {in.ids, alpha, d_alpha, to});
    });
    return d_xy;
  });
}

void BindMaskOptions(py::module_& m) {
  py::class_<kaolin::ProjectedMaskOptions>(m, "ProjectedMaskOptions",
                                           "Options of projected_soft_mask.")
      .def(py::init([](double delta, double max_alpha_error) {
             kaolin::ProjectedMaskOptions options;
             options.delta = delta;
             options.max_alpha_error = max_alpha_error;
             return options;
           }),
           py::kw_only(), py::arg("delta"), py::arg("max_alpha_error"))
      .def_static(
          "paper",
          [](double delta, double boxlen, int knum, double edge_eps) {
            kaolin::ProjectedMaskOptions options;
            options.delta = delta;
            options.rule = AlphaRule::kPaper;
            options.paper_box = boxlen;
            options.paper_faces = knum;
            options.paper_eps = edge_eps;
            return options;
          },
          py::kw_only(), py::arg("delta"), py::arg("boxlen"), py::arg("knum"), py::arg("edge_eps"),
          "The rule of the paper's implementations: boxes grown by boxlen (NDC), the first knum\n"
          "faces, edge_eps (NDC^2) added to squared lengths.");
}

// What tilegrad.fragments needs of the engine.

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
    Run(kForward, threads, [&](const Workers& workers) {
      return pytorch3d::RasterizeLayers<T>(vertices, images, options, workers, out);
    });
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
    Run(kBackward, threads, [&](const Workers& workers) {
      return pytorch3d::RasterizeLayersBackward<T>(vertices, options, workers, adjoint);
    });
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

void BindKaolin(py::module_& m) {
  BindMaskOptions(m);
  m.def("rasterize_projected", &RasterizeFaces,
        "face_vertices_image (N, F, 3, 2), face_vertices_z (N, F, 3), face_features (N, F, 3, C),\n"
        "valid_faces (N, F) uint8 or None, eps in NDC^2 -> the image (N, H, W, C), face_idx\n"
        "(N, H, W) int32");
  m.def("rasterize_projected_backward", &RasterizeFacesBackward,
        "gradient (N, H, W, C) -> gradients of face_vertices_image (N, F, 3, 2) and "
        "face_features\n(N, F, 3, C); empty if not requested");
  m.def("projected_soft_mask", &SoftMask,
        "face_vertices_image (N, F, 3, 2), selected_face_idx (N, H, W) int32 -> the mask\n"
        "(N, H, W), and how far it may be from equation 6");
  m.def("projected_soft_mask_backward", &SoftMaskBackward,
        "soft_mask and its gradient (N, H, W) -> the gradient of face_vertices_image (N, F, 3, 2)");
}

void BindPytorch3d(py::module_& m) {
  BindLayeredOptions(m);
  m.def("rasterize_layers", &Layers,
        "face_vertices (F, 3, 3), images: the first face and the number of faces of each ->\n"
        "pix_to_face (N, H, W, K) int64, zbuf (N, H, W, K), bary_coords (N, H, W, K, 3), dists\n"
        "(N, H, W, K)");
  m.def("rasterize_layers_backward", &LayersBackward,
        "pix_to_face and gradients in the shapes of rasterize_layers -> the gradient of\n"
        "face_vertices (F, 3, 3)");
}

}  // namespace tilegrad::python
