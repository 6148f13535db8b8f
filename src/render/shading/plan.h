// SPDX-License-Identifier: Apache-2.0
// Plans which steps to compute, once per batch, from the arrays of its scenes and the requested
// images and gradients; every stage consults the plan, and it can be printed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "render/pipeline/records.h"
#include "render/scene_fields.h"

namespace tilegrad {

// A subset of the varyings, and their channels, in order.
struct VaryingSet {
  std::array<bool, kVaryings> has = {};
  Rate rate = Rate::kVertex;  // of the array that holds them
  int user_channels = 0;

  bool operator[](Varying v) const { return has[static_cast<std::size_t>(v)]; }
  bool& operator[](Varying v) { return has[static_cast<std::size_t>(v)]; }
  int width(Varying v) const;  // channels
  int first(Varying v) const;  // its first channel
  int channels() const;        // of all
  bool operator==(const VaryingSet&) const = default;
};

// The arrays and model of a batch of scenes, which must agree.
struct SceneParts {
  ShadingModel shading;
  std::array<bool, kVaryings> has = {};    // streams present
  std::array<Rate, kVaryings> rates = {};  // of them
  bool textures = false, surfaces = false;
  bool bilinear = false;  // some texture is filtered: uvs have a gradient
  bool trilinear = false;
  bool may_overflow = false;  // some number is so large that images may overflow float
  int user_channels = 0;

  bool operator[](Varying v) const { return has[static_cast<std::size_t>(v)]; }
  bool lit() const { return shading.lighting != Lighting::kNone; }
  bool uses_lights() const { return UsesLights(shading); }
};

// Steps for the pixels of a run.
struct ShadeSteps {
  bool color = false, texture = false, level = false, normal = false, light = false;
  bool highlight = false;
  bool turn = false;  // flip normals of faces seen from behind

  bool any() const { return color || texture || normal; }
};

// `color`: the image is requested, or has a cotangent.
struct ForwardPlan {
  SceneParts parts;
  Outputs request;
  VaryingSet varyings;
  ShadeSteps steps;
  // Attributes are images themselves: the colours, or the user's channels. Nothing to pack.
  bool colors_only = false, user_only = false;

  bool staged() const {
    return (varyings.channels() > 0 || steps.color) && !colors_only && !user_only;
  }
};

// The cotangents and requested gradients of a batch, in any of its scenes.
struct GradientWishes {
  bool d_color = false, d_normals = false, d_uv = false, d_depth = false, d_user = false,
       d_alpha = false;
  std::array<bool, kVaryings> streams = {};
  bool camera = false, textures = false, surfaces = false, lights = false, sh = false;

  bool operator[](Varying v) const { return streams[static_cast<std::size_t>(v)]; }
};

struct BackwardPlan {
  SceneParts parts;
  GradientWishes wishes;
  VaryingSet pulled;      // varyings whose cotangent is needed
  VaryingSet recomputed;  // varyings needed for that; may equal `pulled`
  ShadeSteps steps;       // of the recomputation
  // Targets of the colour adjoint.
  bool to_colors = false, to_texture = false, to_uv = false, to_light = false, to_normal = false,
       to_eye = false, to_light_vectors = false, to_surfaces = false;
  bool geometry = false;
  bool colors_only = false, user_only = false;  // as in ForwardPlan

  // Whether pixels must be visited for more than alpha.
  bool staged() const;
};

ForwardPlan PlanForward(const SceneParts& parts, const Outputs& request);
BackwardPlan PlanBackward(const SceneParts& parts, GradientWishes wishes);

// One stage of a call.
struct StageReport {
  std::string_view name;
  std::int64_t count = 0;  // of `unit`; 0: did not run
  std::string_view unit;
  double milliseconds = 0;  // summed over workers
  std::string what;         // what it ran on, or why it did not
};

// The stages of a Renderer call in order, including those that did not run.
struct PlanReport {
  bool backward = false;
  std::vector<StageReport> stages;

  std::int64_t count(std::string_view name) const;  // of the stage of that name
};

// A heading, and one line for each stage: name, count, time, on what.
std::vector<std::string> ExplainLines(const PlanReport& report);

}  // namespace tilegrad
