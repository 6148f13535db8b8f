// SPDX-License-Identifier: Apache-2.0
// Textures for tilegrad.compat.nvdiffrast.
#include <pybind11/stl.h>

#include <cstdint>
#include <limits>
#include <utility>

#include "bindings/calls.h"
#include "compat/nvdiffrast/texture.h"

namespace tilegrad::python {
namespace {

namespace nvdiffrast = compat::nvdiffrast;

using OptionalArray = std::optional<py::array>;
using Levels = std::vector<py::array>;

// [N,H,W,C], of a cube map [N,6,S,S,C]: lengths from the end.
nvdiffrast::MipSize SizeOf(const py::array& level) {
  if (level.ndim() < 4) throw py::value_error("texture: a level must have 4 or 5 axes");
  return {static_cast<int>(level.shape(level.ndim() - 3)),
          static_cast<int>(level.shape(level.ndim() - 2))};
}
constexpr py::ssize_t kMostTexels = std::numeric_limits<std::int32_t>::max();
py::ssize_t ChannelsOf(const py::array& level) { return level.shape(level.ndim() - 1); }

std::vector<py::ssize_t> LevelShape(const py::array& base, const nvdiffrast::MipSize& size) {
  std::vector<py::ssize_t> shape(base.shape(), base.shape() + base.ndim());
  shape[shape.size() - 3] = size.height;
  shape[shape.size() - 2] = size.width;
  return shape;
}

template <class T>
nvdiffrast::TextureLevel<T> LevelOf(const py::array& level, const char* function) {
  const nvdiffrast::MipSize size = SizeOf(level);
  const py::ssize_t channels = ChannelsOf(level);
  return {level.ndim() == 4
              ? SpanOf<T>(level, function, "tex", {kAny, size.height, size.width, channels})
              : SpanOf<T>(level, function, "tex", {kAny, 6, size.height, size.width, channels}),
          size};
}

struct TextureCall {
  py::array uv;
  OptionalArray uv_da, mip_level_bias;
  int filter, boundary;
  int threads;
};

// A call as the engine takes it.
template <class T>
struct TextureArguments {
  std::vector<nvdiffrast::TextureLevel<T>> levels;
  nvdiffrast::TextureInput<T> input;

  TextureArguments(const Levels& from, const TextureCall& call, const char* function) {
    if (from.empty()) throw py::value_error("texture: no levels");
    for (const py::array& level : from) levels.push_back(LevelOf<T>(level, function));
    input.levels = levels;
    input.textures = static_cast<std::size_t>(from[0].shape(0));
    input.channels = static_cast<std::size_t>(ChannelsOf(from[0]));
    input.filter = static_cast<nvdiffrast::TextureFilter>(call.filter);
    input.boundary = static_cast<nvdiffrast::TextureBoundary>(call.boundary);
    SetCoordinates(call, function);
    CheckLevels(from);
  }

 private:
  void SetCoordinates(const TextureCall& call, const char* function) {
    const auto n = static_cast<py::ssize_t>(input.coordinates());
    input.uv = SpanOf<T>(call.uv, function, "uv", {kAny, kAny, kAny, n});
    const py::ssize_t images = call.uv.shape(0), height = call.uv.shape(1),
                      width = call.uv.shape(2);
    input.grid = {static_cast<std::size_t>(images), static_cast<int>(height),
                  static_cast<int>(width)};
    input.uv_da = OptionalSpanOf<T>(call.uv_da, function, "uv_da", {images, height, width, 2 * n});
    input.mip_level_bias =
        OptionalSpanOf<T>(call.mip_level_bias, function, "mip_level_bias", {images, height, width});
  }
  // Each level follows from the one before, and textures fit the images.
  void CheckLevels(const Levels& from) const {
    const bool cube = input.boundary == nvdiffrast::TextureBoundary::kCube;
    bool fits = from[0].ndim() == (cube ? 5 : 4) && from[0].size() > 0 &&
                (input.textures == 1 || input.textures == input.grid.images);
    for (std::size_t l = 1; fits && l < from.size(); ++l) {
      const nvdiffrast::MipSize fine = levels[l - 1].size, size = levels[l].size;
      fits = (fine.height > 1 || fine.width > 1) && size.height == std::max(1, fine.height / 2) &&
             size.width == std::max(1, fine.width / 2) && from[l].ndim() == from[0].ndim() &&
             from[l].shape(0) == from[0].shape(0) && ChannelsOf(from[l]) == ChannelsOf(from[0]);
    }
    if (!fits) throw py::value_error("texture: the sizes of the levels do not match");
    if (from[0].size() / from[0].shape(0) / ChannelsOf(from[0]) > kMostTexels) {
      throw py::value_error("texture: tex has more than 2^31 - 1 texels");
    }
  }
};

py::array Sample(const Levels& levels, const TextureCall& call) {
  constexpr char kName[] = "texture";
  return Dispatch(call.uv, kName, "uv", [&]<class T>(T) -> py::array {
    const TextureArguments<T> arguments(levels, call, kName);
    auto out =
        NewArray<T>({call.uv.shape(0), call.uv.shape(1), call.uv.shape(2), ChannelsOf(levels[0])});
    const auto to = NumbersOf(out);
    Run(kName, call.threads, [&](const Workers& workers) {
      nvdiffrast::SampleTexture<T>(arguments.input, workers, to);
    });
    return out;
  });
}

// `wanted`: gradients of texels, uv, uv_da, mip_level_bias.
py::tuple SampleBackward(const Levels& levels, const TextureCall& call, const py::array& gradient,
                         const std::vector<bool>& wanted) {
  constexpr char kName[] = "texture's backward pass";
  return Dispatch(call.uv, kName, "uv", [&]<class T>(T) {
    const TextureArguments<T> arguments(levels, call, kName);
    const auto d_out =
        SpanOf<T>(gradient, kName, "the gradient",
                  {call.uv.shape(0), call.uv.shape(1), call.uv.shape(2), ChannelsOf(levels[0])});
    std::vector<py::array_t<T>> d_levels;
    std::vector<std::span<T>> spans;
    for (std::size_t l = 0; l < (wanted.at(0) ? levels.size() : 0); ++l) {
      d_levels.push_back(NewArrayLike<T>(levels[l]));
      spans.push_back(NumbersOf(d_levels.back()));
    }
    const auto new_if = [](bool want, const OptionalArray& like) {
      return want && like.has_value() ? std::optional(NewArrayLike<T>(*like)) : std::nullopt;
    };
    auto d_uv = new_if(wanted.at(1), call.uv), d_uv_da = new_if(wanted.at(2), call.uv_da);
    auto d_bias = new_if(wanted.at(3), call.mip_level_bias);
    const nvdiffrast::TextureGradients<T> to{spans, NumbersOf(d_uv), NumbersOf(d_uv_da),
                                             NumbersOf(d_bias)};
    Run(kName, call.threads, [&](const Workers& workers) {
      nvdiffrast::SampleTextureBackward<T>(arguments.input, d_out, workers, to);
    });
    return py::make_tuple(d_levels, d_uv, d_uv_da, d_bias);
  });
}

// The levels below `tex`.
Levels ConstructMip(const py::array& tex, int most, int threads) {
  constexpr char kName[] = "texture_construct_mip";
  return Dispatch(tex, kName, "tex", [&]<class T>(T) -> Levels {
    const auto sizes = ValueOrThrow(nvdiffrast::MipSizes(SizeOf(tex), most));
    const auto channels = static_cast<std::size_t>(ChannelsOf(tex));
    Levels out;
    for (std::size_t l = 1; l < sizes.size(); ++l) {
      const auto fine = LevelOf<T>(l == 1 ? tex : out.back(), kName);
      py::array_t<T> coarse = NewArray<T>(LevelShape(tex, sizes[l]));
      const auto to = NumbersOf(coarse);
      Run(kName, threads, [&](const Workers& workers) {
        nvdiffrast::HalveTexture<T>(fine, channels, workers, to);
      });
      out.push_back(std::move(coarse));
    }
    return out;
  });
}

// From the gradients of all levels, the texture's first, to that of the texture. Overwrites them.
py::array MipBackward(const Levels& d_levels, int threads) {
  constexpr char kName[] = "texture's backward pass";
  return Dispatch(d_levels.at(0), kName, "the gradient", [&]<class T>(T) -> py::array {
    const auto channels = static_cast<std::size_t>(ChannelsOf(d_levels.at(0)));
    for (std::size_t l = d_levels.size() - 1; l > 0; --l) {
      const auto coarse = LevelOf<T>(d_levels[l], kName);
      py::array_t<T> fine = py::cast<py::array_t<T>>(d_levels[l - 1]);
      const nvdiffrast::MipSize size = SizeOf(fine);
      const auto to = NumbersOf(fine);
      Run(kName, threads, [&](const Workers& workers) {
        nvdiffrast::HalveTextureBackward<T>(coarse, size, channels, workers, to);
      });
    }
    return d_levels[0];
  });
}

}  // namespace

void BindNvdiffrastTexture(py::module_& m) {
  m.attr("TEXTURE_FILTERS") =
      py::make_tuple("nearest", "linear", "linear-mipmap-nearest", "linear-mipmap-linear");
  m.attr("TEXTURE_BOUNDARIES") = py::make_tuple("wrap", "clamp", "zero", "cube");
  py::class_<TextureCall>(
      m, "TextureCall",
      "Lookups: uv [N, H, W, 2 or 3], uv_da twice as long, mip_level_bias [N, H, W]; filter and\n"
      "boundary as numbers in TEXTURE_FILTERS and TEXTURE_BOUNDARIES.")
      .def(py::init([](py::array uv, OptionalArray uv_da, OptionalArray mip_level_bias, int filter,
                       int boundary, int threads) {
             return TextureCall{std::move(uv), std::move(uv_da), std::move(mip_level_bias),
                                filter,        boundary,         threads};
           }),
           py::kw_only(), py::arg("uv"), py::arg("uv_da"), py::arg("mip_level_bias"),
           py::arg("filter"), py::arg("boundary"), py::arg("threads"));
  m.def("nvdiffrast_texture", &Sample,
        "[N, H, W, C] of the levels of a texture, each [N or 1, h, w, C] or [N or 1, 6, s, s, C].");
  m.def("nvdiffrast_texture_backward", &SampleBackward,
        "The gradients of the levels (a list, empty if not requested), uv, uv_da and "
        "mip_level_bias.");
  m.def("nvdiffrast_mip", &ConstructMip,
        "The levels below tex, at most `most` of them, or all if that is negative.");
  m.def("nvdiffrast_mip_backward", &MipBackward,
        "The gradient of a texture from those of all its levels, which are overwritten.");
}

}  // namespace tilegrad::python
