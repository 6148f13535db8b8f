// SPDX-License-Identifier: Apache-2.0
// Vertices are split where faces meet at a sharp edge, and joined where they stand at one place.
#include "scene/creases.h"

#include <gtest/gtest.h>

#include "scene/shapes.h"

namespace tilegrad::creases_test {

// A box has right angles: at 60 degrees each face has its own corners, at 100 degrees all are
// joined.
TEST(Creases, OfABoxAreItsEdges) {
  const Mesh box = Box({0, 0, 0}, {1, 2, 3});
  Mesh sharp = box, round = box;
  SplitAtCreases(60, &sharp);
  SplitAtCreases(100, &round);
  EXPECT_TRUE(Validate(sharp).ok());
  EXPECT_EQ(sharp.positions.size(), 24u);
  EXPECT_EQ(round.positions.size(), 8u);
  for (std::size_t f = 0; f < box.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = [&](const Mesh& mesh) {
        return mesh.positions[static_cast<std::size_t>(mesh.faces[f][k])];
      };
      EXPECT_EQ(at(sharp), at(box));
      EXPECT_EQ(at(round), at(box));
    }
  }
}

// As files with seams have them: three vertices a face.
TEST(Creases, VerticesAtOnePlaceAreJoined) {
  const Mesh ball = Icosphere(2, 1);
  Mesh loose = ball;
  loose.positions.clear();
  for (Face& face : loose.faces) {
    for (std::int32_t& v : face) {
      loose.positions.push_back(ball.positions[static_cast<std::size_t>(v)]);
      v = static_cast<std::int32_t>(loose.positions.size()) - 1;
    }
  }
  loose.colors.assign(loose.positions.size(), glm::vec4(0.5f));
  loose.colors[4].r = 1;
  SplitAtCreases(40, &loose);
  EXPECT_TRUE(Validate(loose).ok());
  EXPECT_EQ(loose.positions.size(), ball.positions.size());
  EXPECT_TRUE(loose.colors.empty());
  EXPECT_EQ(loose.corner_colors[4].r, 1);
}

// Of a face without area nothing is known: it joins no other, and divides none by zero.
TEST(Creases, FacesWithoutAreaStayAlone) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 1, 1}};
  SplitAtCreases(60, &mesh);
  EXPECT_TRUE(Validate(mesh).ok());
  EXPECT_EQ(mesh.positions.size(), 6u);
}

}  // namespace tilegrad::creases_test
