// SPDX-License-Identifier: Apache-2.0
#include "train/models/camera_ops.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "base/error.h"
#include "nn/nn.h"
#include "scene/light_frame.h"
#include "scene/weak_perspective_ref.h"
#include "train/models/render_op.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kRow = kWeakNumbers;

template <class T>
WeakPerspectiveT<T> CameraAt(const T* row) {
  return {row[0], {row[1], row[2]}, {row[3], row[4], row[5], row[6]}};
}

template <class T>
void PutCamera(const WeakPerspectiveT<T>& camera, T* row) {
  row[0] = camera.scale;
  std::ranges::copy(camera.translation, row + 1);
  std::ranges::copy(camera.quaternion, row + 3);
}

// From [-1, 1] to pixels.
template <class T>
WeakPerspectiveT<T> InPixels(WeakPerspectiveT<T> camera, int size) {
  const T half = T(size) / T(2);
  camera.scale *= half;
  for (T& t : camera.translation) t = (t + T(1)) * half;
  return camera;
}

template <class T>
std::array<T, 3> PointAt(const T* p) {
  return {p[0], p[1], p[2]};
}

struct Projection {
  nn::Tensor points, cameras;
  std::size_t batch() const { return static_cast<std::size_t>(points.shape()[0]); }
  std::size_t count() const { return static_cast<std::size_t>(points.shape()[1]); }

  template <class T>
  void Forward(T* out) const {
    for (std::size_t b = 0; b < batch(); ++b) {
      const auto camera = CameraAt(cameras.span<T>().data() + kRow * b);
      for (std::size_t k = b * count(); k < (b + 1) * count(); ++k) {
        const auto seen = ProjectWeakly(camera, PointAt(points.span<T>().data() + 3 * k));
        out[2 * k] = seen[0];
        out[2 * k + 1] = seen[1];
      }
    }
  }
  template <class T>
  void Backward(const T* d, T* d_points, T* d_cameras) const {
    for (std::size_t b = 0; b < batch(); ++b) {
      const auto camera = CameraAt(cameras.span<T>().data() + kRow * b);
      WeakPerspectiveT<T> d_camera{T(0), {}, {}};
      d_camera.quaternion = {};
      for (std::size_t k = b * count(); k < (b + 1) * count(); ++k) {
        std::array<T, 3> d_point{};
        ProjectWeaklyAdjoint(camera, PointAt(points.span<T>().data() + 3 * k),
                             {d[2 * k], d[2 * k + 1]}, &d_camera, &d_point);
        std::ranges::copy(d_point, d_points + 3 * k);
      }
      PutCamera(d_camera, d_cameras + kRow * b);
    }
  }
};

template <class T>
void PinholesBackward(const nn::Tensor& cameras, int size, const T* d, T* d_cameras) {
  const auto batch = static_cast<std::size_t>(cameras.shape()[0]);
  const T half = T(size) / T(2);
  for (std::size_t b = 0; b < batch; ++b) {
    WeakPerspectiveT<T> d_camera;
    const auto camera = InPixels(CameraAt(cameras.span<T>().data() + kRow * b), size);
    CameraT<T> d_pinhole;
    const T* row = d + kCameraNumbers * b;
    ForEachCameraNumber(d_pinhole, [&](T& number) { number = *row++; });
    PinholeOfAdjoint(camera, T(kPinholeDistance), d_pinhole, &d_camera);
    d_camera.scale *= half;
    for (T& t : d_camera.translation) t *= half;
    PutCamera(d_camera, d_cameras + kRow * b);
  }
}

// One rotation of six numbers, and what its numbers do to it.
class RowRotation {
 public:
  template <class T>
  explicit RowRotation(const T* n) {
    const glm::dvec3 a(n[0], n[1], n[2]), b(n[3], n[4], n[5]);
    first_ = Unit(a, {1, 0, 0}, &length_);
    along_ = glm::dot(b, first_);
    // Beside parallel rows any second one does.
    const glm::dvec3 aside = std::abs(first_.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
    second_ = Unit(b - along_ * first_, glm::normalize(glm::cross(first_, aside)), &across_);
    third_ = glm::cross(first_, second_);
    quaternion_ = QuaternionOf({first_.x, first_.y, first_.z, second_.x, second_.y, second_.z,
                                third_.x, third_.y, third_.z});
  }
  const std::array<double, 4>& quaternion() const { return quaternion_; }

  // Pulls d_quaternion back to the six numbers. A turn by the small vector t in the camera's axes
  // moves the quaternion by (0, t) q / 2, and of the rows first . third by t[1], first . second by
  // -t[2], second . third by -t[0].
  template <class T>
  void Backward(const T* d, T* d_numbers) const {
    const auto [w, x, y, z] = quaternion_;
    const double turns[3] = {(-x * d[0] + w * d[1] - z * d[2] + y * d[3]) / 2,
                             (-y * d[0] + z * d[1] + w * d[2] - x * d[3]) / 2,
                             (-z * d[0] - y * d[1] + x * d[2] + w * d[3]) / 2};
    const double by_third = (turns[1] + turns[0] * along_ / across_) / length_;
    const glm::dvec3 d_a = by_third * third_ - turns[2] / length_ * second_,
                     d_b = -turns[0] / across_ * third_;
    for (int i = 0; i < 3; ++i) {
      d_numbers[i] = static_cast<T>(d_a[i]);
      d_numbers[3 + i] = static_cast<T>(d_b[i]);
    }
  }

 private:
  static constexpr double kShortest = 1e-6;
  static glm::dvec3 Unit(const glm::dvec3& v, const glm::dvec3& otherwise, double* length) {
    const double own = glm::length(v);
    *length = std::max(own, kShortest);
    return own < kShortest ? otherwise : v / own;
  }

  glm::dvec3 first_, second_, third_;  // rows of the rotation
  double length_, across_;             // of the first numbers; of the others beside the first row
  double along_;                       // of the others along it
  std::array<double, 4> quaternion_;
};

// y[n] = matrix n times x[n]; matrices: [N,size,size].
nn::Var Turn(const nn::Var& x, const std::vector<double>& matrices, std::int64_t size) {
  const std::int64_t images = static_cast<std::int64_t>(matrices.size()) / (size * size);
  if (!x.valid()) return x;
  if (!(x.shape() == nn::Shape{images, size}))
    return nn::Fail(x, InternalError("lights {} of {} cameras", x.shape().ToString(), images));
  nn::Context& context = x.context();
  nn::Tensor tensor = context.Empty({images, size, size}, x.dtype());
  nn::WithFloatType(x.dtype(), [&]<class T>(T) {
    for (std::size_t i = 0; i < matrices.size(); ++i)
      tensor.data<T>()[i] = static_cast<T>(matrices[i]);
  });
  return nn::Sum(nn::Constant(context, std::move(tensor)) * nn::Reshape(x, {images, 1, size}), {2});
}

}  // namespace

nn::Var QuaternionsOfRows(const nn::Var& rows) {
  if (!rows.valid()) return rows;
  nn::Context& context = rows.context();
  const nn::Tensor& at = rows.value();
  const auto batch = static_cast<std::size_t>(rows.shape()[0]);
  nn::Tensor out = context.Empty({rows.shape()[0], 4}, rows.dtype());
  nn::WithFloatType(rows.dtype(), [&]<class T>(T) {
    for (std::size_t b = 0; b < batch; ++b) {
      const RowRotation rotation(at.span<T>().data() + 6 * b);
      std::ranges::transform(rotation.quaternion(), out.data<T>() + 4 * b,
                             [](double q) { return static_cast<T>(q); });
    }
  });
  auto backward = [at, batch, &context](std::span<const nn::Tensor> d) {
    nn::Tensor d_rows = context.Empty(at.shape(), at.dtype());
    nn::WithFloatType(at.dtype(), [&]<class T>(T) {
      for (std::size_t b = 0; b < batch; ++b)
        RowRotation(at.span<T>().data() + 6 * b)
            .Backward(d[0].span<T>().data() + 4 * b, d_rows.data<T>() + 6 * b);
    });
    return std::vector<nn::Tensor>{d_rows};
  };
  return nn::External(context, {"quaternions of rows", {rows}, {out}, std::move(backward)})[0];
}

nn::Var ProjectPoints(const nn::Var& points, const nn::Var& cameras) {
  if (!points.valid() || !cameras.valid()) return points.valid() ? cameras : points;
  const nn::Shape& shape = points.shape();
  if (shape.rank() != 3 || shape[2] != 3 || cameras.shape() != nn::Shape{shape[0], kWeakNumbers})
    return nn::Fail(points, InternalError("points {} and cameras {} do not go together",
                                          shape.ToString(), cameras.shape().ToString()));
  nn::Context& context = points.context();
  const Projection at{points.value(), cameras.value()};
  nn::Tensor out = context.Empty({shape[0], shape[1], 2}, points.dtype());
  nn::WithFloatType(points.dtype(), [&]<class T>(T) { at.Forward(out.data<T>()); });
  auto backward = [at, &context](std::span<const nn::Tensor> d) {
    nn::Tensor d_points = context.Empty(at.points.shape(), at.points.dtype());
    nn::Tensor d_cameras = context.Empty(at.cameras.shape(), at.cameras.dtype());
    nn::WithFloatType(at.points.dtype(), [&]<class T>(T) {
      at.Backward(d[0].span<T>().data(), d_points.data<T>(), d_cameras.data<T>());
    });
    return std::vector<nn::Tensor>{d_points, d_cameras};
  };
  return nn::External(context,
                      {"project points", {points, cameras}, {out}, std::move(backward)})[0];
}

nn::Var PinholeCameras(const nn::Var& cameras, int size) {
  if (!cameras.valid()) return cameras;
  nn::Context& context = cameras.context();
  const std::int64_t batch = cameras.shape()[0];
  nn::Tensor out = context.Empty({batch, kCameraNumbers}, cameras.dtype());
  const nn::Tensor& at = cameras.value();
  nn::WithFloatType(cameras.dtype(), [&]<class T>(T) {
    for (std::size_t b = 0; b < static_cast<std::size_t>(batch); ++b) {
      const auto camera = InPixels(CameraAt(at.span<T>().data() + kRow * b), size);
      T* row = out.data<T>() + kCameraNumbers * b;
      ForEachCameraNumber(PinholeOf(camera, T(kPinholeDistance)),
                          [&](T number) { *row++ = number; });
    }
  });
  auto backward = [at, size, &context](std::span<const nn::Tensor> d) {
    nn::Tensor d_cameras = context.Empty(at.shape(), at.dtype());
    nn::WithFloatType(at.dtype(), [&]<class T>(T) {
      PinholesBackward<T>(at, size, d[0].span<T>().data(), d_cameras.data<T>());
    });
    return std::vector<nn::Tensor>{d_cameras};
  };
  return nn::External(context, {"pinhole cameras", {cameras}, {out}, std::move(backward)})[0];
}

Camera PinholeIn(const WeakPerspective& camera, int size) {
  return CameraCast<float>(PinholeOf(InPixels(camera, size), kPinholeDistance));
}

nn::Tensor CameraRows(nn::Context& context, std::span<const WeakPerspective> cameras) {
  std::vector<double> rows(kRow * cameras.size());
  for (std::size_t b = 0; b < cameras.size(); ++b) PutCamera(cameras[b], &rows[kRow * b]);
  return context.From({static_cast<std::int64_t>(cameras.size()), kWeakNumbers},
                      std::span<const double>(rows));
}

nn::Var DirectionsToWorld(const nn::Var& directions, std::span<const Camera> cameras) {
  std::vector<double> matrices;
  matrices.reserve(9 * cameras.size());
  for (const Camera& camera : cameras) {
    for (int i = 0; i < 9; ++i) matrices.push_back(camera.rotation[3 * (i % 3) + i / 3]);
  }
  return Turn(directions, matrices, 3);
}

nn::Var HarmonicsToWorld(const nn::Var& sh, std::span<const Camera> cameras) {
  std::vector<double> matrices(81 * cameras.size());
  for (std::size_t n = 0; n < cameras.size(); ++n) {
    for (std::size_t from = 0; from < 9; ++from) {
      std::array<double, 9> unit = {};
      unit[from] = 1;
      const std::array<double, 9> column = HarmonicsToWorld(unit, cameras[n]);
      for (std::size_t to = 0; to < 9; ++to) matrices[81 * n + 9 * to + from] = column[to];
    }
  }
  return Turn(sh, matrices, 9);
}

}  // namespace tilegrad::train
