// SPDX-License-Identifier: Apache-2.0
// The differentiable renderer: scenes in, images out; gradients of images in, gradients of scenes
// out.
//
//   tilegrad::Renderer renderer;
//   tilegrad::Frame frame;
//   Status status = renderer.Render({&scene, 1}, {.width = 256, .height = 256}, {}, &frame);
//   frame.images().color, frame.images().alpha                       // views into the frame
//   status = renderer.Backward(frame, {.alpha = d_alpha}, {&d_scene, 1});
//
// Nothing here prints, aborts or throws: every error, including out of memory, is a Status.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "tilegrad/abi.h"
#include "tilegrad/options.h"
#include "tilegrad/scene.h"
#include "tilegrad/status.h"

namespace tilegrad::inline v0 {

// The images of N scenes: planar, row 0 on top. Images that were not requested are empty.
template <class T>
struct ImagesT {
  int count = 0, height = 0, width = 0;
  int channels = 0;                        // of attributes
  std::span<const std::int32_t> face_ids;  // [N,H,W] index of the scene's face, -1: background
  std::span<const T> color;                // [N,3,H,W]; 0 at background pixels
  std::span<const T> alpha;                // [N,H,W]; 1 where there is a face
  std::span<const T> attributes;           // [N,C,H,W]; 0 at background pixels
  std::span<const T> depth;                // [N,H,W] world units; +infinity at background pixels
  std::span<const T> normals;              // [N,3,H,W] used for shading: world; unit, or 0
  std::span<const T> uv;                   // [N,2,H,W]
  std::span<const T> barycentrics;         // [N,2,H,W] weights of corners 1 and 2 of the face
  double alpha_error_bound = 0;  // no alpha differs from equation 6 by more; infinite with
                                 // AlphaRule::kPaper
};

// dL/d(image), in the shapes of ImagesT; an empty span means zero. NaN and infinity are errors.
template <class T>
struct FrameGradientsT {
  std::span<const T> color{}, alpha{}, attributes{}, normals{}, uv{};
  std::span<const T> depth{};  // with Interpolation::kPerspective; background pixels are not read
};

template <class T>
class TILEGRAD_API RendererT;
struct RendererAccess;  // internal

// The result of Render: images, the views of the scenes, and what Backward needs. The next Render
// into it reuses its memory: rendering the same sizes again allocates nothing.
template <class T>
class TILEGRAD_API FrameT {
 public:
  FrameT() noexcept;
  ~FrameT();
  FrameT(FrameT&&) noexcept;
  FrameT& operator=(FrameT&&) noexcept;

  // Views into this frame, valid until the next Render into it or its destruction. Empty before the
  // first Render and after a failed one.
  const ImagesT<T>& images() const { return images_; }

 private:
  friend class RendererT<T>;
  friend struct RendererAccess;
  struct Impl;
  std::unique_ptr<Impl> impl_;
  ImagesT<T> images_;
};

struct RendererOptions {
  // 1..1024; 0: one per core available to the process; 1: only the caller's thread. Uses fewer
  // where the system refuses to create more.
  int threads = 0;
};

enum class GradientMode {
  kOverwrite,
  kAdd,  // adds to what arrays and records hold (a Camera, Surface or Light does not start as 0);
         // leaves them unchanged on an error
};

// Owns threads, which start with the first call, and scratch memory, which it reuses: rendering
// the same sizes again allocates nothing. There is no global state: renderers are independent.
// Not thread-safe: one call at a time per renderer. The same input gives the same bits for any
// number of threads.
//
// T = float is the engine. T = double is its scalar reference, for gradient checks: it tests every
// face at every pixel, takes alpha over all faces whatever max_alpha_error allows, and allocates
// memory in every call; numbers must be in float's range.
template <class T>
class TILEGRAD_API RendererT {
 public:
  explicit RendererT(const RendererOptions& options = {}) noexcept;
  ~RendererT();
  RendererT(RendererT&&) noexcept;
  RendererT& operator=(RendererT&&) noexcept;

  // Renders a batch of scenes, each with its own mesh and camera, all at one size (call once per
  // size). Errors: an array of the wrong size (names scene, array, expected and actual size), an
  // index out of range, a number that is not finite (names scene, array, index), options out of
  // range, scenes with different parts, out of memory.
  Status Render(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                const Outputs& outputs, FrameT<T>* frame);

  // The gradients of sum(d_frame * images) with respect to the scenes of `frame`, whose arrays must
  // be unchanged since Render. `d_scenes`: one per scene. Any renderer will do, not only the one
  // that rendered. Errors: those of Render, a gradient of the wrong size, a gradient of alpha when
  // alpha was not rendered, a gradient that overflows.
  Status Backward(const FrameT<T>& frame, const FrameGradientsT<T>& d_frame,
                  std::span<const SceneGradientsT<T>> d_scenes,
                  GradientMode mode = GradientMode::kOverwrite);

 private:
  friend struct RendererAccess;
  struct Impl;
  Status Start();
  void DropAfter(const Status& status);

  RendererOptions options_;
  std::unique_ptr<Impl> impl_;  // null before the first call
};

using Images = ImagesT<float>;
using FrameGradients = FrameGradientsT<float>;
using Frame = FrameT<float>;
using Renderer = RendererT<float>;

extern template class FrameT<float>;
extern template class FrameT<double>;
extern template class RendererT<float>;
extern template class RendererT<double>;

}  // namespace tilegrad::inline v0
