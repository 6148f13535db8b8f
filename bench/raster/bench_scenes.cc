// SPDX-License-Identifier: Apache-2.0
#include "raster/bench_scenes.h"

#include <array>
#include <cmath>

#include "base/rng.h"
#include "raster/project.h"
#include "scene/shapes.h"

namespace tilegrad::bench {
namespace {

// Rotation of a random unit quaternion, row-major.
std::array<double, 9> RandomRotation(Rng* rng) {
  double q[4], norm = 0;
  for (double& v : q) {
    v = rng->Normal();
    norm += v * v;
  }
  for (double& v : q) v /= std::sqrt(norm);
  const auto [w, x, y, z] = q;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

std::vector<float> RotatedPositions(const Mesh& mesh, Rng* rng) {
  const auto r = RandomRotation(rng);
  std::vector<float> out;
  for (const glm::vec3& p : mesh.positions) {
    for (int row = 0; row < 3; ++row) {
      const double* axis = &r[static_cast<std::size_t>(3 * row)];
      out.push_back(static_cast<float>(axis[0] * p.x + axis[1] * p.y + axis[2] * p.z));
    }
  }
  return out;
}

Mesh MakeMesh(const SceneSpec& spec) {
  if (spec.mesh != nullptr) return *spec.mesh;
  Mesh mesh = Icosphere(spec.level, 0.5f);
  if (!spec.displaced) return mesh;
  for (glm::vec3& p : mesh.positions) {
    const glm::dvec3 unit = 2.0 * glm::dvec3(p);
    const double bump =
        std::sin(11 * unit.x) * std::sin(9 * unit.y + 1) * std::sin(10 * unit.z + 2);
    p = glm::vec3((1 + 0.15 * bump) * glm::dvec3(p));
  }
  return mesh;
}

}  // namespace

BenchBatch::BenchBatch(const SceneSpec& spec) {
  const Mesh mesh = MakeMesh(spec);
  Rng rng(1234);
  options.width = options.height = spec.size;
  options.max_alpha_error = 1e-7;
  options.interpolation = Interpolation::kScreenLinear;  // as the peers
  for (const Face& face : mesh.faces) faces.insert(faces.end(), face.begin(), face.end());
  for (std::size_t i = 0; i < 3 * mesh.positions.size(); ++i) {
    colors.push_back(static_cast<float>(rng.Uniform()));
  }
  const Camera camera = OrbitCamera({30.0, spec.size, spec.size}, 90, 0, 2.732);
  for (int n = 0; n < spec.images; ++n) {
    positions.push_back(RotatedPositions(mesh, &rng));
    d_positions.emplace_back(positions.back().size());
    d_colors.emplace_back(colors.size());
  }
  for (std::size_t n = 0; n < positions.size(); ++n) {
    scenes.push_back({.positions = positions[n],
                      .faces = faces,
                      .camera = camera,
                      .attributes = {colors, Rate::kVertex},
                      .channels = 3});
    d_scenes.push_back({d_positions[n], d_colors[n], false, {}});
  }
  for (const Scene& scene : scenes) views.push_back({&scene, {colors, 3, Rate::kVertex}});
  const std::size_t pixels = static_cast<std::size_t>(spec.images) *
                             static_cast<std::size_t>(spec.size) *
                             static_cast<std::size_t>(spec.size);
  d_attributes.resize(3 * pixels);
  d_alpha.resize(pixels);
  for (float& d : d_attributes) d = static_cast<float>(rng.Uniform(-1, 1));
  for (float& d : d_alpha) d = static_cast<float>(rng.Uniform(-1, 1));
}

void Draw(const BenchBatch& batch, const Outputs& outputs, Pipeline* renderer, FrameImages* frame) {
  SizeFrame(batch.views.size(), 3, batch.options, outputs, frame);
  renderer->Render(batch.views, batch.options, {.image = &frame->attributes}, frame);
}

CulledBatch::CulledBatch(const BenchBatch& batch)
    : faces(batch.faces), colors(batch.colors), d_alpha(batch.d_alpha) {
  const RenderOptions& o = batch.options;
  const std::size_t n = batch.scenes.size();
  const auto pixels = static_cast<std::size_t>(o.width) * static_cast<std::size_t>(o.height);
  frames.resize(n);
  for (const Scene& scene : batch.scenes) {
    raster::ScreenMeshBuffers screen;
    raster::Project(FaceSourceOf(scene, o), o.width, o.height, &screen);
    std::vector<float>& xy = ndc.emplace_back();
    for (std::size_t v = 0; v < screen.x.size(); ++v) {
      xy.push_back(2 * screen.x[v] / static_cast<float>(o.width) - 1);
      xy.push_back(1 - 2 * screen.y[v] / static_cast<float>(o.height));
    }
    depth.emplace_back(screen.depth.begin(), screen.depth.end());
    d_ndc.emplace_back(xy.size());
    d_vertex_colors.emplace_back(batch.colors.size());
  }
  for (std::size_t i = 0; i < n; ++i) {
    scenes.push_back(
        {o.width, o.height, static_cast<float>(o.delta), ndc[i], depth[i], faces, colors});
  }
  d_colors.resize(3 * pixels * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t p = 0; p < pixels; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        d_colors[3 * (i * pixels + p) + c] = batch.d_attributes[(3 * i + c) * pixels + p];
      }
    }
  }
}

void CulledBatch::Forward(const CulledParts& parts) {
  for (std::size_t i = 0; i < scenes.size(); ++i) CulledForward(scenes[i], parts, &frames[i]);
}

void CulledBatch::Backward(const CulledParts& parts) {
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    std::fill(d_ndc[i].begin(), d_ndc[i].end(), 0.0f);
    std::fill(d_vertex_colors[i].begin(), d_vertex_colors[i].end(), 0.0f);
    const std::size_t pixels = frames[i].face_ids.size();
    CulledBackward(scenes[i], parts, frames[i],
                   {std::span(d_colors).subspan(3 * pixels * i, 3 * pixels),
                    std::span(d_alpha).subspan(pixels * i, pixels), d_ndc[i], d_vertex_colors[i]});
  }
}

}  // namespace tilegrad::bench
