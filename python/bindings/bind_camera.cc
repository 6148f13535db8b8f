// SPDX-License-Identifier: Apache-2.0
// Cameras of other programs, from and to arrays of the numbers that tilegrad/_camera.py packs. Row
// i of each argument belongs to camera i.
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "bindings/camera_numbers.h"
#include "bindings/scene_record.h"
#include "scene/camera_conventions.h"

namespace tilegrad::python {

void BindCamera(py::module_& m);

namespace {

// [count, K] doubles.
template <std::size_t K>
class Rows {
 public:
  Rows(const char* function, const char* name, const py::object& array)
      : all_(SpanOf<double>(array, function, name, {kAny, static_cast<py::ssize_t>(K)})) {}
  std::size_t count() const { return all_.size() / K; }
  std::array<double, K> operator[](std::size_t i) const {
    std::array<double, K> out;
    std::copy_n(all_.begin() + static_cast<std::ptrdiff_t>(i * K), K, out.begin());
    return out;
  }

 private:
  std::span<const double> all_;
};

// [count, 17] of make(0), make(1), ..., Results.
template <class Make>
py::array MakeAll(const char* function, std::size_t count, const Make& make) {
  std::vector<double> out;
  for (std::size_t i = 0; i < count; ++i) {
    Result<Camera64> camera = make(i);
    ThrowIfError(camera.status().Within(function));
    ThrowIfError(Validate(*camera).Within(function));
    const auto numbers = NumbersOf(*camera);
    out.insert(out.end(), numbers.begin(), numbers.end());
  }
  return CopyOf<double>(out, {static_cast<py::ssize_t>(count), kCameraNumbers});
}

// The parts of cameras in another convention: read(camera) is a Result of a vector of numbers.
template <class Read>
py::array ReadAll(const char* function, const py::object& cameras, std::size_t width,
                  const Read& read) {
  const Rows<kCameraNumbers> rows(function, "cameras", cameras);
  std::vector<double> out;
  for (std::size_t i = 0; i < rows.count(); ++i) {
    const Result<std::vector<double>> numbers = read(CameraOfNumbers(rows[i]));
    ThrowIfError(numbers.status().Within(function));
    out.insert(out.end(), numbers->begin(), numbers->end());
  }
  return CopyOf<double>(out,
                        {static_cast<py::ssize_t>(rows.count()), static_cast<py::ssize_t>(width)});
}

// Numbers and arrays of numbers behind each other.
void Append(std::vector<double>* out, double x) { out->push_back(x); }
template <std::size_t K>
void Append(std::vector<double>* out, const std::array<double, K>& values) {
  out->insert(out->end(), values.begin(), values.end());
}
template <class... Parts>
std::vector<double> Joined(const Parts&... parts) {
  std::vector<double> out;
  (Append(&out, parts), ...);
  return out;
}

PixelCentre CentreOf(bool half) { return half ? PixelCentre::kHalf : PixelCentre::kInteger; }
using Size = std::pair<int, int>;  // width, height
ImageSize SizeOf(Size size) { return {size.first, size.second}; }

// `size`: of the image. The lens is checked with a camera of the public interface.
Lens LensOf(const char* function, double fov_y, Size size) {
  const Lens lens{fov_y, size.first, size.second};
  ThrowIfError(MakeCamera(lens, {}).status().Within(function));
  return lens;
}

py::array LookAt(double fov_y, Size size, const py::object& eyes, const py::object& targets,
                 const py::object& ups) {
  const char* function = "Camera.look_at";
  const Lens lens = LensOf(function, fov_y, size);
  const Rows<3> eye(function, "eye", eyes), target(function, "target", targets),
      up(function, "up", ups);
  return MakeAll(function, eye.count(), [&](std::size_t i) -> Result<Camera64> {
    if (eye[i] == target[i]) {
      return InvalidArgument("eye and target are the same point: there is no direction to look in");
    }
    return LookAtCamera(lens, eye[i].data(), target[i].data(), up[i].data());
  });
}

py::array Orbit(double fov_y, Size size, const py::object& orbits) {
  const char* function = "Camera.orbit";
  const Lens lens = LensOf(function, fov_y, size);
  const Rows<3> rows(function, "orbits", orbits);
  return MakeAll(function, rows.count(), [&](std::size_t i) -> Result<Camera64> {
    const auto [azimuth, elevation, distance] = rows[i];
    return MakeCamera<double>(lens, {azimuth, elevation, distance});
  });
}

py::array OpenCv(const py::object& ks, const py::object& rotations, const py::object& translations,
                 bool half) {
  const char* function = "Camera.from_opencv";
  const Rows<9> k(function, "k", ks), r(function, "rotation", rotations);
  const Rows<3> t(function, "translation", translations);
  return MakeAll(function, k.count(), [&](std::size_t i) {
    return FromOpenCv({k[i], r[i], t[i], CentreOf(half)});
  });
}

py::array Colmap(const py::object& quaternions, const py::object& translations,
                 const py::object& intrinsics) {
  const char* function = "Camera.from_colmap";
  const Rows<4> q(function, "quaternion", quaternions), f(function, "intrinsics", intrinsics);
  const Rows<3> t(function, "translation", translations);
  return MakeAll(function, q.count(), [&](std::size_t i) {
    return FromColmap({q[i], t[i], f[i][0], f[i][1], f[i][2], f[i][3]});
  });
}

py::array OpenGl(const py::object& projections, const py::object& model_views, Size size) {
  const char* function = "Camera.from_opengl";
  const Rows<16> p(function, "projection", projections), v(function, "model_view", model_views);
  return MakeAll(function, p.count(), [&](std::size_t i) {
    return FromOpenGl({p[i], v[i]}, SizeOf(size));
  });
}

py::array Kaolin(const py::object& rotations, const py::object& positions,
                 const py::object& projections, Size size) {
  const char* function = "Camera.from_kaolin";
  const Rows<9> r(function, "rotation", rotations);
  const Rows<3> p(function, "position", positions), f(function, "projection", projections);
  return MakeAll(function, r.count(), [&](std::size_t i) {
    return FromKaolin({r[i], p[i], f[i]}, SizeOf(size));
  });
}

py::array PyTorch3d(const py::object& rs, const py::object& ts, const py::object& focals,
                    const py::object& points, Size size) {
  const char* function = "Camera.from_pytorch3d";
  const Rows<9> r(function, "r", rs);
  const Rows<3> t(function, "t", ts);
  const Rows<2> f(function, "focal_length", focals), p(function, "principal_point", points);
  return MakeAll(function, r.count(), [&](std::size_t i) {
    return FromPyTorch3d({r[i], t[i], f[i], p[i]}, SizeOf(size));
  });
}

py::array Nerf(const py::object& matrices, const py::object& intrinsics) {
  const char* function = "Camera.from_nerf";
  const Rows<16> m(function, "camera_to_world", matrices);
  const Rows<4> f(function, "intrinsics", intrinsics);
  return MakeAll(function, m.count(), [&](std::size_t i) {
    return FromNerf({m[i], f[i][0], f[i][1], f[i][2], f[i][3]});
  });
}

py::array Resize(const py::object& cameras, Size from, Size to) {
  const Rows<kCameraNumbers> rows("Camera.resize", "cameras", cameras);
  return MakeAll("Camera.resize", rows.count(), [&](std::size_t i) -> Result<Camera64> {
    return ResizeCamera(CameraOfNumbers(rows[i]), SizeOf(from), SizeOf(to));
  });
}

using Numbers = Result<std::vector<double>>;

py::array ToOpenCvNumbers(const py::object& cameras, bool half) {
  return ReadAll("Camera.to_opencv", cameras, 21, [half](const Camera64& c) -> Numbers {
    const OpenCvCamera out = ToOpenCv(c, CentreOf(half));
    return Joined(out.k, out.rotation, out.translation);
  });
}

py::array ToColmapNumbers(const py::object& cameras) {
  return ReadAll("Camera.to_colmap", cameras, 11, [](const Camera64& c) -> Numbers {
    const ColmapCamera out = ToColmap(c);
    return Joined(out.quaternion, out.translation, out.fx, out.fy, out.cx, out.cy);
  });
}

py::array ToOpenGlNumbers(const py::object& cameras, Size size, double far_plane) {
  return ReadAll("Camera.to_opengl", cameras, 32, [&](const Camera64& c) -> Numbers {
    TILEGRAD_ASSIGN(const OpenGlCamera out, ToOpenGl(c, SizeOf(size), far_plane));
    return Joined(out.projection, out.model_view);
  });
}

py::array ToKaolinNumbers(const py::object& cameras, Size size) {
  return ReadAll("Camera.to_kaolin", cameras, 15, [&](const Camera64& c) -> Numbers {
    TILEGRAD_ASSIGN(const KaolinCamera out, ToKaolin(c, SizeOf(size)));
    return Joined(out.rotation, out.position, out.projection);
  });
}

py::array ToPyTorch3dNumbers(const py::object& cameras, Size size) {
  return ReadAll("Camera.to_pytorch3d", cameras, 16, [&](const Camera64& c) -> Numbers {
    TILEGRAD_ASSIGN(const PyTorch3dCamera out, ToPyTorch3d(c, SizeOf(size)));
    return Joined(out.r, out.t, out.focal_length, out.principal_point);
  });
}

py::array ToNerfNumbers(const py::object& cameras) {
  return ReadAll("Camera.to_nerf", cameras, 20, [](const Camera64& c) -> Numbers {
    const NerfCamera out = ToNerf(c);
    return Joined(out.camera_to_world, out.fl_x, out.fl_y, out.cx, out.cy);
  });
}

void BindTo(py::module_& m) {
  m.def("camera_to_opencv", &ToOpenCvNumbers, py::arg("cameras"), py::arg("half"),
        "(n, 21): k, rotation, translation.");
  m.def("camera_to_colmap", &ToColmapNumbers, py::arg("cameras"),
        "(n, 11): quaternion, translation, fx, fy, cx, cy.");
  m.def("camera_to_opengl", &ToOpenGlNumbers, py::arg("cameras"), py::arg("size"),
        py::arg("far_plane"), "(n, 32): projection, model_view.");
  m.def("camera_to_kaolin", &ToKaolinNumbers, py::arg("cameras"), py::arg("size"),
        "(n, 15): rotation, position, projection.");
  m.def("camera_to_pytorch3d", &ToPyTorch3dNumbers, py::arg("cameras"), py::arg("size"),
        "(n, 16): r, t, focal_length, principal_point.");
  m.def("camera_to_nerf", &ToNerfNumbers, py::arg("cameras"),
        "(n, 20): camera_to_world, fl_x, fl_y, cx, cy.");
}

}  // namespace

void BindCamera(py::module_& m) {
  m.def("camera_look_at", &LookAt, py::arg("fov_y"), py::arg("size"), py::arg("eye"),
        py::arg("target"), py::arg("up"), "(n, 17) that look at targets.");
  m.def("camera_orbit", &Orbit, py::arg("fov_y"), py::arg("size"), py::arg("orbits"),
        "(n, 17) of azimuth, elevation, distance.");
  m.def("camera_from_opencv", &OpenCv, py::arg("k"), py::arg("rotation"), py::arg("translation"),
        py::arg("half"), "(n, 17) of OpenCV's.");
  m.def("camera_from_colmap", &Colmap, py::arg("quaternion"), py::arg("translation"),
        py::arg("intrinsics"), "(n, 17) of COLMAP's.");
  m.def("camera_from_opengl", &OpenGl, py::arg("projection"), py::arg("model_view"),
        py::arg("size"), "(n, 17) of OpenGL's.");
  m.def("camera_from_kaolin", &Kaolin, py::arg("rotation"), py::arg("position"),
        py::arg("projection"), py::arg("size"), "(n, 17) of Kaolin's.");
  m.def("camera_from_pytorch3d", &PyTorch3d, py::arg("r"), py::arg("t"), py::arg("focal_length"),
        py::arg("principal_point"), py::arg("size"), "(n, 17) of PyTorch3D's.");
  m.def("camera_from_nerf", &Nerf, py::arg("camera_to_world"), py::arg("intrinsics"),
        "(n, 17) of NeRF's.");
  m.def("camera_resize", &Resize, py::arg("cameras"), py::arg("from_size"), py::arg("to_size"),
        "(n, 17) of images of another size.");
  BindTo(m);
}

}  // namespace tilegrad::python
