// SPDX-License-Identifier: Apache-2.0
// Images of projected faces: float against double. Golden numbers, the stated bound, gradients and
// errors: test_kaolin.py.
#include <gtest/gtest.h>

#include <cmath>

#include "base/rng.h"
#include "compat/kaolin/projected_raster.h"
#include "compat/kaolin/projected_soft_mask.h"
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
