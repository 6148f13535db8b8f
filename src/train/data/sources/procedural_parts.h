// SPDX-License-Identifier: Apache-2.0
// The bricks of procedural.cc: coloured parts put together to one mesh, and random choices.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "base/rng.h"
#include "scene/shapes.h"

namespace tilegrad::train {

// Random choices of one model.
class Dice {
 public:
  explicit Dice(Rng rng) : rng_(rng) {}
  float Between(double low, double high) { return static_cast<float>(rng_.Uniform(low, high)); }
  bool Chance(double p) { return rng_.Uniform() < p; }
  int Below(int n) { return static_cast<int>(rng_.Below(static_cast<std::uint64_t>(n))); }

  // Hue, saturation, value in [0, 1].
  static glm::vec4 Hsv(float h, float s, float v) {
    const auto channel = [&](float shift) {
      const float k = std::fmod(shift + 6 * h, 6.0f);
      return v - v * s * std::clamp(std::min(k, 4 - k), 0.0f, 1.0f);
    };
    return {channel(5), channel(3), channel(1), 1};
  }
  glm::vec4 Paint() { return Hsv(Between(0, 1), Between(0.25, 0.85), Between(0.45, 0.95)); }
  glm::vec4 Wood() { return Hsv(Between(0.05, 0.11), Between(0.35, 0.7), Between(0.35, 0.8)); }
  glm::vec4 Metal() { return Hsv(Between(0.55, 0.65), Between(0, 0.1), Between(0.3, 0.8)); }
  glm::vec4 AnyColor() {
    const int kind = Below(4);
    return kind == 0 ? Metal() : kind == 1 ? Wood() : Paint();
  }

 private:
  Rng rng_;
};

class Assembly {
 public:
  void Add(Mesh part, glm::vec4 color) {
    SetColor(part, color);
    Append(mesh_, part);
  }
  void Box(glm::vec3 centre, glm::vec3 size, glm::vec4 color) {
    Add(tilegrad::Box(centre, size), color);
  }
  // A box whose top is scaled by `taper` and then moved by `lean` (x, z).
  void TaperedBox(glm::vec3 centre, glm::vec3 size, glm::vec2 taper, glm::vec2 lean,
                  glm::vec4 color) {
    Mesh part = tilegrad::Box(centre, size);
    for (glm::vec3& p : part.positions) {
      if (p.y <= centre.y) continue;
      p.x = centre.x + taper.x * (p.x - centre.x) + lean.x;
      p.z = centre.z + taper.y * (p.z - centre.z) + lean.y;
    }
    Add(std::move(part), color);
  }
  // A rod from a to b; radii at its ends.
  void Rod(glm::vec3 a, glm::vec3 b, float radius_a, float radius_b, glm::vec4 color) {
    const glm::vec3 d = b - a;
    const float length = std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    const glm::vec3 y = d / length;
    // Any two axes across y, right-handed: x from the world axis that is least along y.
    const glm::vec3 w = std::abs(y.x) < 0.9f ? glm::vec3(1, 0, 0) : glm::vec3(0, 0, 1);
    glm::vec3 z(w.y * y.z - w.z * y.y, w.z * y.x - w.x * y.z, w.x * y.y - w.y * y.x);
    z /= std::sqrt(z.x * z.x + z.y * z.y + z.z * z.z);
    const glm::vec3 x(y.y * z.z - y.z * z.y, y.z * z.x - y.x * z.z, y.x * z.y - y.y * z.x);
    Mesh part = Frustum(glm::vec3(0), radius_a, radius_b, length, 16);
    Transform(part, {x, y, z}, 0.5f * (a + b));
    Add(std::move(part), color);
  }
  void Ball(glm::vec3 centre, glm::vec3 radii, glm::vec4 color) {
    Mesh part = UvSphere(1, 10, 16);
    Transform(part, {glm::vec3(radii.x, 0, 0), {0, radii.y, 0}, {0, 0, radii.z}}, centre);
    Add(std::move(part), color);
  }
  Mesh Take() { return std::move(mesh_); }

 private:
  Mesh mesh_;
};

}  // namespace tilegrad::train
