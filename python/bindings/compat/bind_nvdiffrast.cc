// SPDX-License-Identifier: Apache-2.0
// What tilegrad.compat.nvdiffrast needs of the engine: the geometry's part;
// bind_nvdiffrast_texture.cc has the rest.
#include <pybind11/stl.h>

#include <memory>
#include <mutex>
#include <utility>

#include "bindings/calls.h"
#include "compat/nvdiffrast/antialias.h"
#include "compat/nvdiffrast/interpolate.h"
#include "compat/nvdiffrast/rasterize.h"

namespace tilegrad::python {

void BindNvdiffrastTexture(py::module_& m);

namespace {

namespace nvdiffrast = compat::nvdiffrast;

using nvdiffrast::PixelGrid;
using nvdiffrast::VertexRows;
using OptionalArray = std::optional<py::array>;

std::size_t Extent(const py::array& array, int axis) {
  return axis < array.ndim() ? static_cast<std::size_t>(array.shape(axis)) : 0;
}

// [N,V,C], or [V,C] for all images.
template <class T>
VertexRows<T> RowsOf(const py::array& array, const char* function, const char* argument,
                     py::ssize_t images) {
  const bool shared = array.ndim() == 2;
  const auto values = shared ? SpanOf<T>(array, function, argument, {kAny, kAny})
                             : SpanOf<T>(array, function, argument, {images, kAny, kAny});
  return {values, Extent(array, shared ? 0 : 1), Extent(array, shared ? 1 : 2), shared};
}

PixelGrid GridOf(const py::array& image) {
  return {Extent(image, 0), static_cast<int>(Extent(image, 1)), static_cast<int>(Extent(image, 2))};
}

std::span<const std::int32_t> FacesOf(const py::array& tri, const char* function) {
  return SpanOf<std::int32_t>(tri, function, "tri", {kAny, 3});
}

// Images of the size of another one, of some channels.
template <class T>
std::span<const T> ImageOf(const OptionalArray& image, const char* function, const char* argument,
                           const py::array& like, py::ssize_t channels) {
  return OptionalSpanOf<T>(image, function, argument,
                           {like.shape(0), like.shape(1), like.shape(2), channels});
}

// The engine's rasterizer for any thread: a thread that finds it in use takes a new one.
class NvdiffrastRasterizer {
 public:
  py::tuple Rasterize(const py::array& pos, const py::array& tri, const OptionalArray& ranges,
                      int height, int width, const OptionalArray& peeled, int threads) {
    constexpr char kName[] = "rasterize";
    return Dispatch(pos, kName, "pos", [&]<class T>(T) {
      const py::ssize_t n = ranges ? ranges->shape(0) : pos.shape(0);
      nvdiffrast::RasterizeInput<T> input{
          RowsOf<T>(pos, kName, "pos", n),
          FacesOf(tri, kName),
          OptionalSpanOf<std::int32_t>(ranges, kName, "ranges", {n, 2}),
          {static_cast<std::size_t>(n), height, width}};
      if (input.positions.channels != 4 || input.positions.shared != ranges.has_value()) {
        throw py::value_error("rasterize: pos must be [N, V, 4], or [V, 4] with ranges");
      }
      auto rast = NewArray<T>({n, height, width, 4});
      auto rast_db = NewArray<T>({n, height, width, 4});
      nvdiffrast::RasterizeOutput<T> out{NumbersOf(rast), NumbersOf(rast_db), {}};
      if (peeled) out.peeled = MutableSpanOf<float>(*peeled, kName, "peeled", {n, height, width});
      Run(kName, threads, [&](const Workers& workers) {
        const std::unique_lock lock(mutex_, std::try_to_lock);
        nvdiffrast::Rasterizer own;
        return (lock.owns_lock() ? rasterizer_ : own).Run(input, workers, out);
      });
      return py::make_tuple(rast, rast_db);
    });
  }

 private:
  std::mutex mutex_;
  nvdiffrast::Rasterizer rasterizer_;
};

py::array RasterizeBackward(const py::array& pos, const py::array& tri, const py::array& rast,
                            const OptionalArray& d_rast, const OptionalArray& d_rast_db,
                            int threads) {
  constexpr char kName[] = "rasterize's backward pass";
  return Dispatch(pos, kName, "pos", [&]<class T>(T) -> py::array {
    nvdiffrast::RasterizeInput<T> input{
        RowsOf<T>(pos, kName, "pos", rast.shape(0)), FacesOf(tri, kName), {}, GridOf(rast)};
    const nvdiffrast::RasterizeCotangents<T> cotangents{
        SpanOf<T>(rast, kName, "rast", {kAny, kAny, kAny, 4}),
        ImageOf<T>(d_rast, kName, "the gradient of rast", rast, 4),
        ImageOf<T>(d_rast_db, kName, "the gradient of rast_db", rast, 4)};
    auto d_pos = NewArrayLike<T>(pos);
    const auto to = NumbersOf(d_pos);
    Run(kName, threads, [&](const Workers& workers) {
      return nvdiffrast::RasterizeBackward<T>(input, cotangents, workers, to);
    });
    return d_pos;
  });
}

struct InterpolateCall {
  py::array tri, rast;
  OptionalArray rast_db;
  py::array diff_attrs;
  int threads;
};

template <class T>
nvdiffrast::InterpolateInput<T> InterpolateInputOf(const py::array& attr,
                                                   const InterpolateCall& call,
                                                   const char* function) {
  const auto rast = SpanOf<T>(call.rast, function, "rast", {kAny, kAny, kAny, 4});
  return {RowsOf<T>(attr, function, "attr", call.rast.shape(0)),
          FacesOf(call.tri, function),
          GridOf(call.rast),
          rast,
          ImageOf<T>(call.rast_db, function, "rast_db", call.rast, 4),
          SpanOf<std::int32_t>(call.diff_attrs, function, "diff_attrs", {kAny})};
}

py::tuple Interpolate(const py::array& attr, const InterpolateCall& call) {
  constexpr char kName[] = "interpolate";
  return Dispatch(attr, kName, "attr", [&]<class T>(T) {
    const auto input = InterpolateInputOf<T>(attr, call, kName);
    const auto channels = static_cast<py::ssize_t>(input.attributes.channels);
    std::vector<py::ssize_t> shape = {call.rast.shape(0), call.rast.shape(1), call.rast.shape(2),
                                      channels};
    auto out = NewArray<T>(shape);
    shape[3] = 2 * call.diff_attrs.shape(0);
    auto out_da = NewArray<T>(shape);
    const nvdiffrast::InterpolateOutput<T> to{NumbersOf(out), NumbersOf(out_da)};
    Run(kName, call.threads,
        [&](const Workers& workers) { return nvdiffrast::Interpolate<T>(input, workers, to); });
    return py::make_tuple(out, out_da);
  });
}

// Which gradients to compute.
using Wanted = std::vector<bool>;

template <class T>
std::optional<py::array_t<T>> NewIf(bool wanted, const py::array& like) {
  return wanted ? std::optional(NewArrayLike<T>(like)) : std::nullopt;
}

py::tuple InterpolateBackward(const py::array& attr, const InterpolateCall& call,
                              const OptionalArray& d_out, const OptionalArray& d_out_da,
                              const Wanted& wanted) {
  constexpr char kName[] = "interpolate's backward pass";
  return Dispatch(attr, kName, "attr", [&]<class T>(T) {
    const auto input = InterpolateInputOf<T>(attr, call, kName);
    const auto channels = static_cast<py::ssize_t>(input.attributes.channels);
    const nvdiffrast::InterpolateCotangents<T> cotangents{
        ImageOf<T>(d_out, kName, "the gradient", call.rast, channels),
        ImageOf<T>(d_out_da, kName, "the gradient of out_da", call.rast,
                   2 * call.diff_attrs.shape(0))};
    auto d_attr = NewIf<T>(wanted.at(0), attr), d_rast = NewIf<T>(wanted.at(1), call.rast);
    auto d_rast_db = NewIf<T>(wanted.at(2), call.rast);
    const nvdiffrast::InterpolateGradients<T> to{NumbersOf(d_attr), NumbersOf(d_rast),
                                                 NumbersOf(d_rast_db)};
    Run(kName, call.threads, [&](const Workers& workers) {
      return nvdiffrast::InterpolateBackward<T>(input, cotangents, workers, to);
    });
    return py::make_tuple(d_attr, d_rast, d_rast_db);
  });
}

struct AntialiasCall {
  const py::array &rast, &pos, &tri;
  const nvdiffrast::EdgeRings& rings;
};

template <class T>
nvdiffrast::AntialiasInput<T> AntialiasInputOf(const py::array& color, const AntialiasCall& call,
                                               const char* function) {
  const auto colors = SpanOf<T>(color, function, "color", {kAny, kAny, kAny, kAny});
  const auto positions = RowsOf<T>(call.pos, function, "pos", color.shape(0));
  if (positions.channels != 4) throw py::value_error("antialias: pos must be [N, V, 4] or [V, 4]");
  return {positions,
          FacesOf(call.tri, function),
          &call.rings,
          GridOf(color),
          ImageOf<T>(call.rast, function, "rast", color, 4),
          colors,
          Extent(color, 3)};
}

py::array Antialias(const py::array& color, const py::array& rast, const py::array& pos,
                    const py::array& tri, const nvdiffrast::EdgeRings& rings, int threads) {
  constexpr char kName[] = "antialias";
  return Dispatch(color, kName, "color", [&]<class T>(T) -> py::array {
    const auto input = AntialiasInputOf<T>(color, {rast, pos, tri, rings}, kName);
    auto out = NewArrayLike<T>(color);
    const auto to = NumbersOf(out);
    Run(kName, threads,
        [&](const Workers& workers) { return nvdiffrast::Antialias<T>(input, workers, to); });
    return out;
  });
}

py::tuple AntialiasBackward(const py::array& color, const py::array& rast, const py::array& pos,
                            const py::array& tri, const nvdiffrast::EdgeRings& rings,
                            const py::array& gradient, const Wanted& wanted, int threads) {
  constexpr char kName[] = "antialias's backward pass";
  return Dispatch(color, kName, "color", [&]<class T>(T) {
    const auto input = AntialiasInputOf<T>(color, {rast, pos, tri, rings}, kName);
    const auto d_out = ImageOf<T>(gradient, kName, "the gradient", color, color.shape(3));
    auto d_color = NewIf<T>(wanted.at(0), color), d_pos = NewIf<T>(wanted.at(1), pos);
    const nvdiffrast::AntialiasGradients<T> to{NumbersOf(d_color), NumbersOf(d_pos)};
    Run(kName, threads, [&](const Workers& workers) {
      return nvdiffrast::AntialiasBackward<T>(input, d_out, workers, to);
    });
    return py::make_tuple(d_color, d_pos);
  });
}

void BindNvdiffrastRasterize(py::module_& m) {
  py::class_<NvdiffrastRasterizer>(m, "NvdiffrastRasterizer",
                                   "Scratch memory that rasterization reuses. Threads may share "
                                   "one; a thread that finds it in\nuse allocates its own.")
      .def(py::init<>())
      .def("rasterize", &NvdiffrastRasterizer::Rasterize,
           "(rast, rast_db), each [N, height, width, 4]. pos [N, V, 4], or [V, 4] with ranges\n[N, "
           "2]; tri [F, 3]; peeled [N, height, width] float32: only surfaces behind this "
           "depth\nare drawn, and the depth is updated; start with infinity.");
  m.def("nvdiffrast_rasterize_backward", &RasterizeBackward,
        "The gradient of pos from those of rast and rast_db, either of them None.");
}

void BindInterpolate(py::module_& m) {
  py::class_<InterpolateCall>(
      m, "InterpolateCall",
      "Interpolates attributes: tri [F, 3], rast and rast_db [N, H, W, 4], diff_attrs [D].")
      .def(py::init([](py::array tri, py::array rast, OptionalArray rast_db, py::array diff_attrs,
                       int threads) {
             return InterpolateCall{std::move(tri), std::move(rast), std::move(rast_db),
                                    std::move(diff_attrs), threads};
           }),
           py::kw_only(), py::arg("tri"), py::arg("rast"), py::arg("rast_db"),
           py::arg("diff_attrs"), py::arg("threads"));
  m.def("nvdiffrast_interpolate", &Interpolate,
        "([N, H, W, A], [N, H, W, 2 D]) of attr [N, V, A] or [V, A].");
  m.def("nvdiffrast_interpolate_backward", &InterpolateBackward,
        "The gradients of attr, rast and rast_db, None if not requested.");
}

void BindAntialias(py::module_& m) {
  py::class_<nvdiffrast::EdgeRings, std::shared_ptr<nvdiffrast::EdgeRings>>(
      m, "EdgeRings", "Which triangles of tri [F, 3] share an edge.")
      .def(py::init([](const py::array& tri) {
        return std::make_shared<nvdiffrast::EdgeRings>(
            nvdiffrast::BuildEdgeRings(FacesOf(tri, "antialias_construct_topology_hash")));
      }));
  m.def("nvdiffrast_antialias", &Antialias, "color [N, H, W, C] with smooth silhouettes.");
  m.def("nvdiffrast_antialias_backward", &AntialiasBackward,
        "The gradients of color and pos, None if not requested.");
}

}  // namespace

void BindNvdiffrast(py::module_& m) {
  BindNvdiffrastRasterize(m);
  BindInterpolate(m);
  BindAntialias(m);
  BindNvdiffrastTexture(m);
}

}  // namespace tilegrad::python
