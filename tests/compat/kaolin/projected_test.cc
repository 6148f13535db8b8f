// SPDX-License-Identifier: Apache-2.0
// Images of projected faces: gradients against float64 differences, float against double, the same
// bits for any number of workers. The stated bound, golden numbers, errors: test_kaolin.py.
#include <gtest/gtest.h>

#include <cmath>

#include "base/simd_target.h"
#include "compat/kaolin/projected_raster.h"
#include "compat/kaolin/projected_soft_mask.h"
#include "compat/projected_scenes.h"

namespace tilegrad::compat::kaolin::projected_test {

using test::Cast;
using test::ProjectedFacesOwner;
using test::RandomFaces;

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
  const Status status = RasterizeProjected<T>(faces.View(), c.raster, faces.features,
                                              faces.channels, workers, out.ids, out.features);
  EXPECT_TRUE(status.ok()) << status.message();
  const auto bound = ProjectedSoftMask<T>(faces.View(), c.mask, out.ids, workers, out.mask);
  EXPECT_TRUE(bound.ok()) << bound.status().message();
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

// d(sum of values * weights)/dx by central differences in x; `value` renders.
template <class Value>
double Difference(double* x, const Value& value) {
  const double at = *x, step = 1e-6;
  *x = at + step;
  const double up = value();
  *x = at - step;
  const double down = value();
  *x = at;
  return (up - down) / (2 * step);
}

// With visibility held fixed, as the contract says: pixels are interpolated by the ids of the
// undisturbed faces.
double Interpolated(const ProjectedFacesOwner<double>& faces, const Case& c,
                    const std::vector<std::int32_t>& ids, const std::vector<double>& weights) {
  const std::size_t width = static_cast<std::size_t>(c.raster.size.width);
  double sum = 0;
  for (std::size_t p = 0; p < ids.size(); ++p) {
    if (ids[p] < 0) continue;
    const std::size_t pixel = p % PixelCount(c.raster.size);
    const std::size_t face =
        p / PixelCount(c.raster.size) * faces.faces + static_cast<std::size_t>(ids[p]);
    const double x = (2.0 * double(pixel % width) + 1 - c.raster.size.width) / c.raster.size.width;
    const double y =
        (c.raster.size.height - 2.0 * double(pixel / width) - 1) / c.raster.size.height;
    const auto w = ScreenWeights(faces.xy.data() + 6 * face, x, y, c.raster.eps);
    for (std::size_t i = 0; i < 3 * faces.channels; ++i) {
      sum += weights[p * faces.channels + i % faces.channels] * w[i / faces.channels] *
             faces.features[3 * face * faces.channels + i];
    }
  }
  return sum;
}

TEST(Projected, GradientsOfFeaturesAndCornersAreThoseOfDifferences) {
  Rng rng(7);
  const Workers workers(2);
  // A large eps, too: its part of the gradient would otherwise be invisible.
  for (const double eps : {1e-14, 1e-2}) {
    Case c;
    c.raster.eps = eps;
    auto faces = Cast<double>(RandomFaces(2, 6, 3, 0.7, &rng));
    const auto images = Render(faces, c, workers);
    const auto d_image = Random<double>(images.features.size(), &rng);
    const auto d_mask = std::vector<double>(images.mask.size(), 0.0);
    const auto d = Backward(faces, c, images, d_image, d_mask, workers);
    EXPECT_GT(Dot(d.xy, d.xy), 0);
    const auto value = [&] { return Interpolated(faces, c, images.ids, d_image); };
    EXPECT_NEAR(value(), Dot(images.features, d_image), 1e-12 * double(d_image.size()));
    // Differences: rounding 1e-16 * sum / 1e-6, truncation 1e-12 times third derivatives.
    for (std::size_t i = 0; i < faces.xy.size(); ++i) {
      EXPECT_NEAR(d.xy[i], Difference(&faces.xy[i], value), 1e-6 * (1 + std::abs(d.xy[i])));
    }
    for (std::size_t i = 0; i < faces.features.size(); ++i) {
      EXPECT_NEAR(d.features[i], Difference(&faces.features[i], value), 1e-7);
    }
  }
}

TEST(Projected, GradientsOfTheMaskAreThoseOfDifferences) {
  Rng rng(8);
  const Workers workers(2);
  for (const AlphaRule rule : {AlphaRule::kAllFaces, AlphaRule::kPaper}) {
    Case c;
    c.mask.rule = rule;
    c.mask.paper_box = 0.5;
    c.mask.paper_faces = 4;
    c.mask.max_alpha_error = 1e-14;
    auto faces = Cast<double>(RandomFaces(2, 6, 0, 0.3, &rng));
    const auto images = Render(faces, c, workers);
    const auto d_mask = Random<double>(images.mask.size(), &rng);
    const auto d = Backward(faces, c, images, {}, d_mask, workers);
    EXPECT_GT(Dot(d.mask_xy, d.mask_xy), 0);
    std::vector<double> mask(images.mask.size());
    const auto value = [&] {
      EXPECT_TRUE(ProjectedSoftMask<double>(faces.View(), c.mask, images.ids, workers, mask).ok());
      return Dot(mask, d_mask);
    };
    std::size_t off = 0;
    for (std::size_t i = 0; i < faces.xy.size(); ++i) {
      off += std::abs(d.mask_xy[i] - Difference(&faces.xy[i], value)) >
             1e-5 * (1 + std::abs(d.mask_xy[i]));
    }
    // With the paper's rule a step moves boxes over centres now and then, and alpha jumps.
    EXPECT_LE(off, rule == AlphaRule::kPaper ? 1 : 0);
  }
}

TEST(Projected, FloatIsDouble) {
  Rng rng(9);
  const Workers workers(2);
  const Case c({130, 70}, 2000);  // several bins, tiles that are cut off
  const auto faces = RandomFaces(2, 150, 3, 0.2, &rng);
  const auto truth = Cast<double>(faces);
  for (const std::string& target : RunnableTargets()) {
    ASSERT_TRUE(ForceTarget(target).ok());
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
  ASSERT_TRUE(ForceTarget("").ok());
}

TEST(Projected, SameBitsForAnyNumberOfWorkers) {
  Rng rng(11);
  const auto faces = RandomFaces(3, 700, 4, 0.15, &rng);
  for (const AlphaRule rule : {AlphaRule::kAllFaces, AlphaRule::kPaper}) {
    Case c({150, 90}, 1000);
    c.mask.rule = rule;
    const Workers one(1);
    const auto images = Render(faces, c, one);
    const auto d_image = Random<float>(images.features.size(), &rng);
    const auto d_mask = Random<float>(images.mask.size(), &rng);
    const auto d = Backward(faces, c, images, d_image, d_mask, one);
    for (const int count : {2, 7}) {
      const Workers workers(count);
      const auto again = Render(faces, c, workers);
      EXPECT_EQ(again.ids, images.ids);
      EXPECT_EQ(again.features, images.features);
      EXPECT_EQ(again.mask, images.mask);
      const auto e = Backward(faces, c, images, d_image, d_mask, workers);
      EXPECT_EQ(e.xy, d.xy);
      EXPECT_EQ(e.features, d.features);
      EXPECT_EQ(e.mask_xy, d.mask_xy);
    }
  }
}

}  // namespace tilegrad::compat::kaolin::projected_test
