// SPDX-License-Identifier: Apache-2.0
// What tilegrad.compat.nvdiffrast needs of the engine: the geometry's part;
// bind_nvdiffrast_texture.cc has the rest.
#include <pybind11/stl.h>

#include <memory>
#include <mutex>
#include <utility>

#include "bindings/calls.h"
#include "bindings/shared_workers.h"
#include "compat/nvdiffrast/antialias.h"
#include "compat/nvdiffrast/interpolate.h"
#include "compat/nvdiffrast/rasterize.h"

namespace tilegrad::python {

void BindNvdiffrast(py::module_& m);
void BindNvdiffrastTexture(py::module_& m);

namespace {

namespace nvdiffrast = compat::nvdiffrast;

using nvdiffrast::PixelGrid;
using nvdiffrast::VertexRows;
using OptionalArray = std::optional<py::array>;

std::size_t Length(const py::array& array, int axis) {
  return axis < array.ndim() ? static_cast<std::size_t>(array.shape(axis)) : 0;
}

// [N,V,C], or [V,C] for all images.
template <class T>
VertexRows<T> RowsOf(const py::array& array, const char* function, const char* argument,
                     py::ssize_t images) {
  const bool shared = array.ndim() == 2;
  const auto values = shared ? SpanOf<T>(array, function, argument, {kAny, kAny})
                             : SpanOf<T>(array, function, argument, {images, kAny, kAny});
  return {values, Length(array, shared ? 0 : 1), Length(array, shared ? 1 : 2), shared};
}

PixelGrid GridOf(const py::array& image) {
  return {Length(image, 0), static_cast<int>(Length(image, 1)), static_cast<int>(Length(image, 2))};
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

// The engine's rasterizer for any thread: who finds it at work takes one of his own.
class NvdiffrastRasterizer {
 public:
  struct Call {
    py::array tri;
    OptionalArray ranges;
    int height, width;
    OptionalArray peeled;
    int threads;
  };

  template <class T>
  py::tuple Rasterize(const py::array& pos, const Call& call) {
    constexpr char kName[] = "rasterize";
    const py::ssize_t n = call.ranges ? call.ranges->shape(0) : pos.shape(0);
    nvdiffrast::RasterizeInput<T> input{
        RowsOf<T>(pos, kName, "pos", n),
        FacesOf(call.tri, kName),
        OptionalSpanOf<std::int32_t>(call.ranges, kName, "ranges", {n, 2}),
        {static_cast<std::size_t>(n), call.height, call.width}};
    if (input.positions.channels != 4 || input.positions.shared != call.ranges.has_value()) {
      throw py::value_error("rasterize: pos must be [N, V, 4], or [V, 4] with ranges");
    }
    auto rast = NewArray<T>({n, call.height, call.width, 4});
    auto rast_db = NewArray<T>({n, call.height, call.width, 4});
    nvdiffrast::RasterizeOutput<T> out{NumbersOf(rast), NumbersOf(rast_db), {}};
    if (call.peeled) {
      out.peeled =
          MutableSpanOf<float>(*call.peeled, kName, "peeled", {n, call.height, call.width});
    }
    const Workers& workers = SharedWorkers(call.threads);
    Run(kName, [&] {
      const std::unique_lock lock(mutex_, std::try_to_lock);
      nvdiffrast::Rasterizer own;
      return (lock.owns_lock() ? rasterizer_ : own).Run(input, workers, out);
    });
    return py::make_tuple(rast, rast_db);
  }

 private:
  std::mutex mutex_;
  nvdiffrast::Rasterizer rasterizer_;
};

struct RasterizeBackwardCall {
  py::array tri, rast;
  OptionalArray d_rast, d_rast_db;
  int threads;
};

template <class T>
py::array RasterizeBackward(const py::array& pos, const RasterizeBackwardCall& call) {
  constexpr char kName[] = "rasterize's backward pass";
  nvdiffrast::RasterizeInput<T> input{RowsOf<T>(pos, kName, "pos", call.rast.shape(0)),
                                      FacesOf(call.tri, kName),
                                      {},
                                      GridOf(call.rast)};
  const nvdiffrast::RasterizeCotangents<T> cotangents{
      SpanOf<T>(call.rast, kName, "rast", {kAny, kAny, kAny, 4}),
      ImageOf<T>(call.d_rast, kName, "the gradient of rast", call.rast, 4),
      ImageOf<T>(call.d_rast_db, kName, "the gradient of rast_db", call.rast, 4)};
  auto d_pos = NewArrayLike<T>(pos);
  const auto to = NumbersOf(d_pos);
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] { return nvdiffrast::RasterizeBackward<T>(input, cotangents, workers, to); });
  return d_pos;
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

template <class T>
py::tuple Interpolate(const py::array& attr, const InterpolateCall& call) {
  constexpr char kName[] = "interpolate";
  const auto input = InterpolateInputOf<T>(attr, call, kName);
  const py::array& like = call.rast;
  const auto channels = static_cast<py::ssize_t>(input.attributes.channels);
  auto out = NewArray<T>({like.shape(0), like.shape(1), like.shape(2), channels});
  auto out_da =
      NewArray<T>({like.shape(0), like.shape(1), like.shape(2), 2 * call.diff_attrs.shape(0)});
  const nvdiffrast::InterpolateOutput<T> to{NumbersOf(out), NumbersOf(out_da)};
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] { return nvdiffrast::Interpolate<T>(input, workers, to); });
  return py::make_tuple(out, out_da);
}

// Which gradients to compute.
using Wanted = std::vector<bool>;

template <class T>
std::optional<py::array_t<T>> NewIf(bool wanted, const py::array& like) {
  return wanted ? std::optional(NewArrayLike<T>(like)) : std::nullopt;
}

template <class T>
py::tuple InterpolateBackward(const py::array& attr, const InterpolateCall& call,
                              const OptionalArray& d_out, const OptionalArray& d_out_da,
                              const Wanted& wanted) {
  constexpr char kName[] = "interpolate's backward pass";
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
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] { return nvdiffrast::InterpolateBackward<T>(input, cotangents, workers, to); });
  return py::make_tuple(d_attr, d_rast, d_rast_db);
}

struct AntialiasCall {
  py::array rast, pos, tri;
  const nvdiffrast::EdgeRings& rings;
  int threads;
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
          Length(color, 3)};
}

template <class T>
py::array Antialias(const py::array& color, const AntialiasCall& call) {
  constexpr char kName[] = "antialias";
  const auto input = AntialiasInputOf<T>(color, call, kName);
  auto out = NewArrayLike<T>(color);
  const auto to = NumbersOf(out);
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] { return nvdiffrast::Antialias<T>(input, workers, to); });
  return out;
}

template <class T>
py::tuple AntialiasBackward(const py::array& color, const AntialiasCall& call,
                            const py::array& gradient, const Wanted& wanted) {
  constexpr char kName[] = "antialias's backward pass";
  const auto input = AntialiasInputOf<T>(color, call, kName);
  const auto d_out = ImageOf<T>(gradient, kName, "the gradient", color, color.shape(3));
  auto d_color = NewIf<T>(wanted.at(0), color), d_pos = NewIf<T>(wanted.at(1), call.pos);
  const nvdiffrast::AntialiasGradients<T> to{NumbersOf(d_color), NumbersOf(d_pos)};
  const Workers& workers = SharedWorkers(call.threads);
  Run(kName, [&] { return nvdiffrast::AntialiasBackward<T>(input, d_out, workers, to); });
  return py::make_tuple(d_color, d_pos);
}

void BindNvdiffrastRasterize(py::module_& m) {
  py::class_<NvdiffrastRasterizer>(
      m, "NvdiffrastRasterizer",
      "Memory that rasterizing reuses. Several threads may share one: whoever finds it at work\n"
      "takes memory of his own.")
      .def(py::init<>())
      .def(
          "rasterize",
          [](NvdiffrastRasterizer& self, const py::array& pos, py::array tri, OptionalArray ranges,
             int height, int width, OptionalArray peeled, int threads) {
            const NvdiffrastRasterizer::Call call{std::move(tri), std::move(ranges), height,
                                                  width,          std::move(peeled), threads};
            return Dispatch(pos, "rasterize", "pos",
                            [&](auto t) { return self.Rasterize<decltype(t)>(pos, call); });
          },
          py::arg("pos"), py::arg("tri"), py::arg("ranges"), py::arg("height"), py::arg("width"),
          py::arg("peeled"), py::arg("threads"),
          "(rast, rast_db), each [N, height, width, 4]. pos [N, V, 4], or [V, 4] with ranges\n"
          "[N, 2]; tri [F, 3]; peeled [N, height, width] float32: only what lies behind is seen,\n"
          "and it moves there; infinity at first.");
  m.def(
      "nvdiffrast_rasterize_backward",
      [](const py::array& pos, py::array tri, py::array rast, OptionalArray d_rast,
         OptionalArray d_rast_db, int threads) {
        const RasterizeBackwardCall call{std::move(tri), std::move(rast), std::move(d_rast),
                                         std::move(d_rast_db), threads};
        return Dispatch(pos, "rasterize's backward pass", "pos",
                        [&](auto t) { return RasterizeBackward<decltype(t)>(pos, call); });
      },
      py::arg("pos"), py::arg("tri"), py::arg("rast"), py::arg("d_rast"), py::arg("d_rast_db"),
      py::arg("threads"),
      "The gradient of pos from those of rast and rast_db, either of them None.");
}

void BindInterpolate(py::module_& m) {
  py::class_<InterpolateCall>(
      m, "InterpolateCall",
      "What interpolates attributes: tri [F, 3], rast and rast_db [N, H, W, 4], diff_attrs [D].")
      .def(py::init([](py::array tri, py::array rast, OptionalArray rast_db, py::array diff_attrs,
                       int threads) {
             return InterpolateCall{std::move(tri), std::move(rast), std::move(rast_db),
                                    std::move(diff_attrs), threads};
           }),
           py::kw_only(), py::arg("tri"), py::arg("rast"), py::arg("rast_db"),
           py::arg("diff_attrs"), py::arg("threads"));
  m.def(
      "nvdiffrast_interpolate",
      [](const py::array& attr, const InterpolateCall& call) {
        return Dispatch(attr, "interpolate", "attr",
                        [&](auto t) { return Interpolate<decltype(t)>(attr, call); });
      },
      py::arg("attr"), py::arg("call"),
      "([N, H, W, A], [N, H, W, 2 D]) of attr [N, V, A] or [V, A].");
  m.def(
      "nvdiffrast_interpolate_backward",
      [](const py::array& attr, const InterpolateCall& call, const OptionalArray& d_out,
         const OptionalArray& d_out_da, const Wanted& wanted) {
        return Dispatch(attr, "interpolate's backward pass", "attr", [&](auto t) {
          return InterpolateBackward<decltype(t)>(attr, call, d_out, d_out_da, wanted);
        });
      },
      py::arg("attr"), py::arg("call"), py::arg("d_out"), py::arg("d_out_da"), py::arg("wanted"),
      "The gradients of attr, rast and rast_db, None where not wanted.");
}

void BindAntialias(py::module_& m) {
  py::class_<nvdiffrast::EdgeRings, std::shared_ptr<nvdiffrast::EdgeRings>>(
      m, "EdgeRings", "Which triangles of tri [F, 3] share an edge.")
      .def(py::init([](const py::array& tri) {
             return std::make_shared<nvdiffrast::EdgeRings>(
                 nvdiffrast::BuildEdgeRings(FacesOf(tri, "antialias_construct_topology_hash")));
           }),
           py::arg("tri"));
  m.def(
      "nvdiffrast_antialias",
      [](const py::array& color, py::array rast, py::array pos, py::array tri,
         const nvdiffrast::EdgeRings& rings, int threads) {
        const AntialiasCall call{std::move(rast), std::move(pos), std::move(tri), rings, threads};
        return Dispatch(color, "antialias", "color",
                        [&](auto t) { return Antialias<decltype(t)>(color, call); });
      },
      py::arg("color"), py::arg("rast"), py::arg("pos"), py::arg("tri"), py::arg("rings"),
      py::arg("threads"), "color [N, H, W, C] with smooth silhouettes.");
  m.def(
      "nvdiffrast_antialias_backward",
      [](const py::array& color, py::array rast, py::array pos, py::array tri,
         const nvdiffrast::EdgeRings& rings, const py::array& gradient, const Wanted& wanted,
         int threads) {
        const AntialiasCall call{std::move(rast), std::move(pos), std::move(tri), rings, threads};
        return Dispatch(color, "antialias's backward pass", "color", [&](auto t) {
          return AntialiasBackward<decltype(t)>(color, call, gradient, wanted);
        });
      },
      py::arg("color"), py::arg("rast"), py::arg("pos"), py::arg("tri"), py::arg("rings"),
      py::arg("gradient"), py::arg("wanted"), py::arg("threads"),
      "The gradients of color and pos, None where not wanted.");
}

}  // namespace

void BindNvdiffrast(py::module_& m) {
  BindNvdiffrastRasterize(m);
  BindInterpolate(m);
  BindAntialias(m);
  BindNvdiffrastTexture(m);
}

}  // namespace tilegrad::python
