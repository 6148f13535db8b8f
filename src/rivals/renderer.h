// SPDX-License-Identifier: Apache-2.0
// Renders batches with the rivals of the paper's section 5.1, for training: alpha and colours from
// meshes and cameras, with gradients.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "rivals/n3mr_color.h"
#include "rivals/softras_color.h"
#include "tilegrad/camera.h"
#include "tilegrad/status.h"

namespace tilegrad::rivals {

enum class Rule { kSoftRas, kN3mr };

struct Options {
  Rule rule = Rule::kSoftRas;
  SoftRasOptions softras = {};
  SoftRasColors softras_colors = {};
  N3mrOptions n3mr = {};
  N3mrColors n3mr_colors = {};

  // Texels per face, and whether they are the colours of its corners; else all have the face's
  // colour, the mean of its corners'.
  std::size_t texels() const { return rule == Rule::kSoftRas ? kSoftTexels : n3mr_colors.texels(); }
  bool corner_colors() const { return rule == Rule::kSoftRas; }
};

// InvalidArgument names the first number out of range.
Status Validate(const Options& options);

// Images of meshes with shared faces; cameras [b * views, (b + 1) * views) see mesh b.
template <class T>
struct BatchT {
  std::span<const T> positions;         // [B,V,3] world
  std::span<const T> colors;            // [B,V,3]; empty, without textures too: alpha only
  std::span<const std::int32_t> faces;  // [F,3] indices in [0, V)
  std::span<const CameraT<T>> cameras;  // [N], N = B * views
  std::size_t meshes = 0;               // B
  int size = 0;                         // pixels a side of the square images
  std::span<const T> textures{};        // [B,F,texels,3], replaces colors; N3MR only

  bool colored() const { return !colors.empty() || !textures.empty(); }
  // The part of `numbers`, shaped like textures, that belongs to image n's mesh.
  template <class U>
  std::span<U> TexturesOf(std::span<U> numbers, std::size_t n) const {
    const std::size_t count = numbers.size() / meshes;
    return numbers.subspan(n / views() * count, count);
  }

  std::size_t vertices() const { return meshes == 0 ? 0 : positions.size() / (3 * meshes); }
  std::size_t views() const { return meshes == 0 ? 0 : cameras.size() / meshes; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  }
  // The numbers [V,3] of image n's mesh.
  template <class U>
  std::span<U> MeshOf(std::span<U> numbers, std::size_t n) const {
    // Image n exists, so there are views.
    return numbers.subspan(n / views() * 3 * vertices(),  // NOLINT(clang-analyzer-core.DivideZero)
                           3 * vertices());
  }
};

// For a batch or one of its images; as an adjoint, empty means zero.
template <class T>
struct ImagesT {
  std::span<T> alpha;  // [N,size,size]
  std::span<T> color;  // [N,3,size,size]; empty if the batch has no colours

  ImagesT Image(std::size_t n, std::size_t pixels) const {
    return {alpha.empty() ? alpha : alpha.subspan(n * pixels, pixels),
            color.empty() ? color : color.subspan(3 * n * pixels, 3 * pixels)};
  }
};

// For a batch: [B,V,3] each.
template <class T>
struct GradientsT {
  std::span<T> positions;
  std::span<T> colors;      // empty: not requested
  std::span<T> textures{};  // as BatchT::textures; empty: not requested
};

template <class T>
class ImageStateT;

// float: the fast code. double: SoftRas uses its scalar reference, for proofs. One call at a time;
// memory grows to the largest batch and is reused. The same bits for any number of workers.
template <class T>
class RendererT {
 public:
  explicit RendererT(const Workers& workers);
  ~RendererT();

  // Errors: arrays that do not match, an index out of range, options out of range.
  Status Render(const BatchT<T>& batch, const Options& options, const ImagesT<T>& out);
  // Gradients of the last Render, with the same batch and options and unchanged arrays. Overwrites
  // `out` with sums over each mesh's views, in order.
  Status Backward(const BatchT<T>& batch, const Options& options, const ImagesT<const T>& d_images,
                  const GradientsT<T>& out);

 private:
  const Workers& workers_;
  std::vector<ImageStateT<T>> images_;
};
using Renderer = RendererT<float>;

extern template class RendererT<float>;
extern template class RendererT<double>;

}  // namespace tilegrad::rivals
