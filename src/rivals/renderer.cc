// SPDX-License-Identifier: Apache-2.0
#include "rivals/renderer.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "rivals/image_state.h"

namespace tilegrad::rivals {
namespace {

Status CheckSize(const char* name, std::size_t size, std::size_t expected) {
  if (size == expected) return {};
  return InvalidArgument("{} has {} numbers, expected {}", name, size, expected);
}

Status CheckFaces(std::span<const std::int32_t> faces, std::size_t vertices) {
  if (faces.size() % 3 != 0)
    return InvalidArgument("faces have {} indices, not three each", faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] >= 0 && static_cast<std::size_t>(faces[i]) < vertices) continue;
    return InvalidArgument("corner {} of face {} is vertex {}, but there are {}", i % 3, i / 3,
                           faces[i], vertices);
  }
  return {};
}

template <class T>
Status CheckBatch(const BatchT<T>& batch) {
  if (batch.size < 1 || batch.size > 16384)
    return InvalidArgument("images have {} pixels a side; 1 to 16384 are possible", batch.size);
  if (batch.meshes == 0 || batch.positions.size() % (3 * batch.meshes) != 0 ||
      batch.cameras.size() % batch.meshes != 0) {
    return InvalidArgument("{} numbers of positions and {} cameras do not make {} equal meshes",
                           batch.positions.size(), batch.cameras.size(), batch.meshes);
  }
  if (!batch.colors.empty())
    TILEGRAD_TRY(CheckSize("colors", batch.colors.size(), batch.positions.size()));
  return CheckFaces(batch.faces, batch.vertices());
}

Status Positive(const char* name, double value) {
  if (value > 0 && std::isfinite(value)) return {};
  return InvalidArgument("{} is {}, but must be positive and finite", name, value);
}

Status CheckPlanes(const char* rule, double near_plane, double far_plane) {
  if (near_plane > 0 && near_plane < far_plane && std::isfinite(far_plane)) return {};
  return InvalidArgument("{}: near {} and far {} must be 0 < near < far", rule, near_plane,
                         far_plane);
}

Status CheckResolution(const char* name, int value, int least, int most) {
  if (value >= least && value <= most) return {};
  return InvalidArgument("{} is {}; {} to {} are possible", name, value, least, most);
}

// sum <- the sum of `part` of the images of mesh b, in their order.
template <class T, class PartOf>
void SumViews(std::size_t views, std::size_t b, std::span<T> sum, const PartOf& part_of) {
  std::fill(sum.begin(), sum.end(), T(0));
  for (std::size_t v = 0; v < views; ++v) {
    const std::span<const T> part = part_of(b * views + v);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
  }
}

template <class T>
Status CheckTextures(const BatchT<T>& batch, const Options& options) {
  if (batch.textures.empty()) return {};
  if (options.rule != Rule::kN3mr) return InvalidArgument("textures of faces are N3MR's alone");
  if (!batch.colors.empty()) return InvalidArgument("a batch has colors or textures, not both");
  return CheckSize("textures", batch.textures.size(),
                   batch.meshes * batch.faces.size() * options.n3mr_colors.texels());
}

}  // namespace

Status Validate(const Options& options) {
  const SoftRasOptions& soft = options.softras;
  TILEGRAD_TRY(Positive("SoftRas: sigma", soft.sigma));
  if (!(soft.dist_eps > 0 && soft.dist_eps < 0.5))
    return InvalidArgument("SoftRas: dist_eps is {}, but must lie in (0, 0.5)", soft.dist_eps);
  TILEGRAD_TRY(CheckPlanes("SoftRas", soft.near_plane, soft.far_plane));
  TILEGRAD_TRY(Positive("SoftRas: gamma", options.softras_colors.gamma));
  TILEGRAD_TRY(CheckResolution("SoftRas: resolution", options.softras_colors.resolution, 1, 64));
  TILEGRAD_TRY(Positive("N3MR: eps", options.n3mr.eps));
  TILEGRAD_TRY(CheckResolution("N3MR: resolution", options.n3mr_colors.resolution, 2, 32));
  return CheckPlanes("N3MR", options.n3mr.near_plane, options.n3mr.far_plane);
}

template <class T>
RendererT<T>::RendererT(const Workers& workers) : workers_(workers) {}
template <class T>
RendererT<T>::~RendererT() = default;

template <class T>
Status RendererT<T>::Render(const BatchT<T>& batch, const Options& options, const ImagesT<T>& out) {
  TILEGRAD_TRY(Validate(options));
  TILEGRAD_TRY(CheckBatch(batch));
  TILEGRAD_TRY(CheckTextures(batch, options));
  const std::size_t pixels = batch.cameras.size() * batch.pixels();
  TILEGRAD_TRY(CheckSize("alpha", out.alpha.size(), pixels));
  TILEGRAD_TRY(CheckSize("color", out.color.size(), batch.colored() ? 3 * pixels : 0));
  if (options.rule == Rule::kN3mr && options.n3mr.reduction == N3mrReduction::kBilinear &&
      batch.size < 2)
    return InvalidArgument("N3MR: the bilinear reduction needs images of two pixels a side");
  if (images_.size() < batch.cameras.size()) images_.resize(batch.cameras.size());
  workers_.ForParts(batch.cameras.size(), [&](std::size_t n, const Workers::Part& part) {
    images_[n].Render(batch, options, n, part, out.Image(n, batch.pixels()));
  });
  return {};
}

template <class T>
Status RendererT<T>::Backward(const BatchT<T>& batch, const Options& options,
                              const ImagesT<const T>& d_images, const GradientsT<T>& out) {
  TILEGRAD_TRY(CheckBatch(batch));
  const std::size_t pixels = batch.cameras.size() * batch.pixels();
  if (!d_images.alpha.empty())
    TILEGRAD_TRY(CheckSize("the adjoint of alpha", d_images.alpha.size(), pixels));
  if (!d_images.color.empty()) {
    TILEGRAD_TRY(
        CheckSize("the adjoint of color", d_images.color.size(), batch.colored() ? 3 * pixels : 0));
  }
  TILEGRAD_TRY(
      CheckSize("the gradient of positions", out.positions.size(), batch.positions.size()));
  if (!out.colors.empty())
    TILEGRAD_TRY(CheckSize("the gradient of colors", out.colors.size(), batch.colors.size()));
  if (!out.textures.empty())
    TILEGRAD_TRY(CheckSize("the gradient of textures", out.textures.size(), batch.textures.size()));
  if (images_.size() < batch.cameras.size())
    return InvalidArgument("{} images were rendered, but there are {} cameras", images_.size(),
                           batch.cameras.size());
  workers_.ForParts(batch.cameras.size(), [&](std::size_t n, const Workers::Part& part) {
    images_[n].Backward(batch, options, n, part, d_images.Image(n, batch.pixels()));
  });
  workers_.For(batch.meshes, [&](std::size_t b, std::size_t) {
    const std::size_t views = batch.views(), first = b * views;
    SumViews(views, b, batch.MeshOf(out.positions, first),
             [&](std::size_t n) { return images_[n].d_positions(); });
    if (!out.colors.empty()) {
      SumViews(views, b, batch.MeshOf(out.colors, first),
               [&](std::size_t n) { return images_[n].d_colors(); });
    }
    if (!out.textures.empty()) {
      SumViews(views, b, batch.TexturesOf(out.textures, first),
               [&](std::size_t n) { return images_[n].d_textures(); });
    }
  });
  return {};
}

template class RendererT<float>;
template class RendererT<double>;

}  // namespace tilegrad::rivals
