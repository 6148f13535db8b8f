// SPDX-License-Identifier: Apache-2.0
// Images of projected faces: float against double. Golden numbers, the stated bound, gradients and
// errors: test_kaolin.py.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/rng.h"
#include "compat/kaolin/face_visibility.h"
#include "compat/kaolin/face_visibility_ref.h"
#include "compat/kaolin/projected_raster.h"
#include "compat/projected_batch.h"
#include "support/expect.h"

namespace tilegrad::compat::kaolin::projected_test {

constexpr std::size_t kImages = 2, kFaces = 150, kChannels = 3;
constexpr ImageSize kSize{130, 70};  // several bins, tiles that are cut off
constexpr std::size_t kPixels = kImages * 130 * 70;

// Independent triangles around the image, one in five not valid, of numbers that float holds; their
// images, and gradients.
template <class T>
struct Projected {
  ProjectedRasterOptions raster;
  ProjectedMaskOptions soft;
  std::vector<T> xy, z, features;
  std::vector<std::uint8_t> valid;
  std::vector<std::int32_t> ids = std::vector<std::int32_t>(kPixels);
  std::vector<T> image = std::vector<T>(kPixels * kChannels), mask = std::vector<T>(kPixels);
  std::vector<T> d_xy, d_features, d_mask_xy;

  explicit Projected(std::uint64_t seed) {
    raster.size = soft.size = kSize;
    soft.delta = 1.0 / 2000;
    Rng rng(seed);
    const auto add = [&](double low, double high, std::vector<T>* to) {
      to->push_back(static_cast<T>(static_cast<float>(rng.Uniform(low, high))));
    };
    for (std::size_t f = 0; f < kImages * kFaces; ++f) {
      const double x = rng.Uniform(-1.2, 1.2), y = rng.Uniform(-1.2, 1.2);
      for (int k = 0; k < 3; ++k) {
        for (const double at : {x, y}) add(at - 0.2, at + 0.2, &xy);
        add(-3, -1, &z);
        for (std::size_t c = 0; c < kChannels; ++c) add(-1, 1, &features);
      }
      valid.push_back(rng.Uniform() < 0.8 ? 1 : 0);
    }
  }
  ProjectedBatchT<T> View() const { return {kImages, kFaces, xy, z, valid}; }
  void Render(const Workers& workers) {
    Ok(RasterizeProjected<T>(View(), raster, features, kChannels, workers, ids, image));
    Ok(ProjectedSoftMask<T>(View(), soft, ids, workers, mask).status());
  }
  void Backward(const std::vector<float>& of_image, const std::vector<float>& of_mask,
                const Workers& workers) {
    const std::vector<T> d_image(of_image.begin(), of_image.end());
    const std::vector<T> d_mask(of_mask.begin(), of_mask.end());
    for (auto* d : {&d_xy, &d_mask_xy}) d->assign(xy.size(), T(0));
    d_features.assign(features.size(), T(0));
    Ok(RasterizeProjectedBackward<T>(View(), raster, features, kChannels, workers,
                                     {ids, d_image, d_xy, d_features}));
    Ok(ProjectedSoftMaskBackward<T>(View(), soft, workers, {ids, mask, d_mask, d_mask_xy}));
  }
};

// Within a thousandth of the number, and of what numbers of its kind are like.
void ExpectNear(const std::vector<float>& got, const std::vector<double>& want) {
  double squares = 0;
  for (const double v : want) squares += v * v;
  const double size = std::sqrt(squares / static_cast<double>(want.size()));
  EXPECT_GT(size, 0);
  for (std::size_t i = 0; i < want.size(); ++i) {
    EXPECT_NEAR(got[i], want[i], 1e-3 * (size + std::abs(want[i]))) << i;
  }
}

TEST(Projected, FloatIsDouble) {
  const Workers workers(2);
  Rng rng(9);
  std::vector<float> d_image(kPixels * kChannels), d_mask(kPixels);
  for (auto* d : {&d_image, &d_mask}) {
    for (float& v : *d) v = static_cast<float>(rng.Uniform(-1, 1));
  }
  for (const std::string target : EveryTarget()) {
    Projected<float> got(10);
    Projected<double> exact(10);
    got.Render(workers);
    exact.Render(workers);
    std::size_t other = 0;  // centres that rounding moves over an edge
    for (std::size_t p = 0; p < kPixels; ++p) {
      other += got.ids[p] != exact.ids[p];
      if (got.ids[p] != exact.ids[p]) continue;
      EXPECT_NEAR(got.mask[p], exact.mask[p], 2e-6 + 1e-5);  // both bounds, rounding
      for (std::size_t k = 3 * p; k < 3 * p + 3; ++k) {
        EXPECT_NEAR(got.image[k], exact.image[k], 2e-4);
      }
    }
    EXPECT_LE(other, 2u);
    got.ids = exact.ids;  // so that gradients can be compared
    got.Backward(d_image, d_mask, workers);
    exact.Backward(d_image, d_mask, workers);
    ExpectNear(got.d_xy, exact.d_xy);
    ExpectNear(got.d_mask_xy, exact.d_mask_xy);
    ExpectNear(got.d_features, exact.d_features);
  }
}

}  // namespace tilegrad::compat::kaolin::projected_test

// Projected faces: the vector body against every face for every pixel, bit by bit, and the rules of
// the header one by one.

namespace tilegrad::compat::kaolin::face_visibility_test {

template <class T>
struct Faces {
  std::vector<T> xy, z;
  std::vector<std::uint8_t> valid;
  ProjectedFacesT<T> View() const { return {xy, z, valid}; }
};

template <class T>
void AddFace(const std::vector<T>& xy, const std::vector<T>& z, Faces<T>* to) {
  to->xy.insert(to->xy.end(), xy.begin(), xy.end());
  to->z.insert(to->z.end(), z.begin(), z.end());
}

// Some large, some thin, some on a grid, so that centres lie on edges and on boxes.
template <class T>
Faces<T> RandomFaces(std::size_t count, Rng* rng) {
  Faces<T> out;
  for (std::size_t f = 0; f < count; ++f) {
    const double size = f % 7 == 0 ? 3 : 0.2;
    const double x = rng->Uniform(-1.3, 1.3), y = rng->Uniform(-1.3, 1.3);
    for (int k = 0; k < 3; ++k) {
      double at[2] = {x + rng->Uniform(-size, size), y + rng->Uniform(-size, size)};
      for (double& v : at) out.xy.push_back(static_cast<T>(f % 3 == 0 ? std::round(v * 8) / 8 : v));
      out.z.push_back(static_cast<T>(f % 5 == 0 ? -2.0 : rng->Uniform(-3, -1)));
    }
    out.valid.push_back(f % 4 == 1 ? 0 : 1);
  }
  return out;
}

template <class T>
std::vector<std::int32_t> SeenByBands(const Faces<T>& faces, int width, int height,
                                      std::size_t rows) {
  const PixelCentresT<T> pixels(width, height);
  FaceVisibilityScratchT<T> scratch;
  std::vector<std::int32_t> ids(pixels.width * pixels.height);
  for (std::size_t i = 0; i < pixels.height; i += rows) {
    const std::size_t end = std::min(i + rows, pixels.height);
    FaceVisibility(faces.View(), pixels, T(1e-14), i, end, &scratch, ids.data() + i * pixels.width);
  }
  return ids;
}

template <class T>
class FaceVisibilityOf : public ::testing::Test {};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(FaceVisibilityOf, Reals);

TYPED_TEST(FaceVisibilityOf, BitsOfTheReferenceOnEveryTarget) {
  using T = TypeParam;
  Rng rng(3);
  for (const std::size_t count : {1, 40, 300}) {
    const auto faces = RandomFaces<T>(count, &rng);
    const auto expected = FaceVisibilityRef(faces.View(), PixelCentresT<T>(37, 48), T(1e-14));
    for (const std::string target : EveryTarget()) {
      EXPECT_EQ(SeenByBands(faces, 37, 48, 48), expected) << target;
      EXPECT_EQ(SeenByBands(faces, 37, 48, 11), expected) << target;
    }
  }
}

// 4 x 4 pixels: centres at -0.75, -0.25, 0.25, 0.75.
TYPED_TEST(FaceVisibilityOf, CentresOnEdgesAreInsideButNotOnTheFarSidesOfTheBox) {
  using T = TypeParam;
  Faces<T> faces;
  AddFace<T>({T(-0.75), T(-0.75), T(0.75), T(-0.75), T(0.75), T(0.75)}, {-1, -1, -1}, &faces);
  const std::vector<std::int32_t> expected = {-1, -1, -1, -1,   // on y = top: outside
                                              -1, -1, 0,  -1,   // the diagonal is inside,
                                              -1, 0,  0,  -1,   // x = right is outside,
                                              0,  0,  0,  -1};  // y = bottom inside
  EXPECT_EQ(SeenByBands(faces, 4, 4, 4), expected);
}

TYPED_TEST(FaceVisibilityOf, LargestDepthWinsThenTheFirst) {
  using T = TypeParam;
  const std::vector<T> everywhere = {-9, -9, 9, -9, 0, 9};
  Faces<T> faces;
  AddFace<T>(everywhere, {-3, -3, -3}, &faces);
  AddFace<T>(everywhere, {-2, -2, -2}, &faces);
  AddFace<T>(everywhere, {-2, -2, -2}, &faces);
  EXPECT_EQ(SeenByBands(faces, 2, 1, 1), (std::vector<std::int32_t>{1, 1}));
  faces.valid = {1, 0, 1};
  EXPECT_EQ(SeenByBands(faces, 2, 1, 1), (std::vector<std::int32_t>{2, 2}));
}

// Ties that rounding could break: the same corners in any order, slanted; and faces of one z, whose
// weights sum to 1 only up to rounding and eps.
TYPED_TEST(FaceVisibilityOf, OfTheSameCornersInAnyOrderTheFirstFaceWins) {
  using T = TypeParam;
  Rng rng(11);
  std::size_t seen = 0;
  for (std::size_t trial = 0; trial < 30; ++trial) {
    T v[3][3];
    for (auto& corner : v) {
      for (int i = 0; i < 2; ++i) corner[i] = static_cast<T>(rng.Uniform(-1.2, 1.2));
      corner[2] = static_cast<T>(rng.Uniform(-3, -1));
    }
    std::vector<std::vector<int>> orders = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2},
                                            {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    std::swap(orders[0], orders[trial % 6]);
    Faces<T> faces;
    for (const auto& order : orders) {
      std::vector<T> xy, z;
      for (const int k : order) {
        xy.insert(xy.end(), {v[k][0], v[k][1]});
        z.push_back(v[k][2]);
      }
      AddFace<T>(xy, z, &faces);
    }
    for (const std::int32_t id : SeenByBands(faces, 64, 64, 64)) {
      ASSERT_LE(id, 0) << trial;
      seen += id == 0;
    }
  }
  EXPECT_GT(seen, 5000u);
}

TYPED_TEST(FaceVisibilityOf, OfFacesAtOneDepthTheFirstWins) {
  using T = TypeParam;
  Rng rng(12);
  std::size_t overlaps = 0;
  for (int trial = 0; trial < 30; ++trial) {
    const T z = static_cast<T>(rng.Uniform(-3, -1));
    Faces<T> faces;
    for (int f = 0; f < 6; ++f) {
      const double size = f % 2 == 0 ? 2 : 0.05;  // eps weighs more in small ones
      const double x = rng.Uniform(-0.5, 0.5), y = rng.Uniform(-0.5, 0.5);
      std::vector<T> xy;
      for (int k = 0; k < 3; ++k) {
        xy.push_back(static_cast<T>(x + rng.Uniform(-size, size)));
        xy.push_back(static_cast<T>(y + rng.Uniform(-size, size)));
      }
      AddFace<T>(xy, {z, z, z}, &faces);
    }
    const auto seen = SeenByBands(faces, 64, 64, 64);
    const PixelCentresT<T> centres(64, 64);
    for (std::size_t p = 0; p < seen.size(); ++p) {
      std::int32_t first = -1;
      int count = 0;
      for (std::int32_t f = 5; f >= 0; --f) {
        const OrderedFace<T> face(faces.View(), static_cast<std::size_t>(f));
        if (CoversCentre(face.xy, centres.x[p % 64], centres.y[p / 64])) {
          first = f;
          ++count;
        }
      }
      ASSERT_EQ(seen[p], first) << trial << " pixel " << p;
      overlaps += count > 1;
    }
  }
  EXPECT_GT(overlaps, 5000u);
}

TYPED_TEST(FaceVisibilityOf, BothWindingsAreDrawnFacesWithoutAreaAreNot) {
  using T = TypeParam;
  Faces<T> faces;
  AddFace<T>({-9, 0, 9, 0, 0, 0}, {-1, -1, -1}, &faces);
  AddFace<T>({-9, -9, 0, 9, 9, -9}, {-2, -2, -2}, &faces);
  EXPECT_EQ(SeenByBands(faces, 1, 1, 1), (std::vector<std::int32_t>{1}));
}

TYPED_TEST(FaceVisibilityOf, FacesThatOverflowCoverNothing) {
  using T = TypeParam;
  const T far = std::numeric_limits<T>::max();
  Faces<T> faces;
  AddFace<T>({-far, -far, far, -far, 0, far}, {-1, -1, -1}, &faces);
  EXPECT_EQ(SeenByBands(faces, 3, 2, 2), std::vector<std::int32_t>(6, -1));
}

// A fan around a vertex: each centre in it has exactly one face, whatever is rounded.
TYPED_TEST(FaceVisibilityOf, NoCracksBetweenNeighbours) {
  using T = TypeParam;
  Rng rng(5);
  for (int trial = 0; trial < 20; ++trial) {
    const T cx = T(rng.Uniform(-0.5, 0.5)), cy = T(rng.Uniform(-0.5, 0.5));
    Faces<T> faces;
    const auto corner = [&](int k) {
      const double angle = 2 * 3.14159265358979 * (k % 11) / 11;
      return std::pair<T, T>(T(8 * std::cos(angle)), T(8 * std::sin(angle)));
    };
    for (int k = 0; k < 11; ++k) {
      const auto [ax, ay] = corner(k);
      const auto [bx, by] = corner(k + 1);
      AddFace<T>({cx, cy, ax, ay, bx, by}, {-1, -1, -1}, &faces);
    }
    for (const std::int32_t id : SeenByBands(faces, 64, 64, 64)) EXPECT_GE(id, 0);
  }
}

}  // namespace tilegrad::compat::kaolin::face_visibility_test
