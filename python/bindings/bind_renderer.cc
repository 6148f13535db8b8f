// SPDX-License-Identifier: Apache-2.0
// Scenes, frames and the renderer of include/tilegrad, as tilegrad/_scene.py and _renderer.py use
// them.
#include <pybind11/stl.h>

#include <string>
#include <string_view>
#include <utility>

#include "bindings/renderer_object.h"

namespace tilegrad::python {

void BindRenderer(py::module_& m);

namespace {

// The images of a frame.
enum Image { kColor, kAlpha, kAttributes, kDepth, kNormals, kUv, kBarycentrics, kImages };
constexpr const char* kImageNames[kImages] = {"color",   "alpha", "attributes",  "depth",
                                              "normals", "uv",    "barycentrics"};
using Wanted = std::array<bool, kImages>;

v0::Outputs OutputsOf(const Wanted& w) {
  return {w[kColor], w[kAlpha], w[kAttributes], w[kDepth], w[kNormals], w[kUv], w[kBarycentrics]};
}

template <class T>
std::span<const T> ImageOf(const v0::ImagesT<T>& images, int image) {
  const std::span<const T> all[kImages] = {images.color,       images.alpha,   images.attributes,
                                           images.depth,       images.normals, images.uv,
                                           images.barycentrics};
  return all[image];
}

// [N,C,H,W], or [N,H,W] of images of one number.
template <class T>
std::vector<py::ssize_t> ShapeOf(const v0::ImagesT<T>& images, int image) {
  const int channels[kImages] = {3, 0, images.channels, 0, 3, 2, 2};
  std::vector<py::ssize_t> shape = {images.count, images.height, images.width};
  if (image != kAlpha && image != kDepth) shape.insert(shape.begin() + 1, channels[image]);
  return shape;
}

int ImageNamed(std::string_view name) {
  for (int i = 0; i < kImages; ++i) {
    if (name == kImageNames[i]) return i;
  }
  throw py::value_error(fmt::format("no image is called {}", name));
}

// The image of a frame as a view that keeps it alive.
template <class T>
py::array View(const py::object& self, std::string_view name, bool writeable) {
  const auto& images = py::cast<const FrameObject<T>&>(self).images();
  const int image = ImageNamed(name);
  return ViewOf<T>(ImageOf(images, image), ShapeOf(images, image), self, writeable);
}

template <class T>
py::array FaceIds(const py::object& self) {
  const auto& images = py::cast<const FrameObject<T>&>(self).images();
  return ViewOf<std::int32_t>(images.face_ids, {images.count, images.height, images.width}, self);
}

template <class T>
v0::FrameGradientsT<T> CotangentsOf(const FrameObject<T>& frame, const py::dict& arrays) {
  v0::FrameGradientsT<T> out;
  std::span<const T>* const to[kImages] = {&out.color,   &out.alpha, &out.attributes, &out.depth,
                                           &out.normals, &out.uv,    nullptr};
  for (const std::pair<py::handle, py::handle> entry : arrays) {
    const std::string name = py::str(entry.first);
    const int image = ImageNamed(name);
    if (to[image] == nullptr) throw py::value_error("backward: barycentrics have no gradient");
    *to[image] = SpanOf<T>(py::reinterpret_borrow<py::object>(entry.second), "backward",
                           name.c_str(), ShapeOf(frame.images(), image));
  }
  return out;
}

template <class T>
void BindNumbers(py::module_& m, py::class_<RendererObject>& renderer, const std::string& suffix) {
  using Scene = SceneRecord<T>;
  using Frame = FrameObject<T>;
  py::class_<Scene, std::shared_ptr<Scene>>(m, ("Scene" + suffix).c_str(),
                                            "The images of one tilegrad.Scene.")
      .def(py::init<std::size_t, SceneArrays>(), py::arg("count"), py::arg("arrays"),
           "count: images; arrays: checked by tilegrad._scene.")
      .def_property_readonly("count", &Scene::count, "How many images.");
  const auto number = [](auto member) {
    return [member](const Frame& f) { return f.images().*member; };
  };
  py::class_<Frame>(m, ("Frame" + suffix).c_str(), "The record of a render.")
      .def_property_readonly("count", number(&v0::ImagesT<T>::count), "N, images.")
      .def_property_readonly("height", number(&v0::ImagesT<T>::height), "Pixels.")
      .def_property_readonly("width", number(&v0::ImagesT<T>::width), "Pixels.")
      .def_property_readonly("alpha_error_bound", number(&v0::ImagesT<T>::alpha_error_bound),
                             "No alpha is farther than this from equation 6.")
      .def_property_readonly("face_ids", &FaceIds<T>, "(N, H, W) int32, -1: background.")
      .def("view", &View<T>, py::arg("name"), py::arg("writeable") = false,
           "The image of that name; keeps the frame alive.");
  renderer
      .def(
          "render",
          [](RendererObject& r, std::vector<std::shared_ptr<Scene>> scenes,
             const v0::RenderOptions& options, const Wanted& outputs) {
            return r.Render(std::move(scenes), options, OutputsOf(outputs));
          },
          py::arg("scenes"), py::arg("options"), py::arg("outputs"),
          "The frame of a list of scenes; outputs: whether each of IMAGES is wanted.")
      .def(
          "backward",
          [](RendererObject& r, const Frame& frame, const py::dict& cotangents,
             const std::vector<py::dict>& gradients, bool add) {
            r.Backward(frame, CotangentsOf(frame, cotangents), gradients,
                       add ? v0::GradientMode::kAdd : v0::GradientMode::kOverwrite);
          },
          py::arg("frame"), py::arg("cotangents"), py::arg("gradients"), py::arg("add") = false,
          "Fills the arrays of gradients, a dictionary by name for each scene.");
}

void BindSceneArrays(py::module_& m) {
  py::class_<SceneArrays>(m, "SceneArrays", "What a scene is made of; None: not there.")
      .def(py::init<>())
      .def_readwrite("positions", &SceneArrays::positions, "([N,] V, 3)")
      .def_readwrite("faces", &SceneArrays::faces, "(F, 3) int32")
      .def_readwrite("camera", &SceneArrays::camera, "([N,] 17)")
      .def_readwrite("colors", &SceneArrays::colors, "([N,] V, 3), or corners: ([N,] F, 3, 3)")
      .def_readwrite("uvs", &SceneArrays::uvs, "([N,] V, 2), or corners: ([N,] F, 3, 2)")
      .def_readwrite("normals", &SceneArrays::normals, "([N,] V, 3), or corners: ([N,] F, 3, 3)")
      .def_readwrite("attributes", &SceneArrays::attributes,
                     "([N,] V, C), or corners: ([N,] F, 3, C)")
      .def_readwrite("per_corner", &SceneArrays::per_corner, "Of the four above, in that order.")
      .def_readwrite("textures", &SceneArrays::textures, "Each ([N,] Ht, Wt, 3)")
      .def_readwrite("wraps", &SceneArrays::wraps, "Of textures: indices into WRAPS.")
      .def_readwrite("filters", &SceneArrays::filters, "Of textures: indices into FILTERS.")
      .def_readwrite("surfaces", &SceneArrays::surfaces, "(S, 13)")
      .def_readwrite("surface_textures", &SceneArrays::surface_textures, "S indices, -1: none.")
      .def_readwrite("face_surfaces", &SceneArrays::face_surfaces, "(F,) int32")
      .def_readwrite("lights", &SceneArrays::lights, "([N,] L, 4)")
      .def_readwrite("light_directions", &SceneArrays::light_directions, "([N,] V, 3)")
      .def_readwrite("sh", &SceneArrays::sh, "([N,] 9)")
      .def_readwrite("lighting", &SceneArrays::lighting, "Index into LIGHTINGS.")
      .def_readwrite("normal_kind", &SceneArrays::normal_kind, "Index into NORMAL_KINDS.")
      .def_readwrite("two_sided", &SceneArrays::two_sided, "Turn normals to the eye.")
      .def_readwrite("clamp", &SceneArrays::clamp, "Colours to [0, 1].");
}

void BindOptions(py::module_& m) {
  using Options = v0::RenderOptions;
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
  m.attr("WRAPS") = py::make_tuple("repeat", "clamp", "mirror");
  m.attr("FILTERS") = py::make_tuple("nearest", "bilinear", "trilinear");
  m.attr("LIGHTINGS") = py::make_tuple("none", "lambert", "phong", "spherical_harmonics");
  m.attr("NORMAL_KINDS") = py::make_tuple("smooth", "flat", "given");
  py::tuple images(static_cast<std::size_t>(kImages));
  for (std::size_t i = 0; i < kImages; ++i) images[i] = kImageNames[i];
  m.attr("IMAGES") = images;
}

// Defaults of records that are plain numbers in Python.
void BindDefaults(py::module_& m) {
  std::vector<double> camera(kCameraNumbers), surface(kSurfaceNumbers), light(kLightNumbers);
  PutCamera<double>({}, camera), PutSurface<double>({}, surface), PutLight<double>({}, light);
  m.attr("CAMERA") = py::cast(camera);
  m.attr("SURFACE") = py::cast(surface);
  m.attr("LIGHT") = py::cast(light);
  const v0::TextureT<double> texture;
  m.attr("TEXTURE") =
      py::make_tuple(static_cast<int>(texture.wrap), static_cast<int>(texture.filter));
  const v0::Lens lens;
  m.attr("FOV_Y") = lens.fov_y;
}

}  // namespace

void BindRenderer(py::module_& m) {
  BindNames(m), BindDefaults(m), BindOptions(m), BindSceneArrays(m);
  py::class_<RendererObject> renderer(m, "Renderer", "Threads and scratch memory.");
  renderer
      .def(py::init<int>(), py::arg("threads"), "threads: as of tilegrad.Renderer, checked there.")
      .def_property_readonly("threads", &RendererObject::threads, "As given; 0: one a core.");
  BindNumbers<float>(m, renderer, "32");
  BindNumbers<double>(m, renderer, "64");
}

}  // namespace tilegrad::python
