// SPDX-License-Identifier: Apache-2.0
// Cameras of other programs, from and to arrays of the numbers that tilegrad/_camera.py packs. Row
// i of each argument belongs to camera i.
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "bindings/camera_numbers.h"
#include "bindings/scene_record.h"
#include "scene/camera_conventions.h"

namespace tilegrad::python {
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
      return InvalidArgument("eye and target coincide: the viewing direction is undefined");
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

py::array Resize(const py::object& cameras, Size from, Size to) {
  const Rows<kCameraNumbers> rows("Camera.resize", "cameras", cameras);
  return MakeAll("Camera.resize", rows.count(), [&](std::size_t i) -> Result<Camera64> {
    return ResizeCamera(CameraOfNumbers(rows[i]), SizeOf(from), SizeOf(to));
  });
}

// What a convention may need besides the numbers of its cameras.
struct Extra {
  ImageSize size;
  PixelCentre centre;
  double far_plane = 0;
};

// A record of nothing but doubles, as the row of them and back.
template <class Record>
using RowOf = std::array<double, sizeof(Record) / sizeof(double)>;
template <class Record>
Record RecordAt(const double* numbers) {
  RowOf<Record> row;
  std::copy_n(numbers, row.size(), row.begin());
  return std::bit_cast<Record>(row);
}
template <class Record>
Status Append(const Result<Record>& record, std::vector<double>* out) {
  TILEGRAD_TRY(record.status());
  const auto row = std::bit_cast<RowOf<Record>>(*record);
  out->insert(out->end(), row.begin(), row.end());
  return {};
}

struct OpenCvRow {
  Mat3Array k, rotation;
  Vec3Array translation;
};

struct Convention {
  std::string_view name;
  std::size_t width;  // numbers of a camera: the arguments of Camera.from_..., in their order
  Result<Camera64> (*from)(const double* numbers, const Extra& extra);
  Status (*to)(const Camera64& camera, const Extra& extra, std::vector<double>* out);
};

constexpr Convention kConventions[] = {
    {"opencv", 21,
     [](const double* x, const Extra& e) {
       const auto [k, rotation, translation] = RecordAt<OpenCvRow>(x);
       return FromOpenCv({k, rotation, translation, e.centre});
     },
     [](const Camera64& c, const Extra& e, std::vector<double>* out) {
       const OpenCvCamera cv = ToOpenCv(c, e.centre);
       return Append<OpenCvRow>(OpenCvRow{cv.k, cv.rotation, cv.translation}, out);
     }},
    {"colmap", 11,
     [](const double* x, const Extra&) { return FromColmap(RecordAt<ColmapCamera>(x)); },
     [](const Camera64& c, const Extra&, std::vector<double>* out) {
       return Append<ColmapCamera>(ToColmap(c), out);
     }},
    {"opengl", 32,
     [](const double* x, const Extra& e) { return FromOpenGl(RecordAt<OpenGlCamera>(x), e.size); },
     [](const Camera64& c, const Extra& e, std::vector<double>* out) {
       return Append(ToOpenGl(c, e.size, e.far_plane), out);
     }},
    {"kaolin", 15,
     [](const double* x, const Extra& e) { return FromKaolin(RecordAt<KaolinCamera>(x), e.size); },
     [](const Camera64& c, const Extra& e, std::vector<double>* out) {
       return Append(ToKaolin(c, e.size), out);
     }},
    {"pytorch3d", 16,
     [](const double* x, const Extra& e) {
       return FromPyTorch3d(RecordAt<PyTorch3dCamera>(x), e.size);
     },
     [](const Camera64& c, const Extra& e, std::vector<double>* out) {
       return Append(ToPyTorch3d(c, e.size), out);
     }},
    {"nerf", 20, [](const double* x, const Extra&) { return FromNerf(RecordAt<NerfCamera>(x)); },
     [](const Camera64& c, const Extra&, std::vector<double>* out) {
       return Append<NerfCamera>(ToNerf(c), out);
     }},
};

const Convention& ConventionOf(const std::string& name) {
  for (const Convention& c : kConventions) {
    if (c.name == name) return c;
  }
  throw py::value_error("unknown camera convention " + name);
}

py::array From(const std::string& name, const py::object& rows, Size size, bool half) {
  const Convention& convention = ConventionOf(name);
  const std::string function = "Camera.from_" + name;
  const auto width = static_cast<py::ssize_t>(convention.width);
  const auto numbers = SpanOf<double>(rows, function.c_str(), "rows", {kAny, width});
  return MakeAll(function.c_str(), numbers.size() / convention.width, [&](std::size_t i) {
    return convention.from(&numbers[i * convention.width], {SizeOf(size), CentreOf(half)});
  });
}

py::array To(const std::string& name, const py::object& cameras, Size size, bool half,
             double far_plane) {
  const Convention& convention = ConventionOf(name);
  const std::string function = "Camera.to_" + name;
  const Rows<kCameraNumbers> rows(function.c_str(), "cameras", cameras);
  std::vector<double> out;
  for (std::size_t i = 0; i < rows.count(); ++i) {
    const Extra extra{SizeOf(size), CentreOf(half), far_plane};
    ThrowIfError(convention.to(CameraOfNumbers(rows[i]), extra, &out).Within(function));
  }
  return CopyOf<double>(
      out, {static_cast<py::ssize_t>(rows.count()), static_cast<py::ssize_t>(convention.width)});
}

}  // namespace

void BindCamera(py::module_& m) {
  m.def("camera_look_at", &LookAt, "Cameras (n, 17) from eyes and targets.");
  m.def("camera_orbit", &Orbit, "Cameras (n, 17) from azimuth, elevation, distance.");
  m.def("camera_from", &From, py::arg("convention"), py::arg("rows"), py::arg("size") = Size(0, 0),
        py::arg("half") = false,
        "Cameras (n, 17) from the concatenated arguments of Camera.from_...");
  m.def("camera_to", &To, py::arg("convention"), py::arg("cameras"), py::arg("size") = Size(0, 0),
        py::arg("half") = false, py::arg("far_plane") = 0.0,
        "The arguments of Camera.from_..., concatenated, from cameras (n, 17).");
  m.def("camera_resize", &Resize, "Cameras (n, 17) for images of another size.");
}

}  // namespace tilegrad::python
