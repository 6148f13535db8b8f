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

template <class T>
struct ProjectedFacesOwner {
  std::size_t images = 0, faces = 0, channels = 0;
  std::vector<T> xy, z, features;
  std::vector<std::uint8_t> valid;

  ProjectedBatchT<T> View() const { return {images, faces, xy, z, valid}; }
};

template <class T, class U>
ProjectedFacesOwner<T> Cast(const ProjectedFacesOwner<U>& from) {
  return {from.images,
          from.faces,
          from.channels,
          {from.xy.begin(), from.xy.end()},
          {from.z.begin(), from.z.end()},
          {from.features.begin(), from.features.end()},
          from.valid};
}

// Independent triangles of about `size` around the image; one in five is not valid.
ProjectedFacesOwner<float> RandomFaces(std::size_t images, std::size_t faces, std::size_t channels,
                                       double size, Rng* rng) {
  ProjectedFacesOwner<float> out;
  out.images = images;
  out.faces = faces;
  out.channels = channels;
  for (std::size_t f = 0; f < images * faces; ++f) {
    const double x = rng->Uniform(-1.2, 1.2), y = rng->Uniform(-1.2, 1.2);
    for (int k = 0; k < 3; ++k) {
      out.xy.push_back(static_cast<float>(x + rng->Uniform(-size, size)));
      out.xy.push_back(static_cast<float>(y + rng->Uniform(-size, size)));
      out.z.push_back(static_cast<float>(rng->Uniform(-3, -1)));
      for (std::size_t c = 0; c < channels; ++c) {
        out.features.push_back(static_cast<float>(rng->Uniform(-1, 1)));
      }
    }
    out.valid.push_back(rng->Uniform() < 0.8 ? 1 : 0);
  }
  return out;
}

template <class T>
struct Images {
  std::vector<std::int32_t> ids;
  std::vector<T> features, mask;
  double bound = 0;
};

template <class T>
struct Gradients {
  std::vector<T> xy, features, mask_xy;
};

struct Case {
  ProjectedRasterOptions raster;
  ProjectedMaskOptions mask;

  explicit Case(ImageSize size = {37, 41}, double sigmainv = 300) {
    raster.size = mask.size = size;
    mask.delta = 1 / sigmainv;
  }
};

template <class T>
Images<T> Render(const ProjectedFacesOwner<T>& faces, const Case& c, const Workers& workers) {
  const std::size_t pixels = faces.images * PixelCount(c.raster.size);
  Images<T> out{std::vector<std::int32_t>(pixels), std::vector<T>(pixels * faces.channels),
                std::vector<T>(pixels)};
  Ok(RasterizeProjected<T>(faces.View(), c.raster, faces.features, faces.channels, workers, out.ids,
                           out.features));
  const auto bound = Ok(ProjectedSoftMask<T>(faces.View(), c.mask, out.ids, workers, out.mask));
  out.bound = bound.value();
  return out;
}

template <class T>
Gradients<T> Backward(const ProjectedFacesOwner<T>& faces, const Case& c, const Images<T>& images,
                      const std::vector<T>& d_image, const std::vector<T>& d_mask,
                      const Workers& workers) {
  Gradients<T> out{std::vector<T>(faces.xy.size()), std::vector<T>(faces.features.size()),
                   std::vector<T>(faces.xy.size())};
  Status status =
      RasterizeProjectedBackward<T>(faces.View(), c.raster, faces.features, faces.channels, workers,
                                    {images.ids, d_image, out.xy, out.features});
  EXPECT_TRUE(status.ok()) << status.message();
  status = ProjectedSoftMaskBackward<T>(faces.View(), c.mask, workers,
                                        {images.ids, images.mask, d_mask, out.mask_xy});
  EXPECT_TRUE(status.ok()) << status.message();
  return out;
}

template <class T>
std::vector<T> Random(std::size_t n, Rng* rng) {
  std::vector<T> out(n);
  for (T& v : out) v = static_cast<T>(static_cast<float>(rng->Uniform(-1, 1)));
  return out;
}

double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

TEST(Projected, FloatIsDouble) {
  Rng rng(9);
  const Workers workers(2);
  const Case c({130, 70}, 2000);  // several bins, tiles that are cut off
  const auto faces = RandomFaces(2, 150, 3, 0.2, &rng);
  const auto truth = Cast<double>(faces);
  for (const std::string target : EveryTarget()) {
    auto images = Render(faces, c, workers);
    auto exact = Render(truth, c, workers);
    std::size_t other = 0;  // centres that rounding moves over an edge
    for (std::size_t p = 0; p < images.ids.size(); ++p) {
      if (images.ids[p] == exact.ids[p]) {
        EXPECT_NEAR(images.mask[p], exact.mask[p], 2e-6 + 1e-5);  // both bounds, rounding
        for (std::size_t k = 0; k < 3; ++k) {
          EXPECT_NEAR(images.features[3 * p + k], exact.features[3 * p + k], 2e-4);
        }
      } else {
        ++other;
      }
    }
    EXPECT_LE(other, 2u);
    // The same ids for both, so that gradients can be compared.
    std::copy(exact.ids.begin(), exact.ids.end(), images.ids.begin());
    const auto d_image = Random<float>(images.features.size(), &rng);
    const auto d_mask = Random<float>(images.mask.size(), &rng);
    const auto d = Backward(faces, c, images, d_image, d_mask, workers);
    const auto e = Backward(truth, c, exact, {d_image.begin(), d_image.end()},
                            {d_mask.begin(), d_mask.end()}, workers);
    const double xy = std::sqrt(Dot(e.xy, e.xy) / double(e.xy.size()));
    const double mask = std::sqrt(Dot(e.mask_xy, e.mask_xy) / double(e.xy.size()));
    for (std::size_t i = 0; i < e.xy.size(); ++i) {
      EXPECT_NEAR(d.xy[i], e.xy[i], 1e-3 * (xy + std::abs(e.xy[i])));
      EXPECT_NEAR(d.mask_xy[i], e.mask_xy[i], 1e-3 * (mask + std::abs(e.mask_xy[i])));
    }
    for (std::size_t i = 0; i < e.features.size(); ++i) {
      EXPECT_NEAR(d.features[i], e.features[i], 1e-3 * (1 + std::abs(e.features[i])));
    }
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
