// SPDX-License-Identifier: Apache-2.0
// What tilegrad.compat.kaolin needs of the engine: faces that come projected. Arrays are float32 or
// float64, all of a call the same; the Python side has named and converted what the caller gave.
#include <pybind11/stl.h>

#include <optional>
#include <utility>

#include "bindings/calls.h"
#include "bindings/shared_workers.h"
#include "compat/kaolin/projected_raster.h"
#include "compat/kaolin/projected_soft_mask.h"

namespace tilegrad::python {

void BindKaolin(py::module_& m);

namespace {

namespace kaolin = compat::kaolin;

using py::ssize_t;

constexpr char kFaces[] = "face_vertices_image";  // the argument that all functions begin with

// Lengths of the axes that arrays share.
struct Lengths {
  ssize_t images, faces;

  explicit Lengths(const py::array& xy)
      : images(xy.ndim() == 4 ? xy.shape(0) : 0), faces(xy.ndim() == 4 ? xy.shape(1) : 0) {}
  std::size_t n() const { return static_cast<std::size_t>(images); }
  std::size_t f() const { return static_cast<std::size_t>(faces); }
};

struct RasterCall {
  py::array z, features;
  std::optional<py::array> valid;
  int height, width;
  double eps;
  int threads;
};

template <class T>
py::tuple Rasterize(const py::array& xy, const RasterCall& call) {
  constexpr char kName[] = "rasterize";
  const Lengths of(xy);
  compat::ProjectedBatchT<T> batch{of.n(), of.f(), {}, {}, {}};
  batch.xy = SpanOf<T>(xy, kName, "face_vertices_image", {of.images, of.faces, 3, 2});
  batch.z = SpanOf<T>(call.z, kName, "face_vertices_z", {of.images, of.faces, 3});
  if (call.valid) {
    batch.valid = SpanOf<std::uint8_t>(*call.valid, kName, "valid_faces", {of.images, of.faces});
  }
  const auto features =
      SpanOf<T>(call.features, kName, "face_features", {of.images, of.faces, 3, kAny});
  const ssize_t channels = call.features.shape(3);
  auto image = NewArray<T>({of.images, call.height, call.width, channels});
  auto ids = NewArray<std::int32_t>({of.images, call.height, call.width});
  const auto to_image = NumbersOf(image);
  const auto to_ids = NumbersOf(ids);
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] {
    return kaolin::RasterizeProjected<T>(batch, {{call.width, call.height}, call.eps}, features,
                                         static_cast<std::size_t>(channels), workers, to_ids,
                                         to_image);
  });
  return py::make_tuple(image, ids);
}

struct RasterBackwardCall {
  py::array features, ids, d_image;
  double eps;
  bool wants_xy, wants_features;
  int threads;
};

template <class T>
py::tuple RasterizeBackward(const py::array& xy, const RasterBackwardCall& call) {
  constexpr char kName[] = "rasterize's backward pass";
  const Lengths of(xy);
  compat::ProjectedBatchT<T> batch{of.n(), of.f(), {}, {}, {}};
  batch.xy = SpanOf<T>(xy, kName, "face_vertices_image", {of.images, of.faces, 3, 2});
  const auto features =
      SpanOf<T>(call.features, kName, "face_features", {of.images, of.faces, 3, kAny});
  const ssize_t channels = call.features.shape(3);
  kaolin::ProjectedRasterAdjoint<T> adjoint;
  adjoint.face_ids = SpanOf<std::int32_t>(call.ids, kName, "face_idx", {of.images, kAny, kAny});
  const ssize_t height = call.ids.shape(1), width = call.ids.shape(2);
  adjoint.d_image =
      SpanOf<T>(call.d_image, kName, "the gradient", {of.images, height, width, channels});
  auto d_xy = NewArray<T>({call.wants_xy ? of.images : 0, of.faces, 3, 2});
  auto d_features = NewArray<T>({call.wants_features ? of.images : 0, of.faces, 3, channels});
  adjoint.d_xy = NumbersOf(d_xy);
  adjoint.d_features = NumbersOf(d_features);
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] {
    return kaolin::RasterizeProjectedBackward<T>(
        batch, {{static_cast<int>(width), static_cast<int>(height)}, call.eps}, features,
        static_cast<std::size_t>(channels), workers, adjoint);
  });
  return py::make_tuple(d_xy, d_features);
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
      : of(xy), batch{of.n(), of.f(), {}, {}, {}}, options(rule) {
    batch.xy = SpanOf<T>(xy, name, "face_vertices_image", {of.images, of.faces, 3, 2});
    ids = SpanOf<std::int32_t>(face_ids, name, "selected_face_idx", {of.images, kAny, kAny});
    height = face_ids.shape(1);
    width = face_ids.shape(2);
    options.size = {static_cast<int>(width), static_cast<int>(height)};
  }
};

template <class T>
py::tuple SoftMask(const py::array& xy, const py::array& ids,
                   const kaolin::ProjectedMaskOptions& options, int threads) {
  constexpr char kName[] = "dibr_soft_mask";
  const MaskInput<T> in(kName, xy, ids, options);
  auto mask = NewArray<T>({in.of.images, in.height, in.width});
  const auto to = NumbersOf(mask);
  double bound = 0;
  const Workers& workers = SharedWorkers(threads);
  Run(kName, [&]() -> Status {
    TILEGRAD_ASSIGN(bound, kaolin::ProjectedSoftMask<T>(in.batch, in.options, in.ids, workers, to));
    return {};
  });
  return py::make_tuple(mask, bound);
}

struct MaskBackwardCall {
  py::array ids, mask, d_mask;
  const kaolin::ProjectedMaskOptions& options;
  int threads;
};

template <class T>
py::array_t<T> SoftMaskBackward(const py::array& xy, const MaskBackwardCall& call) {
  constexpr char kName[] = "dibr_soft_mask's backward pass";
  const MaskInput<T> in(kName, xy, call.ids, call.options);
  const auto mask = SpanOf<T>(call.mask, kName, "the mask", {in.of.images, in.height, in.width});
  const auto d_mask =
      SpanOf<T>(call.d_mask, kName, "the gradient", {in.of.images, in.height, in.width});
  auto d_xy = NewArray<T>({in.of.images, in.of.faces, 3, 2});
  const auto to = NumbersOf(d_xy);
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] {
    return kaolin::ProjectedSoftMaskBackward<T>(in.batch, in.options, workers,
                                                {in.ids, mask, d_mask, to});
  });
  return d_xy;
}

void BindMaskOptions(py::module_& m) {
  py::class_<kaolin::ProjectedMaskOptions>(m, "ProjectedMaskOptions",
                                           "How projected_soft_mask works.")
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

void BindRasterize(py::module_& m) {
  m.def(
      "rasterize_projected",
      [](const py::array& xy, py::array z, py::array features, std::optional<py::array> valid,
         int height, int width, double eps, int threads) {
        const RasterCall call{
            std::move(z), std::move(features), std::move(valid), height, width, eps, threads};
        return Dispatch(xy, "rasterize", kFaces,
                        [&](auto t) { return Rasterize<decltype(t)>(xy, call); });
      },
      py::arg("face_vertices_image"), py::arg("face_vertices_z"), py::arg("face_features"),
      py::arg("valid_faces"), py::arg("height"), py::arg("width"), py::arg("eps"),
      py::arg("threads"),
      "face_vertices_image (N, F, 3, 2), face_vertices_z (N, F, 3), face_features (N, F, 3, C),\n"
      "valid_faces (N, F) uint8 or None, eps in NDC^2 -> the image (N, H, W, C), face_idx\n"
      "(N, H, W) int32");
  m.def(
      "rasterize_projected_backward",
      [](const py::array& xy, py::array features, py::array ids, py::array d_image, double eps,
         bool wants_xy, bool wants_features, int threads) {
        const RasterBackwardCall call{
            std::move(features), std::move(ids), std::move(d_image), eps, wants_xy,
            wants_features,      threads};
        return Dispatch(xy, "rasterize's backward pass", kFaces,
                        [&](auto t) { return RasterizeBackward<decltype(t)>(xy, call); });
      },
      py::arg("face_vertices_image"), py::arg("face_features"), py::arg("face_idx"),
      py::arg("gradient"), py::arg("eps"), py::arg("wants_face_vertices_image"),
      py::arg("wants_face_features"), py::arg("threads"),
      "gradient (N, H, W, C) -> gradients of face_vertices_image (N, F, 3, 2) and face_features\n"
      "(N, F, 3, C); empty where not wanted");
}

void BindSoftMask(py::module_& m) {
  m.def(
      "projected_soft_mask",
      [](const py::array& xy, const py::array& ids, const kaolin::ProjectedMaskOptions& options,
         int threads) {
        return Dispatch(xy, "dibr_soft_mask", kFaces,
                        [&](auto t) { return SoftMask<decltype(t)>(xy, ids, options, threads); });
      },
      py::arg("face_vertices_image"), py::arg("selected_face_idx"), py::arg("options"),
      py::arg("threads"),
      "face_vertices_image (N, F, 3, 2), selected_face_idx (N, H, W) int32 -> the mask (N, H, W),\n"
      "and how far it may be from equation 6");
  m.def(
      "projected_soft_mask_backward",
      [](const py::array& xy, py::array ids, py::array mask, py::array d_mask,
         const kaolin::ProjectedMaskOptions& options, int threads) {
        const MaskBackwardCall call{std::move(ids), std::move(mask), std::move(d_mask), options,
                                    threads};
        return Dispatch(xy, "dibr_soft_mask's backward pass", kFaces, [&](auto t) -> py::array {
          return SoftMaskBackward<decltype(t)>(xy, call);
        });
      },
      py::arg("face_vertices_image"), py::arg("selected_face_idx"), py::arg("soft_mask"),
      py::arg("gradient"), py::arg("options"), py::arg("threads"),
      "soft_mask and its gradient (N, H, W) -> the gradient of face_vertices_image (N, F, 3, 2)");
}

}  // namespace

void BindKaolin(py::module_& m) {
  BindMaskOptions(m);
  BindRasterize(m);
  BindSoftMask(m);
}

}  // namespace tilegrad::python
