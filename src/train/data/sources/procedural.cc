// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/rng.h"
#include "scene/shapes.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

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

using glm::vec2;
using glm::vec3;
using glm::vec4;

// Four legs under a plate of half-width w and half-depth d, from the floor to `height`; they may
// splay outwards.
void Legs(Dice& dice, Assembly& out, float w, float d, float height, vec4 color) {
  const float radius = dice.Between(0.015, 0.04), splay = dice.Between(0, 0.06);
  const bool square = dice.Chance(0.5);
  for (int k = 0; k < 4; ++k) {
    const float sx = k % 2 ? 1.0f : -1.0f, sz = k / 2 ? 1.0f : -1.0f;
    const vec3 top(sx * (w - radius), height, sz * (d - radius));
    if (square) {
      out.Box({top.x, height / 2, top.z}, {2 * radius, height, 2 * radius}, color);
    } else {
      out.Rod({top.x + sx * splay, 0, top.z + sz * splay}, top, 0.7f * radius, radius, color);
    }
  }
}

// A column on a foot: the other way to carry a plate.
void Pedestal(Dice& dice, Assembly& out, float reach, float height, vec4 color) {
  const float foot = reach * dice.Between(0.55, 0.9);
  out.Rod({0, 0, 0}, {0, 0.04f, 0}, foot, 0.8f * foot, color);
  const float radius = dice.Between(0.025, 0.06);
  out.Rod({0, 0.03f, 0}, {0, height, 0}, radius, radius, color);
}

void ChairBack(Dice& dice, Assembly& out, float w, float d, float seat, float height, vec4 frame,
               vec4 cushion) {
  const float lean = -dice.Between(0, 0.1), z = -d + 0.025f;
  const int kind = dice.Below(3);
  if (kind == 0) {  // a panel
    out.TaperedBox({0, seat + height / 2, z}, {2 * w, height, 0.05f}, {dice.Between(0.7, 1), 1},
                   {0, lean}, cushion);
    return;
  }
  for (float side : {-1.0f, 1.0f}) {
    const float x = side * (w - 0.02f);
    out.Rod({x, seat, z}, {x, seat + height, z + lean}, 0.02f, 0.02f, frame);
  }
  const int bars = 2 + dice.Below(3);
  for (int i = 0; i < bars; ++i) {
    const float t = kind == 1 ? (static_cast<float>(i) + 1) / static_cast<float>(bars)
                              : (static_cast<float>(i) + 0.5f) / static_cast<float>(bars);
    if (kind == 1) {  // rungs
      out.Box({0, seat + t * height - 0.03f, z + t * lean}, {2 * w, 0.07f, 0.03f}, cushion);
    } else {  // upright slats below a rail
      const float x = (2 * t - 1) * w;
      out.Rod({x, seat, z}, {x, seat + height, z + lean}, 0.012f, 0.012f, frame);
    }
  }
  if (kind == 2) out.Box({0, seat + height, z + lean}, {2 * w, 0.08f, 0.04f}, cushion);
}

Mesh Chair(Dice& dice) {
  Assembly out;
  const float w = dice.Between(0.19, 0.3), d = dice.Between(0.19, 0.28);
  const float seat = dice.Between(0.35, 0.52), thick = dice.Between(0.03, 0.12);
  const float back = dice.Between(0.3, 0.6);
  const vec4 frame = dice.Chance(0.5) ? dice.Wood() : dice.Metal(), cushion = dice.AnyColor();
  if (dice.Chance(0.75)) {
    Legs(dice, out, w, d, seat, frame);
  } else {
    Pedestal(dice, out, w, seat, frame);
  }
  out.TaperedBox({0, seat + thick / 2, 0}, {2 * w, thick, 2 * d}, {dice.Between(0.9, 1), 1}, {},
                 cushion);
  ChairBack(dice, out, w, d, seat + thick, back, frame, cushion);
  if (dice.Chance(0.4)) {
    const float arm = seat + thick + dice.Between(0.14, 0.22);
    for (float side : {-1.0f, 1.0f}) {
      const float x = side * w;
      out.Box({x, arm, 0}, {0.06f, 0.035f, 2 * d}, frame);
      out.Rod({x, seat, d - 0.03f}, {x, arm, d - 0.03f}, 0.018f, 0.018f, frame);
    }
  }
  return out.Take();
}

Mesh Table(Dice& dice) {
  Assembly out;
  const float w = dice.Between(0.3, 0.75), d = dice.Chance(0.3) ? w : dice.Between(0.25, 0.45);
  const float height = dice.Between(0.3, 0.75), thick = dice.Between(0.025, 0.07);
  const vec4 top = dice.AnyColor(), legs = dice.Chance(0.5) ? top : dice.AnyColor();
  const bool round = dice.Chance(0.35);
  const int kind = dice.Below(4);
  const float reach = round ? 0.68f * w : w, reach_z = round ? 0.68f * w : d;
  if (kind == 0) {
    Pedestal(dice, out, round ? w : d, height, legs);
  } else if (kind == 1 && !round) {  // two side panels
    for (float side : {-1.0f, 1.0f})
      out.Box({side * (w - 0.06f), height / 2, 0}, {0.04f, height, 1.8f * d}, legs);
  } else {
    Legs(dice, out, reach, reach_z, height, legs);
  }
  if (kind != 0 && dice.Chance(0.35))
    out.Box({0, height * dice.Between(0.2, 0.5), 0}, {1.9f * reach, 0.02f, 1.9f * reach_z}, top);
  if (round) {
    out.Rod({0, height, 0}, {0, height + thick, 0}, w, w, top);
  } else {
    out.Box({0, height + thick / 2, 0}, {2 * w, thick, 2 * d}, top);
    if (kind >= 2 && dice.Chance(0.4)) {  // drawers
      out.Box({0, height - 0.06f, 0}, {1.8f * w, 0.12f, 1.8f * d}, legs);
    }
  }
  return out.Take();
}

void Shade(Dice& dice, Assembly& out, vec3 at, vec4 color) {
  const float radius = dice.Between(0.12, 0.24), height = dice.Between(0.14, 0.3);
  switch (dice.Below(3)) {
    case 0:
      return out.Ball(at, vec3(radius), color);
    case 1:
      return out.Rod(at - vec3(0, height / 2, 0), at + vec3(0, height / 2, 0), radius,
                     radius * dice.Between(0.3, 0.7), color);
    default:
      return out.Rod(at - vec3(0, height / 2, 0), at + vec3(0, height / 2, 0), 0.8f * radius,
                     0.8f * radius, color);
  }
}

Mesh Lamp(Dice& dice) {
  Assembly out;
  const vec4 metal = dice.Chance(0.6) ? dice.Metal() : dice.AnyColor(), shade = dice.Paint();
  const float height = dice.Between(0.35, 1.1);
  const float foot = dice.Between(0.1, 0.2);
  if (dice.Chance(0.3)) {  // a vase for a body
    out.Ball({0, height / 2, 0}, {foot, height / 2, foot}, metal);
  } else {
    out.Rod({0, 0, 0}, {0, 0.05f, 0}, foot, foot * dice.Between(0.4, 1), metal);
    const float radius = dice.Between(0.012, 0.03);
    out.Rod({0, 0.02f, 0}, {0, height, 0}, radius, radius, metal);
  }
  if (dice.Chance(0.3)) {  // an arm that holds the shade aside
    const vec3 tip(0, height + dice.Between(-0.1, 0.2), dice.Between(0.2, 0.4));
    out.Rod({0, height - 0.01f, 0}, tip, 0.015f, 0.015f, metal);
    Shade(dice, out, tip, shade);
  } else {
    Shade(dice, out, {0, height + 0.05f, 0}, shade);
  }
  return out.Take();
}

Mesh Car(Dice& dice) {
  Assembly out;
  const float w = dice.Between(0.17, 0.22), length = dice.Between(0.75, 1.1);
  const float low = dice.Between(0.05, 0.1), body = dice.Between(0.12, 0.2);
  const float roof = dice.Between(0.1, 0.17), wheel = dice.Between(0.065, 0.09);
  const vec4 paint = dice.Paint(), glass(0.16f, 0.2f, 0.25f, 1), tyre(0.09f, 0.09f, 0.1f, 1);
  const float deck = low + body, half = length / 2;
  out.TaperedBox({0, low + body / 2, 0}, {2 * w, body, length}, {0.93f, dice.Between(0.9, 1)}, {},
                 paint);
  const int kind = dice.Below(3);  // saloon, van, pick-up
  const float cabin = length * (kind == 0 ? dice.Between(0.45, 0.6) : kind == 1 ? 0.82f : 0.32f);
  const float at = kind == 0 ? -0.04f : kind == 1 ? -0.06f * length : 0.1f * length;
  const vec2 taper(0.85f, kind == 1 ? 0.93f : dice.Between(0.6, 0.75));
  const float tall = kind == 1 ? 1.4f * roof : roof;
  out.TaperedBox({0, deck + tall / 2, at}, {1.84f * w, tall, cabin}, taper, {}, glass);
  out.Box({0, deck + tall, at}, {1.84f * w * taper.x, 0.02f, cabin * taper.y}, paint);
  for (float side : {-1.0f, 1.0f}) {
    for (float end : {-1.0f, 1.0f}) {
      const vec3 hub(side * (w - 0.03f), wheel, end * 0.31f * length);
      out.Rod(hub, hub + vec3(side * 0.05f, 0, 0), wheel, wheel, tyre);
      out.Rod(hub, hub + vec3(side * 0.055f, 0, 0), wheel / 2, wheel / 2, dice.Metal());
    }
    out.Box({side * 0.7f * w, low + 0.65f * body, half - 0.01f}, {0.07f, 0.05f, 0.04f},
            {1, 0.95f, 0.7f, 1});
    out.Box({side * 0.7f * w, low + 0.65f * body, -half + 0.01f}, {0.07f, 0.05f, 0.04f},
            {0.8f, 0.1f, 0.1f, 1});
  }
  return out.Take();
}

// A flat wing from the fuselage to (x, y), swept back; the mirror image comes with it.
void Wings(Assembly& out, vec3 root, float span, float chord, float tip_chord, float sweep,
           float rise, vec4 color) {
  for (float side : {-1.0f, 1.0f}) {
    Mesh part = Box({0, 0, 0}, {1, 0.025f, 1});
    for (vec3& p : part.positions) {
      const float t = p.x + 0.5f;  // 0 at the root
      const float c = chord + t * (tip_chord - chord);
      p = root + vec3(t * span * side, p.y + t * rise, p.z * c - t * sweep);
    }
    if (side < 0) {
      for (Face& face : part.faces) std::swap(face[1], face[2]);
    }
    out.Add(std::move(part), color);
  }
}

Mesh Plane(Dice& dice) {
  Assembly out;
  const vec4 hull = dice.Chance(0.4) ? vec4(0.9f, 0.9f, 0.92f, 1) : dice.Paint();
  const vec4 wing = dice.Chance(0.5) ? hull : dice.AnyColor(), tail = dice.Paint();
  const float r = dice.Between(0.05, 0.09), half = dice.Between(0.4, 0.55);
  out.Rod({0, 0, -0.5f * half}, {0, 0, 0.75f * half}, r, r, hull);
  out.Rod({0, 0.3f * r, -half}, {0, 0, -0.5f * half}, 0.25f * r, r, hull);
  out.Ball({0, 0, 0.75f * half}, {r, r, 0.25f * half}, hull);
  const float span = dice.Between(0.35, 0.6), chord = dice.Between(0.14, 0.26);
  const float sweep = dice.Between(0, 0.3), rise = dice.Between(-0.02, 0.08);
  const float height = dice.Chance(0.3) ? 0.8f * r : -0.4f * r;
  Wings(out, {0, height, dice.Between(0, 0.12)}, span, chord, chord * dice.Between(0.35, 0.9),
        sweep, rise, wing);
  const bool high_tail = dice.Chance(0.25);
  const float fin = dice.Between(0.14, 0.22);
  out.TaperedBox({0, 0.2f * r + fin / 2, -half + 0.07f}, {0.02f, fin, 0.14f}, {1, 0.6f},
                 {0, -0.06f}, tail);
  Wings(out, {0, high_tail ? fin : 0.3f * r, -half + 0.06f}, 0.36f * span, 0.12f, 0.07f,
        0.3f * sweep, 0, tail);
  const int engines = dice.Below(3);
  for (int i = 0; i < engines; ++i) {
    for (float side : {-1.0f, 1.0f}) {
      const float t = 0.3f + 0.3f * static_cast<float>(i), er = 0.5f * r;
      const vec3 at(side * t * span, height + t * rise - er, 0.1f - t * sweep);
      out.Rod(at - vec3(0, 0, 0.07f), at + vec3(0, 0, 0.08f), 0.8f * er, er, dice.Metal());
    }
  }
  return out.Take();
}

struct Family {
  const char* name;
  Mesh (*make)(Dice&);
};
constexpr Family kFamilies[] = {
    {"car", Car}, {"chair", Chair}, {"lamp", Lamp}, {"plane", Plane}, {"table", Table}};

class Procedural : public ModelSource {
 public:
  Procedural(int per_class, std::uint64_t seed)
      : ModelSource({.name = "procedural",
                     .credits = {fmt::format("Parametric models of tilegrad, seed {}.", seed)}}),
        per_class_(per_class),
        seed_(seed) {
    for (const std::string& name : ProceduralClasses()) {
      for (int i = 0; i < per_class; ++i) {
        const std::string id = fmt::format("{}-{:05}", name, i);
        entries_.push_back({name, id, id, "Apache-2.0", "tilegrad", "built in"});
      }
    }
  }
  Result<SourceModel> Load(std::size_t entry) const override {
    const auto n = static_cast<std::size_t>(per_class_);
    return SourceModel{ProceduralModel(static_cast<int>(entry / n), entry % n, seed_)};
  }

 private:
  int per_class_;
  std::uint64_t seed_;
};

}  // namespace

const std::vector<std::string>& ProceduralClasses() {
  static const std::vector<std::string> classes = [] {
    std::vector<std::string> out;
    for (const Family& family : kFamilies) out.emplace_back(family.name);
    return out;
  }();
  return classes;
}

Mesh ProceduralModel(int class_index, std::uint64_t index, std::uint64_t seed) {
  Dice dice(Rng(Mix64(seed) + static_cast<std::uint64_t>(class_index), index));
  return kFamilies[class_index].make(dice);
}

std::unique_ptr<ModelSource> ProceduralSource(int per_class, std::uint64_t seed) {
  return std::make_unique<Procedural>(per_class, seed);
}

}  // namespace tilegrad::train
