// SPDX-License-Identifier: Apache-2.0
#include "raster/culled.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "raster/culled_geometry.h"

namespace tilegrad::bench {
namespace {

using namespace plain;

void DrawFaces(const CulledScene& scene, CulledFrame* frame) {
  for (std::size_t f = 0; f < scene.faces.size() / 3; ++f) {
    const Triangle t = FaceAt(scene, f);
    const float area = Cross(t.v[1] - t.v[0], t.v[2] - t.v[0]);
    if (area == 0) continue;
    const float inverse = 1 / area;
    float z[3];
    for (int k = 0; k < 3; ++k) z[k] = scene.depth[static_cast<std::size_t>(t.id[k])];
    ForPixels(scene, BoxOf(scene, t, 0), [&](std::size_t pixel, Point p) {
      float w[3];
      if (!Weights(t, inverse, p, w)) return;
      const float depth = w[0] * z[0] + w[1] * z[1] + w[2] * z[2];
      if (!(depth < frame->depth[pixel])) return;
      frame->depth[pixel] = depth;
      frame->face_ids[pixel] = static_cast<std::int32_t>(f);
      std::copy(w, w + 3, &frame->weights[3 * pixel]);
    });
  }
}

void ShadePixels(const CulledScene& scene, CulledFrame* frame) {
  std::fill(frame->colors.begin(), frame->colors.end(), 0.0f);
  for (std::size_t pixel = 0; pixel < frame->face_ids.size(); ++pixel) {
    if (frame->face_ids[pixel] < 0) continue;
    const auto face = static_cast<std::size_t>(frame->face_ids[pixel]);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(scene.faces[3 * face + k]);
      for (std::size_t c = 0; c < 3; ++c) {
        frame->colors[3 * pixel + c] += frame->weights[3 * pixel + k] * scene.colors[3 * v + c];
      }
    }
  }
}

// Equations 5 and 6 at background pixels.
void SoftAlpha(const CulledScene& scene, CulledFrame* frame) {
  std::fill(frame->alpha.begin(), frame->alpha.end(), 1.0f);
  const float reach = Reach(scene), far = reach * reach;
  for (std::size_t f = 0; f < scene.faces.size() / 3; ++f) {
    const Triangle t = FaceAt(scene, f);
    ForPixels(scene, BoxOf(scene, t, reach), [&](std::size_t pixel, Point p) {
      if (frame->face_ids[pixel] >= 0) return;
      const Nearest nearest = NearestOf(t, p);
      if (nearest.squared > far) return;
      frame->alpha[pixel] *= 1 - std::exp(-nearest.squared / scene.delta);
    });
  }
  for (std::size_t pixel = 0; pixel < frame->alpha.size(); ++pixel) {
    if (frame->face_ids[pixel] < 0) frame->alpha[pixel] = 1 - frame->alpha[pixel];
  }
}

void Add(std::span<float> to, std::int32_t vertex, float x, float y) {
  to[2 * static_cast<std::size_t>(vertex)] += x;
  to[2 * static_cast<std::size_t>(vertex) + 1] += y;
}

void ColorBackward(const CulledScene& scene, const CulledFrame& frame, const CulledGradients& g) {
  ForPixels(scene, WholeImage(scene), [&](std::size_t pixel, Point p) {
    if (frame.face_ids[pixel] < 0) return;
    const Triangle t = FaceAt(scene, static_cast<std::size_t>(frame.face_ids[pixel]));
    const float* w = &frame.weights[3 * pixel];
    float d_w[3] = {};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = 3 * static_cast<std::size_t>(t.id[k]);
      for (std::size_t c = 0; c < 3; ++c) {
        d_w[k] += g.d_colors[3 * pixel + c] * scene.colors[v + c];
        g.d_vertex_colors[v + c] += w[k] * g.d_colors[3 * pixel + c];
      }
    }
    // w_k = N_k / (N_0 + N_1 + N_2), N_0 = (b - p) x (c - p) and so on.
    const float mean = d_w[0] * w[0] + d_w[1] * w[1] + d_w[2] * w[2];
    const float inverse = 1 / Cross(t.v[1] - t.v[0], t.v[2] - t.v[0]);
    float h[3];
    for (int k = 0; k < 3; ++k) h[k] = (d_w[k] - mean) * inverse;
    const Point a = t.v[0] - p, b = t.v[1] - p, c = t.v[2] - p;
    Add(g.d_ndc, t.id[0], -h[1] * c.y + h[2] * b.y, h[1] * c.x - h[2] * b.x);
    Add(g.d_ndc, t.id[1], h[0] * c.y - h[2] * a.y, -h[0] * c.x + h[2] * a.x);
    Add(g.d_ndc, t.id[2], -h[0] * b.y + h[1] * a.y, h[0] * b.x - h[1] * a.x);
  });
}

void AlphaBackward(const CulledScene& scene, const CulledFrame& frame, const CulledGradients& g) {
  const float reach = Reach(scene);
  for (std::size_t f = 0; f < scene.faces.size() / 3; ++f) {
    const Triangle t = FaceAt(scene, f);
    ForPixels(scene, BoxOf(scene, t, reach), [&](std::size_t pixel, Point p) {
      if (frame.face_ids[pixel] >= 0 || frame.alpha[pixel] == 0) return;
      const Nearest nearest = NearestOf(t, p);
      const float coverage = std::exp(-nearest.squared / scene.delta);
      if (1 - coverage <= 0) return;
      const float d_squared =
          g.d_alpha[pixel] * (1 - frame.alpha[pixel]) / (1 - coverage) * (-coverage / scene.delta);
      const int from = nearest.edge, to = (nearest.edge + 1) % 3;
      const Point e = t.v[to] - t.v[from], q = p - t.v[from];
      const Point r{q.x - nearest.along * e.x, q.y - nearest.along * e.y};
      const float near = -2 * d_squared * (1 - nearest.along), far = -2 * d_squared * nearest.along;
      Add(g.d_ndc, t.id[from], near * r.x, near * r.y);
      Add(g.d_ndc, t.id[to], far * r.x, far * r.y);
    });
  }
}

}  // namespace

void CulledForward(const CulledScene& scene, const CulledParts& parts, CulledFrame* frame) {
  frame->Resize(static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height));
  std::fill(frame->face_ids.begin(), frame->face_ids.end(), -1);
  std::fill(frame->depth.begin(), frame->depth.end(), std::numeric_limits<float>::max());
  DrawFaces(scene, frame);
  if (parts.color) ShadePixels(scene, frame);
  if (parts.alpha) SoftAlpha(scene, frame);
}

void CulledBackward(const CulledScene& scene, const CulledParts& parts, const CulledFrame& frame,
                    const CulledGradients& gradients) {
  if (parts.color) ColorBackward(scene, frame, gradients);
  if (parts.alpha) AlphaBackward(scene, frame, gradients);
}

}  // namespace tilegrad::bench
