// SPDX-License-Identifier: Apache-2.0
// The honest yardstick: equations 1 to 6 as a careful but plain program has them. Scalar float, one
// thread, no tiles; but each face visits only the pixels of its own box (tight for the z-buffer,
// widened for alpha to where exp(-d^2 / delta) = 2^-25 no longer changes a float 1 - A), and alpha
// is computed for background pixels only. Compiled for the very machine (-O3 -march=native).
// It starts from projected vertices; the renderer it is compared with projects them itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tilegrad::bench {

// One image. Screen-linear interpolation of three vertex colours.
struct CulledScene {
  int width = 0, height = 0;
  float delta = 0;                      // equation 5, NDC
  std::span<const float> ndc;           // [V,2] x right, y up, the image spans [-1, 1]
  std::span<const float> depth;         // [V] > 0, smaller is nearer
  std::span<const std::int32_t> faces;  // [F,3]
  std::span<const float> colors;        // [V,3]
};

struct CulledParts {
  bool color = true, alpha = true;  // alpha needs the face ids, which are always made
};

// Images are [H,W], interleaved where they have channels.
struct CulledFrame {
  std::vector<std::int32_t> face_ids;
  std::vector<float> depth, weights, colors, alpha;  // weights [H,W,3] barycentric

  void Resize(std::size_t pixels) {
    face_ids.resize(pixels);
    depth.resize(pixels);
    alpha.resize(pixels);
    weights.resize(3 * pixels);
    colors.resize(3 * pixels);
  }
};

struct CulledGradients {
  std::span<const float> d_colors;   // [H,W,3]
  std::span<const float> d_alpha;    // [H,W]
  std::span<float> d_ndc;            // [V,2] added to
  std::span<float> d_vertex_colors;  // [V,3] added to
};

void CulledForward(const CulledScene& scene, const CulledParts& parts, CulledFrame* frame);
void CulledBackward(const CulledScene& scene, const CulledParts& parts, const CulledFrame& frame,
                    const CulledGradients& gradients);

}  // namespace tilegrad::bench
