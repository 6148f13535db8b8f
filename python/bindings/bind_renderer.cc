// SPDX-License-Identifier: Apache-2.0
// Scenes, frames and the renderer of include/tilegrad, as tilegrad/_scene.py and _renderer.py use
// them.
#include <pybind11/stl.h>

#include <string>
#include <string_view>
#include <utility>

#include "bindings/renderer_object.h"

namespace tilegrad::python {
namespace {

// The numbers and shape of an image, by its name; the only place that knows the shape.
template <class T>
struct NamedImage {
  std::span<const T> values;
  std::vector<py::ssize_t> shape;  // [N,C,H,W], or [N,H,W] of images of one number
};

template <class T>
NamedImage<T> ImageNamed(std::string_view name, const FrameObject<T>& frame) {
  const ImagesT<T>& images = frame.images();
  NamedImage<T> out;
  ForEachOutput(
      frame.scenes().empty() ? 0 : frame.scenes()[0]->channels(),
      [&](const char* known, int planes, std::span<const T> values) {
        if (name != known) return;
        out = {values, {images.count, images.height, images.width}};
        const bool one = name == "alpha" || name == "depth";
        if (!one) out.shape.insert(out.shape.begin() + 1, planes);
      },
      images);
  if (out.shape.empty()) throw py::value_error(fmt::format("unknown image {}", name));
  return out;
}

std::vector<const char*> ImageNames() {
  std::vector<const char*> out;
  const Outputs outputs;
  ForEachOutput(
      0, [&](const char* name, int, bool) { out.push_back(name); }, outputs);
  return out;
}

// Which of ImageNames are requested.
Outputs OutputsOf(const std::vector<bool>& wanted) {
  Outputs out;
  std::size_t i = 0;
  ForEachOutput(
      0, [&](const char*, int, bool& image) { image = i < wanted.size() && wanted[i++]; }, out);
  return out;
}

// The image of a frame as a view that keeps it alive.
template <class T>
py::array View(const py::object& self, std::string_view name, bool writeable) {
  const NamedImage<T> image = ImageNamed(name, py::cast<const FrameObject<T>&>(self));
  return ViewOf<T>(image.values, image.shape, self, writeable);
}

template <class T>
py::array FaceIds(const py::object& self) {
  const auto& images = py::cast<const FrameObject<T>&>(self).images();
  return ViewOf<std::int32_t>(images.face_ids, {images.count, images.height, images.width}, self);
}

template <class T>
FrameGradientsT<T> CotangentsOf(const FrameObject<T>& frame, const py::dict& arrays) {
  FrameGradientsT<T> out;
  for (const std::pair<py::handle, py::handle> entry : arrays) {
    const std::string name = py::str(entry.first);
    const NamedImage<T> image = ImageNamed(name, frame);
    if (name == "barycentrics") throw py::value_error("backward: barycentrics have no gradient");
    ForEachImage(
        0,
        [&](const char* known, int, std::span<const T>& to) {
          if (name != known) return;
          to = SpanOf<T>(py::reinterpret_borrow<py::object>(entry.second), "backward", known,
                         image.shape);
        },
        out);
  }
  return out;
}

template <class T>
void BindNumbers(py::module_& m, py::class_<RendererObject>& renderer, const std::string& suffix) {
  using Scene = SceneRecord<T>;
  using Frame = FrameObject<T>;
  py::class_<Scene, std::shared_ptr<Scene>>(m, ("Scene" + suffix).c_str(),
                                            "The images of one tilegrad.Scene.")
      .def(py::init<std::size_t, SceneArrays>(),
           "count: images; arrays: checked by tilegrad._scene.")
      .def_property_readonly("count", &Scene::count, "How many images.");
  const auto number = [](auto member) {
    return [member](const Frame& f) { return f.images().*member; };
  };
  py::class_<Frame>(m, ("Frame" + suffix).c_str(), "A rendered frame.")
      .def_property_readonly("count", number(&ImagesT<T>::count), "N, images.")
      .def_property_readonly("height", number(&ImagesT<T>::height), "Pixels.")
      .def_property_readonly("width", number(&ImagesT<T>::width), "Pixels.")
      .def_property_readonly("alpha_error_bound", number(&ImagesT<T>::alpha_error_bound),
                             "No alpha is farther than this from equation 6.")
      .def_property_readonly("face_ids", &FaceIds<T>, "(N, H, W) int32, -1: background.")
      .def("view", &View<T>, py::arg("name"), py::arg("writeable") = false,
           "The image of that name; keeps the frame alive.");
  renderer
      .def(
          "render",
          [](RendererObject& r, std::vector<std::shared_ptr<Scene>> scenes,
             const RenderOptions& options, const std::vector<bool>& outputs) {
            return r.Render(std::move(scenes), options, OutputsOf(outputs));
          },
          "The frame of a list of scenes; outputs: a flag for each of IMAGES.")
      .def(
          "backward",
          [](RendererObject& r, const Frame& frame, const py::dict& cotangents,
             const std::vector<py::dict>& gradients, bool add) {
            r.Backward(frame, CotangentsOf(frame, cotangents), gradients,
                       add ? GradientMode::kAdd : GradientMode::kOverwrite);
          },
          "Fills the arrays of gradients, a dictionary by name for each scene.");
}

void BindSceneArrays(py::module_& m) {
  py::class_<SceneArrays>(m, "SceneArrays", "The arrays of a scene; None if absent.")
      .def(py::init<>())
      .def_readwrite("fields", &SceneArrays::fields, "Arrays, by name.")
      .def_readwrite("per_corner", &SceneArrays::per_corner, "Names of the per-corner arrays.")
      .def_readwrite("textures", &SceneArrays::textures, "Each ([N,] Ht, Wt, 3)")
      .def_readwrite("wraps", &SceneArrays::wraps, "Of textures: indices into WRAPS.")
      .def_readwrite("filters", &SceneArrays::filters, "Of textures: indices into FILTERS.")
      .def_readwrite("surface_textures", &SceneArrays::surface_textures, "S indices, -1: none.")
      .def_readwrite("shading", &SceneArrays::shading,
                     "Indices into LIGHTINGS and NORMAL_KINDS, two-sided, clamped.");
}

void BindOptions(py::module_& m) {
  using Options = RenderOptions;
  // Enumerations by number: tilegrad._renderer has their names.
  const auto number = [](auto member) {
    return std::pair([member](const Options& o) { return static_cast<int>(o.*member); },
                     [member](Options& o, int value) {
                       using Enum = std::decay_t<decltype(o.*member)>;
                       o.*member = static_cast<Enum>(value);
                     });
  };
  const auto interpolation = number(&Options::interpolation);
  const auto culling = number(&Options::culling);
  const auto alpha_rule = number(&Options::alpha_rule);
  py::class_<Options>(m, "RenderOptions", "Options of a render, with their defaults.")
      .def(py::init<>())
      .def_readwrite("width", &Options::width, "Pixels, 1..16384.")
      .def_readwrite("height", &Options::height, "Pixels, 1..16384.")
      .def_readwrite("delta", &Options::delta, "NDC squared, > 0.")
      .def_readwrite("max_alpha_error", &Options::max_alpha_error, "Absolute, [0, 1].")
      .def_property("interpolation", interpolation.first, interpolation.second,
                    "Index into INTERPOLATIONS.")
      .def_property("culling", culling.first, culling.second, "Index into CULLINGS.")
      .def_property("alpha_rule", alpha_rule.first, alpha_rule.second, "Index into ALPHA_RULES.")
      .def_readwrite("paper_box", &Options::paper_box, "NDC, >= 0.")
      .def_readwrite("paper_faces", &Options::paper_faces, ">= 0.");
}

void BindNames(py::module_& m) {
  // In the order of the enumerations.
  m.attr("INTERPOLATIONS") = py::make_tuple("perspective", "screen_linear");
  m.attr("CULLINGS") = py::make_tuple("none", "back");
  m.attr("ALPHA_RULES") = py::make_tuple("all_faces", "paper");
  m.attr("WRAPS") =
      py::make_tuple("repeat", "clamp", "mirror", "repeat clamp", "clamp mirror", "mirror repeat",
                     "repeat mirror", "clamp repeat", "mirror clamp");
  m.attr("FILTERS") = py::make_tuple("nearest", "bilinear", "trilinear");
  m.attr("LIGHTINGS") = py::make_tuple("none", "lambert", "phong", "spherical_harmonics");
  m.attr("NORMAL_KINDS") = py::make_tuple("smooth", "flat", "given");
  m.attr("IMAGES") = py::tuple(py::cast(ImageNames()));
}

// Defaults of records that are plain numbers in Python.
void BindDefaults(py::module_& m) {
  std::vector<double> camera(kCameraNumbers), surface(kSurfaceNumbers), light(kLightNumbers);
  PutCamera<double>({}, camera);
  PutSurface<double>({}, surface);
  PutLight<double>({}, light);
  m.attr("CAMERA") = py::cast(camera);
  m.attr("SURFACE") = py::cast(surface);
  m.attr("LIGHT") = py::cast(light);
  const TextureT<double> texture;
  m.attr("TEXTURE") =
      py::make_tuple(static_cast<int>(texture.wrap), static_cast<int>(texture.filter));
  const Lens lens;
  m.attr("FOV_Y") = lens.fov_y;
}

}  // namespace

void BindRenderer(py::module_& m) {
  BindNames(m);
  BindDefaults(m);
  BindOptions(m);
  BindSceneArrays(m);
  py::class_<RendererObject> renderer(m, "Renderer", "Threads and scratch memory.");
  renderer.def(py::init<int>(), "threads: as of tilegrad.Renderer, checked there.")
      .def_property_readonly("threads", &RendererObject::threads, "As given; 0: one a core.");
  BindNumbers<float>(m, renderer, "32");
  BindNumbers<double>(m, renderer, "64");
}

}  // namespace tilegrad::python
