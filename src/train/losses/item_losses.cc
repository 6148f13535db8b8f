// SPDX-License-Identifier: Apache-2.0
// Losses that are written by hand, with their gradients: over batches of images and of meshes,
// items in parallel, sums merged in their order.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "base/error.h"
#include "nn/kernels/pointwise.h"
#include "nn/networks.h"
#include "nn/tape.h"
#include "train/losses/area_edge_length.h"
#include "train/losses/iou.h"
#include "train/losses/l1.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train {
namespace {

// `value` as a scalar Var whose gradient with respect to `input` is `gradient`, computed beforehand
// with the value.
nn::Var ScalarLoss(const char* name, const nn::Var& input, double value, nn::Tensor gradient) {
  nn::Context& context = input.context();
  nn::Tensor output = context.Empty({}, input.dtype());
  nn::WithFloatType(input.dtype(), [&]<class T>(T) { *output.data<T>() = static_cast<T>(value); });
  auto backward = [gradient, &context](std::span<const nn::Tensor> d_outputs) {
    if (d_outputs[0].empty()) return std::vector<nn::Tensor>(1);
    return nn::WithFloatType(gradient.dtype(), [&]<class T>(T) {
      const T factor = *d_outputs[0].data<T>();
      if (factor == T(1)) return std::vector<nn::Tensor>{gradient};
      nn::Tensor scaled = context.Empty(gradient.shape(), gradient.dtype());
      nn::Unary(nn::UnaryProblem<T>{nn::UnaryOp::kScale, gradient.data<T>(), scaled.data<T>(),
                                    gradient.elements(), static_cast<double>(factor)},
                context.workers());
      return std::vector<nn::Tensor>{scaled};
    });
  };
  return nn::External(
      context,
      {.name = name, .inputs = {input}, .outputs = {output}, .backward = std::move(backward)})[0];
}

// per_image(truth, predicted, d_predicted) -> the loss of one image; the result is the sum of all
// times `scale`.
template <class PerImage>
nn::Var ImageLoss(const char* name, const nn::Var& predicted, const nn::Tensor& truth, double scale,
                  PerImage per_image) {
  if (!predicted.valid()) return predicted;
  nn::Context& context = predicted.context();
  if (!(predicted.shape() == truth.shape()) || predicted.dtype() != truth.dtype() ||
      truth.shape().rank() < 1) {
    return nn::Fail(predicted,
                    InternalError("{}: predicted {} and truth {} must be equal in shape and dtype",
                                  name, predicted.shape().ToString(), truth.shape().ToString()));
  }
  nn::Tensor gradient = context.Empty(predicted.shape(), predicted.dtype());
  const auto images = static_cast<std::size_t>(truth.shape()[0]);
  std::vector<double> losses(images);
  nn::WithFloatType(predicted.dtype(), [&]<class T>(T) {
    const std::span<const T> s = truth.span<T>(), p = predicted.value().template span<T>();
    const std::size_t size = s.size() / std::max<std::size_t>(1, images);
    context.workers().For(images, [&](std::size_t i, std::size_t) {
      losses[i] = per_image(s.subspan(i * size, size), p.subspan(i * size, size),
                            gradient.span<T>().subspan(i * size, size));
    });
  });
  double sum = 0;
  for (const double loss : losses) sum += loss;
  return ScalarLoss(name, predicted, scale * sum, gradient);
}

// per_mesh(values [V,3], scale, d [V,3]) -> the loss of one mesh; the result is the mean.
template <class PerMesh>
nn::Var MeshLoss(const char* name, const nn::Var& x, PerMesh per_mesh) {
  if (!x.valid()) return x;
  nn::Context& context = x.context();
  nn::Tensor gradient = context.Empty(x.shape(), x.dtype());
  const auto meshes = static_cast<std::size_t>(x.shape()[0]);
  const std::size_t size = x.value().elements() / meshes;
  std::vector<double> losses(meshes);
  nn::WithFloatType(x.dtype(), [&]<class T>(T) {
    context.workers().For(meshes, [&](std::size_t i, std::size_t) {
      losses[i] = per_mesh(x.value().template span<T>().subspan(i * size, size), T(1) / T(meshes),
                           gradient.span<T>().subspan(i * size, size));
    });
  });
  double sum = 0;
  for (const double loss : losses) sum += loss;
  return ScalarLoss(name, x, sum / static_cast<double>(meshes), gradient);
}

// cot of the angle at a between b and c: dot / |cross|.
double Cotangent(const double* a, const double* b, const double* c) {
  const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const double v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const double cross =
      std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  if (!(std::abs(dot) < kMostCotangent * cross)) return dot < 0 ? -kMostCotangent : kMostCotangent;
  return dot / cross;
}

std::vector<nn::Var> ConstantFeatures(const FeatureFunction& features, nn::Context& context,
                                      const nn::Tensor& images) {
  const nn::NoGrad off(context);
  return features(nn::Constant(context, images));
}

}  // namespace

nn::Var ColorL1Loss(const nn::Var& image, const nn::Tensor& truth) {
  const auto& shape = truth.shape();
  const double scale = static_cast<double>(shape[1]) / static_cast<double>(shape.elements());
  return ImageLoss("color loss", image, truth, scale,
                   [scale]<class T>(std::span<const T> s, std::span<const T> p, std::span<T> d) {
                     AbsoluteDifferenceBackward(s, p, scale, d);
                     return AbsoluteDifference(s, p);
                   });
}

nn::Var WeightedColorL1Loss(const nn::Var& image, const nn::Tensor& truth,
                            const nn::Tensor& weight) {
  const double scale = 1 / static_cast<double>(truth.elements());
  const std::size_t plane = weight.elements() / static_cast<std::size_t>(weight.shape()[0]);
  return ImageLoss("color loss", image, truth, scale,
                   [&]<class T>(std::span<const T> s, std::span<const T> p, std::span<T> d) {
                     const auto i = static_cast<std::size_t>(s.data() - truth.data<T>()) / s.size();
                     const auto w = weight.span<T>().subspan(i * plane, plane);
                     double sum = 0;
                     for (std::size_t from = 0; from < s.size(); from += plane) {
                       for (std::size_t k = 0; k < plane; ++k) {
                         const T gap = p[from + k] - s[from + k];
                         sum += static_cast<double>(w[k] * std::abs(gap));
                         const auto sign =
                             static_cast<T>((gap > T(0)) - (gap < T(0)));  // no branches
                         d[from + k] = static_cast<T>(scale) * w[k] * sign;
                       }
                     }
                     return sum;
                   });
}

nn::Var ColorHuberLoss(const nn::Var& image, const nn::Tensor& truth, double soft) {
  const auto& shape = truth.shape();
  const double scale = static_cast<double>(shape[1]) / static_cast<double>(shape.elements());
  return ImageLoss(
      "color loss", image, truth, scale,
      [scale, soft]<class T>(std::span<const T> s, std::span<const T> p, std::span<T> d) {
        HuberDifferenceBackward(s, p, soft, scale, d);
        return HuberDifference(s, p, soft);
      });
}

nn::Var IouLoss(const nn::Var& alpha, const nn::Tensor& truth) {
  const double scale = 1.0 / static_cast<double>(truth.shape()[0]);
  return ImageLoss("iou loss", alpha, truth, scale,
                   [scale]<class T>(std::span<const T> s, std::span<const T> a, std::span<T> d) {
                     const IouSums<T> sums(s, a);
                     IouBackward(sums, s, scale, d);
                     return sums.loss();
                   });
}

nn::Var SquaredSilhouetteLoss(const nn::Var& alpha, const nn::Tensor& truth) {
  const double share = 1.0 / static_cast<double>(truth.shape()[0]);
  return ImageLoss("silhouette loss", alpha, truth, share,
                   [share]<class T>(std::span<const T> s, std::span<const T> a, std::span<T> d) {
                     double area = 0, sum = 0;
                     for (const T x : s) area += static_cast<double>(x);
                     area = std::max(area, 1.0);
                     const auto step = static_cast<T>(2 * share / area);
                     for (std::size_t p = 0; p < s.size(); ++p) {
                       const T gap = a[p] - s[p];
                       sum += static_cast<double>(gap * gap);
                       d[p] = step * gap;
                     }
                     return sum / area;
                   });
}

nn::Var LaplacianLoss(const nn::Var& movement, const Topology& topology) {
  return MeshLoss("laplacian loss", movement,
                  [&]<class T>(std::span<const T> m, T scale, std::span<T> d) {
                    std::vector<T> residual(m.size());
                    const double loss = LaplacianForward<T>(topology, m, residual);
                    LaplacianBackward<T>(topology, residual, scale, d);
                    return loss;
                  });
}

nn::Var SmoothnessLoss(const nn::Var& positions, std::span<const Face> faces,
                       const Topology& topology) {
  return MeshLoss("smoothness loss", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    std::vector<FaceNormal<T>> normals;
                    const double loss = SmoothnessForward<T>(topology, faces, p, normals);
                    SmoothnessBackward<T>(topology, faces, p, normals, scale, d);
                    return loss;
                  });
}

nn::Var EdgeLengthLoss(const nn::Var& positions, const Topology& topology) {
  return MeshLoss("edge length loss", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    EdgeSums sums;
                    const double loss = EdgeLengthForward<T>(topology, p, &sums);
                    std::ranges::fill(d, T(0));
                    AddEdgeLengthGradient<T>(topology, p, sums, scale, d);
                    return loss;
                  });
}

nn::Var AreaLoss(const nn::Var& positions, std::span<const Face> faces) {
  return MeshLoss("area loss", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    std::ranges::fill(d, T(0));
                    return AddAreaGradient<T>(faces, p, static_cast<double>(scale), d);
                  });
}

std::vector<WeighedEdge> CotangentWeights(std::span<const Face> faces,
                                          std::span<const double> positions) {
  std::vector<WeighedEdge> out;
  for (const Face& face : faces) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::int32_t a = face[corner], i = face[(corner + 1) % 3], j = face[(corner + 2) % 3];
      const double* const p = positions.data();
      out.push_back({i, j, Cotangent(p + 3 * a, p + 3 * i, p + 3 * j) / 2});
    }
  }
  return out;
}

// L is symmetric, so the gradient is L applied to the unit vectors of L v.
nn::Var CotangentLaplacianLoss(const nn::Var& positions, std::span<const WeighedEdge> edges) {
  return MeshLoss("cotangent laplacian", positions,
                  [&]<class T>(std::span<const T> p, T scale, std::span<T> d) {
                    std::vector<T> residual(p.size(), T(0));
                    AddLaplacian<T>(edges, p, residual);
                    const std::size_t vertices = p.size() / 3;
                    double sum = 0;
                    for (std::size_t v = 0; v < vertices; ++v) {
                      T* const r = &residual[3 * v];
                      const T length = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
                      sum += static_cast<double>(length);
                      const T unit = length > T(0) ? scale / (length * T(vertices)) : T(0);
                      for (std::size_t c = 0; c < 3; ++c) r[c] *= unit;
                    }
                    std::ranges::fill(d, T(0));
                    AddLaplacian<T>(edges, residual, d);
                    return sum / static_cast<double>(vertices);
                  });
}

nn::Var FeatureL1Loss(const FeatureFunction& features, const nn::Var& predicted,
                      const nn::Tensor& truth) {
  if (!predicted.valid()) return predicted;
  if (!(predicted.shape() == truth.shape()) || predicted.dtype() != truth.dtype())
    return nn::Fail(predicted,
                    InternalError("feature loss: predicted {} and truth {} must be equal in shape "
                                  "and dtype",
                                  predicted.shape().ToString(), truth.shape().ToString()));
  const std::vector<nn::Var> want = ConstantFeatures(features, predicted.context(), truth);
  const std::vector<nn::Var> have = features(predicted);
  if (have.empty())
    return nn::Fail(predicted, InvalidArgument("feature loss: the network gives no layers"));
  return nn::PerceptualL1(have, want);
}

FeatureFunction FeaturesOf(nn::Critic& critic) {
  return [&critic](const nn::Var& images) {
    std::vector<nn::Var> levels = critic.Features(images, nn::Mode::kTrain);
    levels.pop_back();
    return levels;
  };
}

}  // namespace tilegrad::train
