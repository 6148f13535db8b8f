// SPDX-License-Identifier: Apache-2.0
// N3MR's colours: numbers worked out by hand, independent numbers of the published
// kernels, complex step for what is a derivative, and the fast code against the reference.
#include "rivals/n3mr_color.h"

#include <complex>

#include "rivals/n3mr_color_ref.h"
#include "rivals/test_util.h"

namespace tilegrad::rivals::n3mr_color_test {

using namespace test;  // NOLINT: of the tests of one folder

using Complex = std::complex<double>;

enum Asked { kColor = 1, kAlpha = 2 };

// Images and gradients of a scene; `d`: dL/d(r, g, b, alpha), planes of the image.
template <class T>
struct Result {
  std::vector<T> color, alpha, d_corners, d_textures;

  Result(const N3mrSceneRef<T>& scene, std::size_t pixels)
      : color(3 * pixels),
        alpha(pixels),
        d_corners(scene.corners.size()),
        d_textures(scene.textures.size()) {}
  N3mrImages<T> Images() { return {color, alpha}; }
  N3mrColorAdjoints<T> Adjoints() { return {d_corners, d_textures}; }
};

template <class T>
N3mrImages<const T> PushesOf(const std::vector<T>& d, int asked) {
  const std::span<const T> all = d;
  const std::size_t pixels = d.size() / 4;
  N3mrImages<const T> out;
  if ((asked & kColor) != 0) out.color = all.first(3 * pixels);
  if ((asked & kAlpha) != 0) out.alpha = all.subspan(3 * pixels, pixels);
  return out;
}

template <class T>
Result<T> Reference(const N3mrSceneRef<T>& scene, const std::vector<T>& d, int asked) {
  Result<T> out(scene, d.size() / 4);
  N3mrSceneForwardRef(scene, out.Images());
  N3mrSceneBackwardRef(scene, PushesOf(d, asked), out.Adjoints());
  return out;
}

// Rows in three parts, faces in two.
template <class T>
Result<T> Fast(const N3mrSceneRef<T>& scene, const std::vector<T>& d, int asked) {
  Result<T> out(scene, d.size() / 4);
  std::fill(out.d_textures.begin(), out.d_textures.end(), T(7));
  N3mrImageT<T> image;
  N3mrPlanesT<T> planes;
  SetUpN3mr<T>(scene.corners, scene.size, scene.options, &image);
  ReserveN3mrPlanes(image, &planes);
  const N3mrColorJob<T> job{scene.options, scene.colors, image, scene.textures};
  const int m = image.inner;
  for (const RowRange rows : {RowRange{0, m / 3}, {m / 3, m / 2}, {m / 2, m}}) {
    DrawN3mr(scene.options, rows, &image);
    N3mrShade(job, rows, &planes);
  }
  N3mrReducePlanes(job, planes, out.Images());
  const N3mrImages<const T> pushes = PushesOf(d, asked);
  N3mrPrepareColorBackward(job, pushes, &planes);
  const std::size_t faces = scene.corners.size() / kCornerNumbers;
  N3mrColorBackward(job, pushes, planes, 0, faces / 2, out.Adjoints());
  N3mrColorBackward(job, pushes, planes, faces / 2, faces, out.Adjoints());
  return out;
}

int AskedOf(const std::string& outputs) {
  return outputs == "rgb" ? kColor : outputs == "alpha" ? kAlpha : kColor | kAlpha;
}

// A scene of the file at one image, in numbers of T.
template <class T>
struct SharedScene {
  std::vector<T> corners, textures, d;
  N3mrSceneRef<T> scene;

  SharedScene(const Json& file, const Json& of, const Json& inputs, std::size_t n, double eps)
      : corners(Numbers<T>(inputs["face_vertices"][n])),
        textures(Numbers<T>(file["textures"][of["texture"].get<std::string>()][n])),
        d(Numbers<T>(inputs["upstream"][n])) {
    scene = {corners, textures, of["image_size"], {}, {}};
    d.resize(4 * static_cast<std::size_t>(scene.size * scene.size));
    scene.options.reduction =
        of["anti_aliasing"].get<bool>() ? N3mrReduction::kMean : N3mrReduction::kNone;
    scene.options.fill_back = of["fill_back"];
    scene.options.eps = eps;
    scene.options.near_plane = of["near"];
    scene.options.far_plane = of["far"];
    const auto background = Numbers(of["background"]);
    std::copy_n(background.begin(), 3, scene.colors.background);
    const double texels = static_cast<double>(3 * textures.size() / corners.size());
    scene.colors.resolution = static_cast<int>(std::lround(std::cbrt(texels)));
  }
};

// Calls check(scene of the file, its inputs, gradient, image) for colours.
template <class Check>
void ForSharedImages(const Json& file, const Check& check) {
  for (const Json& of : file["scenes"]) {
    if (!of.contains("texture")) continue;
    const Json& inputs = of.contains("inputs_of_scene")
                             ? file["scenes"][of["inputs_of_scene"].get<std::size_t>()]
                             : of;
    for (const Json& gradient : of["gradients"]) {
      if (gradient["outputs"] == "depth") continue;
      for (std::size_t n = 0; n < inputs["face_vertices"].size(); ++n) {
        SCOPED_TRACE(of["name"].get<std::string>() + " " + of["anti_aliasing"].dump() + " " +
                     gradient["outputs"].get<std::string>());
        check(of, inputs, gradient, n);
      }
    }
  }
}

template <class T>
void ExpectShared(const Json& of, const Json& gradient, std::size_t n, const Result<T>& got,
                  double of_image, double of_gradient) {
  // The lookup's eps is that of the scene.
  if (of["eps"] == gradient["eps"]) {
    EXPECT_LT(Difference(got.color, Numbers(of["rgb"][n])), of_image);
  }
  EXPECT_LT(Difference(got.alpha, Numbers(of["alpha"][n])), of_image);
  const auto want = Numbers(gradient["grad_face_vertices"][n]);
  EXPECT_LT(Difference(PlaneParts(got.d_corners), want),
            of_gradient * std::max(1e-3, Largest(want)));
  if (!gradient.contains("grad_textures")) return;
  const auto d_textures = Numbers(gradient["grad_textures"][n]);
  EXPECT_LT(Difference(got.d_textures, d_textures),
            of_gradient * std::max(1.0, Largest(d_textures)));
}

// 1e-10: both sides compute in double.
TEST(N3mrColors, DoubleGivesTheNumbersOfThePublishedKernels) {
  TILEGRAD_VECTORS_OR_SKIP(file, "16_n3mr.json");
  int cases = 0;
  ForSharedImages(file,
                  [&](const Json& of, const Json& inputs, const Json& gradient, std::size_t n) {
                    const SharedScene<double> at(file, of, inputs, n, gradient["eps"]);
                    const int asked = AskedOf(gradient["outputs"]);
                    ExpectShared(of, gradient, n, Reference(at.scene, at.d, asked), 1e-10, 1e-10);
                    ExpectShared(of, gradient, n, Fast(at.scene, at.d, asked), 1e-10, 1e-10);
                    ++cases;
                  });
  EXPECT_EQ(cases, 22);
}

// A cube of 2 at its face's middle, depths equal: u = 1/3 each, so corner (0,0,0) of the cube
// weighs (2/3)^3 and (1,1,1) (1/3)^3.
TEST(N3mrColors, ACubeAtTheMiddleOfItsFace) {
  const N3mrFaceT<double> face{{{0, 1, 0}, {0, 0, 1}, {2, 2, 2}}, 1, 0, false};
  const double w[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
  const auto at = N3mrTexelsAt(face, w, 2.0, 2, 1e-3);
  EXPECT_EQ(at.index[0], 0u);
  EXPECT_NEAR(at.weight[0], 8.0 / 27, 1e-15);
  EXPECT_EQ(at.index[7], 7u);
  EXPECT_NEAR(at.weight[7], 1.0 / 27, 1e-15);
  double sum = 0;
  for (const double weight : at.weight) sum += weight;
  EXPECT_NEAR(sum, 1, 1e-15);
}

// At corner 0 the texel (1,0,0) of a cube of 2 weighs 1 - eps; of a face from behind, whose drawn
// corner 0 is corner 2 as given, the texel (0,0,1).
TEST(N3mrColors, ACubeAtACornerOfItsFace) {
  N3mrFaceT<double> face{{{0, 1, 0}, {0, 0, 1}, {2, 3, 4}}, 1, 0, false};
  const double w[3] = {1, 0, 0};
  const auto weight_of = [&](std::size_t texel) {
    const auto at = N3mrTexelsAt(face, w, 2.0, 2, 0.01);
    double sum = 0;
    for (int n = 0; n < 8; ++n) sum += at.index[n] == texel ? at.weight[n] : 0;
    return sum;
  };
  EXPECT_NEAR(weight_of(4), 0.99, 1e-15);
  EXPECT_NEAR(weight_of(0), 0.01, 1e-15);
  face.reversed = true;
  EXPECT_NEAR(weight_of(1), 0.99, 1e-15);
}

template <class T>
struct RandomScene {
  std::vector<T> corners, textures, d;
  N3mrSceneRef<T> scene;

  RandomScene(N3mrReduction reduction, std::size_t faces, double extent, int size) {
    Rng rng(13);
    N3mrColors colors{.resolution = 3, .background = {0.1, 0.6, 0.3}};
    corners = RandomCorners<T>(faces, extent, &rng);
    textures = Random<T>(faces * colors.texels() * 3, 0, 1, &rng);
    d = Random<T>(4 * static_cast<std::size_t>(size * size), -1, 1, &rng);
    scene = {corners, textures, size, {.reduction = reduction}, colors};
  }
};

// Complex step: 1e-10 as for SoftRas.
TEST(N3mrColors, GradientsOfTexelsAreDerivatives) {
  for (const N3mrReduction reduction : {N3mrReduction::kMean, N3mrReduction::kBilinear}) {
    const RandomScene<double> at(reduction, 6, 0.6, 7);
    const auto color = Reference(at.scene, at.d, kColor);
    std::vector<double> d_textures(at.textures.size());
    const std::vector<Complex> corners(at.corners.begin(), at.corners.end());
    for (std::size_t i = 0; i < d_textures.size(); ++i) {
      std::vector<Complex> textures(at.textures.begin(), at.textures.end());
      textures[i] += Complex(0, 1e-30);
      std::vector<Complex> planes(3 * at.d.size() / 4);
      N3mrSceneForwardRef<Complex>(
          {corners, textures, at.scene.size, at.scene.options, at.scene.colors}, {planes, {}});
      for (std::size_t p = 0; p < planes.size(); ++p)
        d_textures[i] += at.d[p] * planes[p].imag() / 1e-30;
    }
    EXPECT_GT(Largest(d_textures), 0.1);
    EXPECT_LT(Difference(color.d_textures, d_textures), 1e-10 * Largest(d_textures));
  }
}

// Tolerances as of alpha alone (n3mr_test.cc).
TEST(N3mrColors, FastIsTheReference) {
  for (const N3mrReduction reduction :
       {N3mrReduction::kNone, N3mrReduction::kMean, N3mrReduction::kBilinear}) {
    for (const int asked : {int{kColor}, int{kAlpha}, kColor | kAlpha}) {
      const RandomScene<double> exact(reduction, 40, 0.3, 19);
      const RandomScene<float> narrow(reduction, 40, 0.3, 19);
      const auto want = Reference(exact.scene, exact.d, asked);
      const auto fast = Fast(exact.scene, exact.d, asked);
      const auto got = Fast(narrow.scene, narrow.d, asked);
      EXPECT_LT(Difference(fast.color, want.color), 1e-11);
      EXPECT_LT(Difference(got.color, want.color), 1e-4);
      EXPECT_LT(Difference(got.alpha, want.alpha), 1e-5);
      EXPECT_LT(Difference(fast.d_corners, want.d_corners), 1e-10 * Largest(want.d_corners));
      EXPECT_LT(Difference(got.d_corners, want.d_corners), 1e-3 * Largest(want.d_corners));
      EXPECT_LE(Difference(got.d_textures, want.d_textures), 1e-3 * Largest(want.d_textures));
    }
  }
}

}  // namespace tilegrad::rivals::n3mr_color_test
