// SPDX-License-Identifier: Apache-2.0
// Points and surfaces, for tilegrad.compat: batches of arrays, float32 or float64.
#include <vector>

#include "bindings/calls.h"
#include "scene/topology.h"
#include "train/losses/area_edge_length.h"
#include "train/losses/iou.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"
#include "train/metrics/face_tree.h"
#include "train/metrics/metrics.h"

namespace tilegrad::python {
namespace {

using train::FaceTree;
using train::Triangle;

constexpr std::size_t kGrain = 64;  // queries of a task

template <class T>
std::vector<glm::dvec3> PointsOf(std::span<const T> numbers) {
  std::vector<glm::dvec3> points;
  points.reserve(numbers.size() / 3);
  for (std::size_t i = 0; i < numbers.size(); i += 3) {
    points.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  }
  return points;
}

template <class T>
std::vector<Triangle> TrianglesOf(std::span<const T> numbers) {
  const auto points = PointsOf(numbers);
  std::vector<Triangle> faces;
  faces.reserve(points.size() / 3);
  for (std::size_t i = 0; i < points.size(); i += 3) {
    faces.push_back({points[i], points[i + 1], points[i + 2]});
  }
  return faces;
}

// The part of one of `batch` images.
template <class T>
std::span<T> Part(std::span<T> all, std::size_t batch, std::size_t at) {
  return all.subspan(at * (all.size() / batch), all.size() / batch);
}

struct Queries {
  const char* function;
  const Workers& workers;
  std::size_t batch;
};

// answer(tree, query, index of the query in the whole batch), for every query in its image's tree.
template <class Tree, class T, class TreeOf, class Answer>
void AskTrees(const Queries& how, std::span<const T> queries, const TreeOf& tree_of,
              const Answer& answer) {
  Run(how.function, [&] {
    for (std::size_t b = 0; b < how.batch; ++b) {
      const auto points = PointsOf(Part(queries, how.batch, b));
      const Tree tree(tree_of(b));
      how.workers.ForEach(points.size(), kGrain,
                          [&](std::size_t i) { answer(tree, points[i], b * points.size() + i); });
    }
  });
}

py::array NearestPoints(const py::array& from, const py::array& to, int threads) {
  constexpr const char* kName = "sided_distance";
  return Dispatch(from, kName, "p1", [&]<class T>(T) -> py::array {
    const auto queries = FiniteSpanOf<T>(from, kName, "p1", {kAny, kAny, 3});
    const auto targets = FiniteSpanOf<T>(to, kName, "p2", {from.shape(0), kAny, 3});
    py::array_t<std::int64_t> out(std::vector<py::ssize_t>{from.shape(0), from.shape(1)});
    std::int64_t* index = out.mutable_data();
    const Queries how{kName, SharedWorkers(threads), static_cast<std::size_t>(from.shape(0))};
    AskTrees<train::NearestPoint>(
        how, queries, [&](std::size_t b) { return PointsOf(Part(targets, how.batch, b)); },
        [&](const auto& tree, const auto& query, std::size_t i) {
          index[i] = tree.Find(query).index;
        });
    return out;
  });
}

py::tuple NearestFaces(const py::array& points, const py::array& corners, int threads) {
  constexpr const char* kName = "point_to_mesh_distance";
  return Dispatch(points, kName, "pointclouds", [&]<class T>(T) {
    const auto queries = FiniteSpanOf<T>(points, kName, "pointclouds", {kAny, kAny, 3});
    const auto faces =
        FiniteSpanOf<T>(corners, kName, "face_vertices", {points.shape(0), kAny, 3, 3});
    py::array_t<std::int64_t> faces_out(std::vector<py::ssize_t>{points.shape(0), points.shape(1)});
    auto weights_out = NewArrayLike<T>(points);
    std::int64_t* index = faces_out.mutable_data();
    T* weights = weights_out.mutable_data();
    const Queries how{kName, SharedWorkers(threads), static_cast<std::size_t>(points.shape(0))};
    AskTrees<FaceTree>(
        how, queries, [&](std::size_t b) { return TrianglesOf(Part(faces, how.batch, b)); },
        [&](const FaceTree& tree, const auto& query, std::size_t i) {
          const auto found = tree.Find(query);
          index[i] = found.face;
          for (std::size_t k = 0; k < 3; ++k) weights[3 * i + k] = static_cast<T>(found.weights[k]);
        });
    return py::make_tuple(faces_out, weights_out);
  });
}

py::array Enclosed(const py::array& points, const py::array& corners, int threads) {
  constexpr const char* kName = "check_sign";
  return Dispatch(points, kName, "points", [&]<class T>(T) -> py::array {
    const auto queries = FiniteSpanOf<T>(points, kName, "points", {kAny, kAny, 3});
    const auto faces = FiniteSpanOf<T>(corners, kName, "faces", {points.shape(0), kAny, 3, 3});
    py::array_t<bool> out(std::vector<py::ssize_t>{points.shape(0), points.shape(1)});
    bool* inside = out.mutable_data();
    const Queries how{kName, SharedWorkers(threads), static_cast<std::size_t>(points.shape(0))};
    AskTrees<FaceTree>(
        how, queries, [&](std::size_t b) { return TrianglesOf(Part(faces, how.batch, b)); },
        [&](const FaceTree& tree, const auto& query, std::size_t i) {
          inside[i] = tree.Encloses(query);
        });
    return out;
  });
}

py::tuple SampleFaces(const py::object& areas, int count, std::uint64_t seed) {
  const auto samples = train::SampleFaces(
      FiniteSpanOf<double>(areas, "sample_points", "areas", {kAny}), count, seed);
  ThrowIfError(samples.status().Within("sample_points"));
  py::array_t<std::int64_t> faces(count);
  py::array_t<double> weights({count, 3});
  for (std::size_t i = 0; i < samples->size(); ++i) {
    faces.mutable_data()[i] = (*samples)[i].face;
    std::copy((*samples)[i].weights.begin(), (*samples)[i].weights.end(),
              weights.mutable_data() + 3 * i);
  }
  return py::make_tuple(faces, weights);
}

py::array SurfaceVoxels(const py::object& corners, int resolution) {
  const auto faces = TrianglesOf(
      FiniteSpanOf<double>(corners, "trianglemeshes_to_voxelgrids", "corners", {kAny, 3, 3}));
  const auto voxels = train::SurfaceVoxels(faces, resolution);
  ThrowIfError(voxels.status().Within("trianglemeshes_to_voxelgrids"));
  return CopyOf<std::uint8_t>(*voxels, {resolution, resolution, resolution});
}

double VoxelIou(const py::object& a, const py::array& b) {
  return train::VoxelIou(SpanOf<std::uint8_t>(a, "iou", "pred", {b.size()}),
                         SpanOf<std::uint8_t>(b, "iou", "gt", {kAny}));
}

// The losses of training and fitting (train/losses), each as its value and its gradient: float32 or
// float64.

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
    Run(function, [&] {
      std::fill(d_p.begin(), d_p.end(), T(0));
      value =
          loss(BuildTopology(triangles, p.size() / 3), std::span<const Face>(triangles), p, d_p);
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
    Run("iou", [&] {
      const std::size_t pixels = images == 0 ? 0 : predicted.size() / images;
      for (std::size_t i = 0; i < images; ++i) {
        const auto s = wanted.subspan(i * pixels, pixels);
        const train::IouSums<T> sums(s, predicted.subspan(i * pixels, pixels));
        sum += sums.loss() / static_cast<double>(images);
        train::IouBackward(sums, s, 1.0 / static_cast<double>(images),
                           d_alpha.subspan(i * pixels, pixels));
      }
    });
    return {sum, gradient};
  });
}

}  // namespace

void BindSurfaces(py::module_& m) {
  m.def("nearest_points", &NearestPoints,
        "(B, N, 3), (B, M, 3) -> for each of the N the nearest of the M (B, N) int64.");
  m.def(
      "nearest_faces", &NearestFaces,
      "(B, N, 3), (B, F, 3, 3) -> the nearest face (B, N) int64 and the weights of its corners in\n"
      "the nearest point (B, N, 3): 0 on the opposite edge.");
  m.def("enclosed", &Enclosed,
        "(B, N, 3), (B, F, 3, 3) -> whether the faces enclose the point (B, N) bool.");
  m.def("sample_faces", &SampleFaces,
        "(F,) float64 -> faces (count,) int64, distributed by area, and weights of their corners\n"
        "(count, 3) float64.");
  m.def("surface_voxels", &SurfaceVoxels,
        "(F, 3, 3) float64, in voxels -> those that the faces pass through (R, R, R) uint8.");
  m.def("voxel_iou", &VoxelIou, "(N,) uint8, (N,) uint8.");
}

void BindLosses(py::module_& m) {
  const char* text = "(value, gradient) of a mesh: positions (V, 3), faces (F, 3) int32.";
  m.def("edge_length", &EdgeLength, text);
  m.def("normal_consistency", &NormalConsistency, text);
  m.def("laplacian", &Laplacian, text);
  m.def("iou", &Iou, "(value, gradient) of images (N, pixels).");
}

}  // namespace tilegrad::python
