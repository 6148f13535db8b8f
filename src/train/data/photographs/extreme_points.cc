// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/extreme_points.h"

#include <algorithm>
#include <glm/geometric.hpp>

namespace tilegrad::train {

const std::array<ExtremePoint, 12> kExtremePoints = {{{"left front bumper", {1, -1, 1}},
                                                      {"right front bumper", {-1, -1, 1}},
                                                      {"left back bumper", {1, -1, -1}},
                                                      {"right back bumper", {-1, -1, -1}},
                                                      {"left front light", {1, 0.2f, 1.5f}},
                                                      {"right front light", {-1, 0.2f, 1.5f}},
                                                      {"left trunk", {1, 0.2f, -1.5f}},
                                                      {"right trunk", {-1, 0.2f, -1.5f}},
                                                      {"left windshield", {0.6f, 1.5f, 0.4f}},
                                                      {"right windshield", {-0.6f, 1.5f, 0.4f}},
                                                      {"left rear window", {0.6f, 1.5f, -0.4f}},
                                                      {"right rear window", {-0.6f, 1.5f, -0.4f}}}};

std::vector<int> ExtremeMirror() {
  std::vector<int> out;
  for (int k = 0; k < static_cast<int>(kExtremePoints.size()); ++k) out.push_back(k ^ 1);
  return out;
}

std::vector<glm::vec3> FindExtremePoints(const Mesh& mesh) {
  const Bounds bounds = MeshBounds(mesh);
  const glm::vec3 centre = 0.5f * (bounds.low + bounds.high);
  const glm::vec3 half = glm::max(0.5f * (bounds.high - bounds.low), glm::vec3(1e-6f));
  std::vector<glm::vec3> out;
  for (const ExtremePoint& point : kExtremePoints) {
    const glm::vec3 along =
        glm::vec3(point.direction[0], point.direction[1], point.direction[2]) / half;
    float farthest = -1e30f;
    for (const glm::vec3& p : mesh.positions)
      farthest = std::max(farthest, glm::dot(along, p - centre));
    glm::vec3 sum(0);
    float count = 0;
    for (const glm::vec3& p : mesh.positions) {
      if (glm::dot(along, p - centre) < farthest - 0.01f) continue;
      sum += p;
      count += 1;
    }
    out.push_back(sum / count);
  }
  return out;
}

}  // namespace tilegrad::train
