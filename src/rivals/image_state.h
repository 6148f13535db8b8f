// SPDX-License-Identifier: Apache-2.0
// One image of a batch: what it keeps between its forward and its backward pass, and memory for
// both.
#pragma once

#include <span>

#include "base/aligned.h"
#include "base/parallel.h"
#include "rivals/batch.h"
#include "rivals/n3mr_color.h"
#include "rivals/softras_color.h"

namespace tilegrad::rivals {

// T: float or double.
template <class T>
class ImageStateT {
 public:
  // `out`: of this image, number n of the batch. Options and batch are checked.
  void Render(const BatchT<T>& batch, const Options& options, std::size_t n,
              const Workers::Part& part, const ImagesT<T>& out);
  // Sets d_positions and, if the batch has colours, d_colors.
  void Backward(const BatchT<T>& batch, const Options& options, std::size_t n,
                const Workers::Part& part, const ImagesT<const T>& d_images);

  std::span<const T> d_positions() const { return d_positions_; }  // [V,3]
  std::span<const T> d_colors() const { return d_colors_; }        // [V,3]
  std::span<const T> d_textures() const { return d_textures_; }    // [F,texels,3]

 private:
  void Project(const BatchT<T>& batch, std::size_t n);
  void ProjectAdjoint(const BatchT<T>& batch, std::size_t n);
  void SetTextures(const BatchT<T>& batch, const Options& options, std::size_t n);
  void SetColorGradients(const BatchT<T>& batch, const Options& options);

  void SoftRas(const Options& options, int size, const Workers::Part& part, const ImagesT<T>& out);
  void SoftRasAdjoint(const Options& options, int size, const Workers::Part& part,
                      const ImagesT<const T>& d_images);
  void N3mr(const Options& options, int size, const Workers::Part& part, const ImagesT<T>& out);
  void N3mrAdjoint(const Options& options, const Workers::Part& part,
                   const ImagesT<const T>& d_images);

  AlignedVector<T> points_, d_points_, d_positions_, d_colors_;  // [V,3]
  AlignedVector<T> corners_, d_corners_;                         // [F,3,3]
  AlignedVector<T> textures_, d_textures_;                       // [F,texels,3]
  SoftRasImage softras_;                                         // float
  SoftRasColorImage softras_color_;                              // float
  N3mrImageT<T> n3mr_;
  N3mrPlanesT<T> n3mr_planes_;
};

extern template class ImageStateT<float>;
extern template class ImageStateT<double>;

}  // namespace tilegrad::rivals
