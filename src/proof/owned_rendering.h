// SPDX-License-Identifier: Apache-2.0
// The images of an owned scene and the gradients of the sum of images times cotangents, by the
// Engine and by the reference.
#pragma once

#include <cstdint>
#include <span>

#include "proof/owned_scene.h"
#include "render/engine.h"
#include "render/reference.h"

namespace tilegrad {

template <class T>
struct OwnedRendering {
  FrameImagesT<T> frame;
  OwnedScene<T> d;  // gradients
};

inline Status RenderOwned(OwnedScene<float>& scene, const RenderOptions& options,
                          const Outputs& request, const OwnedCotangents<float>& d_frame,
                          const Workers& workers, OwnedRendering<float>* out) {
  Engine engine(workers);
  const Scene view = scene.View();
  TILEGRAD_TRY(engine.Render({&view, 1}, options, request, &out->frame));
  OwnedGradients<float> gradients(scene);
  const SceneGradients d_scene = gradients.View();
  TILEGRAD_TRY(engine.Backward({&view, 1}, options, out->frame, d_frame.View(), {&d_scene, 1}));
  out->d = gradients.d;
  return {};
}

// With visibility given as ids of the scene's faces [H,W].
template <class T>
OwnedScene<T> OwnedRefBackward(OwnedScene<T>& scene, const RenderOptions& options,
                               const OwnedCotangents<T>& d_frame,
                               std::span<const std::int32_t> face_ids) {
  OwnedGradients<T> gradients(scene);
  ReferenceRenderBackward<T>(scene.View(), options, face_ids, d_frame.View(), gradients.View());
  return gradients.d;
}

template <class T>
OwnedRendering<T> RenderOwnedRef(OwnedScene<T>& scene, const RenderOptions& options,
                                 const Outputs& request, const OwnedCotangents<T>& d_frame,
                                 std::span<const std::int32_t> face_ids) {
  OwnedRendering<T> out;
  ReferenceRender<T>(scene.View(), options, request, face_ids, &out.frame);
  out.d = OwnedRefBackward<T>(scene, options, d_frame, face_ids);
  return out;
}

}  // namespace tilegrad
