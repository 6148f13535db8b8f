// SPDX-License-Identifier: Apache-2.0
// The losses of training and fitting (train/losses), each as its value and its gradient: float32 or
// float64.
#include <vector>

#include "bindings/calls.h"
#include "scene/topology.h"
#include "train/losses/edge_length.h"
#include "train/losses/iou.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

namespace tilegrad::python {

void BindLosses(py::module_& m);

namespace {

using Outcome = std::pair<double, py::array>;

std::vector<Face> FacesOf(const char* function, const py::array& array, std::size_t vertices) {
  const auto corners = SpanOf<std::int32_t>(array, function, "faces", {kAny, 3});
  std::vector<Face> faces(corners.size() / 3);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (corners[i] < 0 || static_cast<std::size_t>(corners[i]) >= vertices) {
      throw py::value_error(fmt::format("{}: faces[{},{}] is {}, outside of [0, {})", function,
                                        i / 3, i % 3, corners[i], vertices));
    }
    faces[i / 3][i % 3] = corners[i];
  }
  return faces;
}

// loss(topology, faces, positions, gradient) -> value, of one mesh; the gradient comes zeroed.
template <class Loss>
Outcome OfMesh(const char* function, const py::array& positions, const py::array& faces,
               const Loss& loss) {
  return Dispatch(positions, function, "positions", [&]<class T>(T) -> Outcome {
    const auto p = FiniteSpanOf<T>(positions, function, "positions", {kAny, 3});
    const auto triangles = FacesOf(function, faces, p.size() / 3);
    py::array_t<T> gradient = NewArrayLike<T>(positions);
    const std::span<T> d_p = NumbersOf(gradient);
    double value = 0;
    Run(function, [&]() -> Status {
      std::fill(d_p.begin(), d_p.end(), T(0));
      value =
          loss(BuildTopology(triangles, p.size() / 3), std::span<const Face>(triangles), p, d_p);
      return {};
    });
    return {value, gradient};
  });
}

Outcome EdgeLength(const py::array& positions, const py::array& faces) {
  return OfMesh("edge_length", positions, faces,
                []<class T>(const Topology& topology, std::span<const Face>, std::span<const T> p,
                            std::span<T> d_p) {
                  train::EdgeSums sums;
                  const double value = train::EdgeLengthForward(topology, p, &sums);
                  train::AddEdgeLengthGradient(topology, p, sums, T(1), d_p);
                  return value;
                });
}

Outcome NormalConsistency(const py::array& positions, const py::array& faces) {
  return OfMesh("normal_consistency", positions, faces,
                []<class T>(const Topology& topology, std::span<const Face> triangles,
                            std::span<const T> p, std::span<T> d_p) {
                  std::vector<train::FaceNormal<T>> normals;
                  const double value = train::SmoothnessForward(topology, triangles, p, normals);
                  train::SmoothnessBackward(topology, triangles, p, normals, T(1), d_p);
                  return value;
                });
}

Outcome Laplacian(const py::array& movement, const py::array& faces) {
  return OfMesh("laplacian", movement, faces,
                []<class T>(const Topology& topology, std::span<const Face>, std::span<const T> m,
                            std::span<T> d_m) {
                  std::vector<T> residual(m.size());
                  const double value = train::LaplacianForward(topology, m, std::span<T>(residual));
                  train::LaplacianBackward(topology, std::span<const T>(residual), T(1), d_m);
                  return value;
                });
}

// alpha, truth: [N, pixels].
Outcome Iou(const py::array& alpha, const py::array& truth) {
  return Dispatch(alpha, "iou", "alpha", [&]<class T>(T) -> Outcome {
    const auto predicted = FiniteSpanOf<T>(alpha, "iou", "alpha", {kAny, kAny});
    const auto images = static_cast<std::size_t>(alpha.shape(0));
    const auto wanted = FiniteSpanOf<T>(truth, "iou", "truth", {alpha.shape(0), alpha.shape(1)});
    py::array_t<T> gradient = NewArrayLike<T>(alpha);
    const std::span<T> d_alpha = NumbersOf(gradient);
    double sum = 0;
    Run("iou", [&]() -> Status {
      const std::size_t pixels = images == 0 ? 0 : predicted.size() / images;
      for (std::size_t i = 0; i < images; ++i) {
        const auto s = wanted.subspan(i * pixels, pixels);
        const train::IouSums<T> sums(s, predicted.subspan(i * pixels, pixels));
        sum += sums.loss() / static_cast<double>(images);
        train::IouBackward(sums, s, 1.0 / static_cast<double>(images),
                           d_alpha.subspan(i * pixels, pixels));
      }
      return {};
    });
    return {sum, gradient};
  });
}

}  // namespace

void BindLosses(py::module_& m) {
  const char* text = "(value, gradient) of a mesh: positions (V, 3), faces (F, 3) int32.";
  m.def("edge_length", &EdgeLength, py::arg("positions"), py::arg("faces"), text);
  m.def("normal_consistency", &NormalConsistency, py::arg("positions"), py::arg("faces"), text);
  m.def("laplacian", &Laplacian, py::arg("movement"), py::arg("faces"), text);
  m.def("iou", &Iou, py::arg("alpha"), py::arg("truth"),
        "(value, gradient) of images (N, pixels).");
}

}  // namespace tilegrad::python
