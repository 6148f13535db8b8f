// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "base/rng.h"
#include "fit/masks/find_masks.h"
#include "fit/masks/floor.h"
#include "fit/masks/holes.h"
#include "fit/masks/start_masks.h"
#include "fit/views_fixture.h"

namespace tilegrad::train::masks_test {

constexpr int kWide = 96, kHigh = 72, kViews = 12;
constexpr float kFloor = -0.35f;  // below the middle
constexpr double kRadius = 0.3;

enum class Place { kPaper, kTable, kRoom };
enum class Thing {
  kBall,
  kLined,    // a ball with a blind hole, whose bottom nearly has the colour of the table
  kDrilled,  // a ball with a straight hole, through which the first view looks
};
constexpr float kDrill = 0.17f, kBottom = 0.15f;  // radius of a hole; from the ball's middle
constexpr glm::vec3 kWood = {0.65f, 0.5f, 0.35f};

// Blots, by bilinear interpolation of random numbers on a lattice.
float Blots(glm::vec3 p, float per_unit, std::uint64_t channel) {
  const glm::vec3 at = per_unit * p, low = glm::floor(at);
  float sum = 0;
  for (int k = 0; k < 8; ++k) {
    const glm::vec3 corner = low + glm::vec3(k & 1, k >> 1 & 1, k >> 2);
    const glm::vec3 share = glm::vec3(1) - glm::abs(at - corner);
    const auto key = static_cast<std::int64_t>(corner.x) * 73856093 ^
                     static_cast<std::int64_t>(corner.y) * 19349663 ^
                     static_cast<std::int64_t>(corner.z) * 83492791;
    Rng rng(static_cast<std::uint64_t>(key), channel);
    sum += share.x * share.y * share.z * static_cast<float>(rng.Uniform());
  }
  return sum;
}

glm::vec3 Blotted(glm::vec3 base, float strength, glm::vec3 p, float per_unit) {
  return base + strength * (glm::vec3(Blots(p, per_unit, 1), Blots(p, per_unit, 2),
                                      Blots(p, per_unit, 3)) -
                            0.5f);
}

// A ball half red, half blue, above a floor with a soft shadow, in a room that is a ball, too.
class Capture {
 public:
  explicit Capture(Place place, Thing thing = Thing::kBall) : place_(place), thing_(thing) {
    input_.images.width = kWide;
    input_.images.height = kHigh;
    for (int v = 0; v < kViews; ++v) AddView(v);
    input_.images.alpha.assign(truth_.size(), 1.0f);
    input_.seeks_masks = true;
  }

  const FitInput& input() const { return input_; }

  // Share of the pixels that show the lining, or the room through the hole, that masks hold.
  double Held(std::span<const float> alpha) const {
    double held = 0, all = 0;
    for (std::size_t p = 0; p < special_.size(); ++p) {
      all += special_[p];
      held += special_[p] && alpha[p] >= 0.5f;
    }
    EXPECT_GT(all, 60);
    return held / all;
  }

  const std::vector<float>& truth() const { return truth_; }

 private:
  void AddView(int v) {
    const Lens lens{45, kWide, kHigh};
    input_.cameras.push_back(OrbitCamera(lens, 360.0 * v / kViews, v % 2 ? 45 : 20, 1.7));
    input_.names.push_back("view " + std::to_string(v));
    input_.training.push_back(v);
    Rng noise(7, static_cast<std::uint64_t>(v));
    std::vector<float> planes(std::size_t{3} * kWide * kHigh);
    for (int p = 0; p < kWide * kHigh; ++p) {
      const glm::vec3 color = Trace(input_.cameras.back(), p % kWide + 0.5f, p / kWide + 0.5f);
      for (int c = 0; c < 3; ++c)
        planes[static_cast<std::size_t>(c * kWide * kHigh + p)] =
            std::clamp(color[c] + 0.012f * static_cast<float>(noise.Normal()), 0.0f, 1.0f);
    }
    input_.images.color.insert(input_.images.color.end(), planes.begin(), planes.end());
  }

  glm::vec3 Trace(const Camera& c, float x, float y) {
    const float* r = c.rotation;
    const auto row = [&](int i) { return glm::vec3(r[3 * i], r[3 * i + 1], r[3 * i + 2]); };
    glm::vec3 eye(0);
    for (int i = 0; i < 3; ++i) eye -= c.translation[i] * row(i);
    const glm::vec3 ray =
        glm::normalize((x - c.cx) / c.fx * row(0) - (y - c.cy) / c.fy * row(1) - row(2));
    if (input_.cameras.size() == 1) axis_ = glm::normalize(eye);
    const float ball = Hit(eye, ray, static_cast<float>(kRadius), -1);
    const bool through = ball > 0 && thing_ == Thing::kDrilled && Through(eye, ray);
    const bool lining = ball > 0 && thing_ == Thing::kLined && IsLining(eye + ball * ray, ray);
    truth_.push_back(ball > 0 && !through ? 1.0f : 0.0f);
    special_.push_back(through || lining);
    if (lining) return 0.95f * kWood;
    if (ball > 0 && !through) return Ball(eye + ball * ray);
    const float down = (kFloor - eye.y) / ray.y;
    const glm::vec3 floor = eye + down * ray;
    if (place_ != Place::kPaper && down > 0 && std::hypot(floor.x, floor.z) < FloorRadius())
      return FloorColor(floor);
    return Wall(eye + Hit(eye, ray, 4, 1) * ray);
  }

  // Along a ray, to the nearer (-1) or farther side of a ball around the origin; 0 beside it.
  static float Hit(glm::vec3 eye, glm::vec3 ray, float radius, float side) {
    const float b = glm::dot(eye, ray), d = b * b - glm::dot(eye, eye) + radius * radius;
    return d > 0 ? -b + side * std::sqrt(d) : 0;
  }
  // Whether a ray that meets the ball leaves it by the hole's other end, having entered by one.
  bool Through(glm::vec3 eye, glm::vec3 ray) const {
    const auto aside = [&](float side) {
      const glm::vec3 p = eye + Hit(eye, ray, static_cast<float>(kRadius), side) * ray;
      return glm::length(p - glm::dot(p, axis_) * axis_);
    };
    return std::max(aside(-1), aside(1)) < kDrill;
  }
  // Whether a ray that meets the ball at `p` meets the blind hole's bottom.
  static bool IsLining(glm::vec3 p, glm::vec3 ray) {
    const glm::vec3 axis(0.342f, 0.940f, 0);
    const auto is_within = [&](glm::vec3 q) {
      return glm::length(q - glm::dot(q, axis) * axis) < kDrill;
    };
    const float height = glm::dot(p, axis);
    return height > kBottom && is_within(p) &&
           is_within(p - (height - kBottom) / glm::dot(ray, axis) * ray);
  }
  float FloorRadius() const { return place_ == Place::kTable ? 0.9f : 3.0f; }

  static glm::vec3 Ball(glm::vec3 p) {
    const float light = 0.75f + 0.8f * p.y;
    return light *
           (p.x + p.y > 0.05f ? glm::vec3(0.85f, 0.2f, 0.15f) : glm::vec3(0.2f, 0.3f, 0.8f));
  }
  glm::vec3 FloorColor(glm::vec3 p) const {
    const float dark = 0.55f / (1 + std::exp(8 * (std::hypot(p.x, p.z) / 0.32f - 1)));
    const glm::vec3 wood = place_ == Place::kTable ? Blotted(kWood, 0.12f, p, 9)
                                                   : Blotted({0.5f, 0.5f, 0.45f}, 0.5f, p, 6);
    return (1 - dark) * wood;
  }
  glm::vec3 Wall(glm::vec3 p) const {
    if (place_ == Place::kPaper) return glm::vec3(0.75f, 0.72f, 0.7f) + 0.02f * p.y;
    if (place_ == Place::kTable) return Blotted({0.45f, 0.6f, 0.5f}, 0.15f, p, 0.7f);
    return Blotted({0.5f, 0.5f, 0.5f}, 0.8f, p, 1.5f);
  }

  Place place_;
  Thing thing_;
  glm::vec3 axis_{0};  // of the hole
  FitInput input_;
  std::vector<float> truth_;  // masks
  std::vector<bool> special_;
};

TEST(FitMasks, AreFoundBeforePaperOnATableAndInARoom) {
  const Workers workers(2);
  const std::pair<Place, double> cases[] = {
      {Place::kPaper, 0.95}, {Place::kTable, 0.9}, {Place::kRoom, 0.85}};
  for (const auto& [place, least] : cases) {
    const Capture capture(place);
    const auto found = Ok(FindMasks(capture.input(), workers));
    EXPECT_GT(MaskIou(found->alpha, capture.truth()), least) << static_cast<int>(place);
    for (const double agreement : found->agreement) EXPECT_GT(agreement, 0.8);
  }
}

TEST(FitMasks, HoldWhatHasTheColourOfTheTable) {
  const Capture capture(Place::kTable, Thing::kLined);
  const auto found = Ok(FindMasks(capture.input(), Workers(2)));
  EXPECT_GT(capture.Held(found->alpha), 0.6);  // 0.1 without
  EXPECT_GT(MaskIou(found->alpha, capture.truth()), 0.91);
}

TEST(FitMasks, KeepHolesThatShowTheFloor) {
  const Capture capture(Place::kRoom, Thing::kDrilled);
  const auto found = Ok(FindMasks(capture.input(), Workers(2)));
  EXPECT_LT(capture.Held(found->alpha), 0.3);
  EXPECT_GT(MaskIou(found->alpha, capture.truth()), 0.85);
}

// A square frame of 3 pixels around 9 x 9, with a gap of `gap` pixels on the left.
std::vector<float> Frame(int gap) {
  std::vector<float> out(24 * 20);
  for (int y = 3; y < 18; ++y) {
    for (int x = 3; x < 18; ++x) {
      const bool within = x >= 6 && x < 15 && y >= 6 && y < 15;
      const bool open = x < 6 && y >= 8 && y < 8 + gap;
      out[static_cast<std::size_t>(24 * y + x)] = within || open ? 0.2f : 0.9f;
    }
  }
  return out;
}

TEST(MaskHoles, AreWhatOnlyNarrowGapsJoinToTheBorder) {
  for (const int gap : {0, 4}) {
    const std::vector<Hole> holes = HolesOf(Frame(gap), {24, 20});
    ASSERT_EQ(holes.size(), 1u) << gap;
    EXPECT_EQ(holes[0].core.size(), 25u);
    EXPECT_EQ(holes[0].pixels.size(), 81u);
  }
  EXPECT_TRUE(HolesOf(Frame(5), {24, 20}).empty());
  EXPECT_TRUE(HolesOf(std::vector<float>(480), {24, 20}).empty());
}

TEST(FitMasks, AreTheSameForAnyNumberOfWorkers) {
  const Capture capture(Place::kTable);
  const auto one = Ok(FindMasks(capture.input(), Workers(1))),
             three = Ok(FindMasks(capture.input(), Workers(3)));
  EXPECT_EQ(one->alpha, three->alpha);
  EXPECT_EQ(one->agreement, three->agreement);
}

TEST(FitMasks, StopWhenTold) {
  const Capture capture(Place::kPaper);
  StopFlag stop = false;
  int seen = 0;
  const auto sink = [&](const Progress& now) {
    EXPECT_EQ(now.stage, "finding masks");
    stop = ++seen == 3;
  };
  EXPECT_EQ(FindMasks(capture.input(), Workers(1), {sink, &stop}).status().code(),
            StatusCode::kCancelled);
  EXPECT_EQ(seen, 3);
}

TEST(FitMasks, AFloorStandsOutWhereThereIsOne) {
  for (const Place place : {Place::kTable, Place::kRoom, Place::kPaper}) {
    const FitInput input = Capture(place).input();
    const Workers workers(1);
    const Floor floor(input.images, input.cameras, {{0, 0, 0}, 0.9f, UpOf(input.cameras)}, workers);
    EXPECT_EQ(floor.found(), place != Place::kPaper);
    if (floor.found()) {
      EXPECT_NEAR(floor.height(), kFloor, 0.02f);
    }
    const glm::vec3 up = UpOf(input.cameras);
    EXPECT_NEAR(up.y, 1, 1e-4f);
  }
}

// Ten masks of 8 x 8 pixels that cover their columns from the first one on.
FitInput MasksOfColumns(int first) {
  FitInput input;
  input.images.width = input.images.height = 8;
  for (int v = 0; v < 10; ++v) {
    input.names.push_back(std::to_string(v));
    for (int p = 0; p < 64; ++p) {
      const int x = p % 8, y = p / 8;
      input.images.alpha.push_back(x >= first && x < 7 && y > 0 && y < 7 ? 1.0f : 0.0f);
    }
  }
  return input;
}

TEST(MaskBorders, TellWhatIsCutOffOrInverted) {
  FitInput input = MasksOfColumns(1);
  DoubtBorders(&input);
  EXPECT_TRUE(input.warnings.empty());
  for (float& a : input.images.alpha) a = 1 - a;
  DoubtBorders(&input);
  ExpectOnly(input.warnings, "cover the border of 10 of 10 images", "inverted");
  input = MasksOfColumns(0);
  DoubtBorders(&input);
  ExpectOnly(input.warnings, "reach the border of 10 of 10 images, such as 0");
}

class FitMaskFiles : public TempFolderTest {
 protected:
  void SetUp() override {
    TempFolderTest::SetUp();
    job_.input = Capture(Place::kPaper).input();
    job_.out = folder_ / "fit";
  }
  Status Start(bool resume) { return StartMasks(resume, &job_, Workers(2), {}); }

  FitJob job_;
};

TEST_F(FitMaskFiles, AreReadBackToTheBit) {
  FitInput again = job_.input;
  ASSERT_TRUE(Start(false).ok());
  EXPECT_TRUE(job_.input.masked);
  EXPECT_FALSE(job_.input.seeks_masks);
  EXPECT_GT(job_.input.mask_agreement.value_or(0), 0.8);
  ASSERT_TRUE(ReadMasks(job_.out / "masks", &again).ok());
  EXPECT_EQ(again.images.alpha, job_.input.images.alpha);
  // Going on takes them from there.
  std::ranges::fill(again.images.alpha, 1.0f);
  std::swap(again, job_.input);
  ASSERT_TRUE(Start(true).ok());
  EXPECT_EQ(again.images.alpha, job_.input.images.alpha);
  EXPECT_FALSE(job_.input.mask_agreement.has_value());
  std::filesystem::remove(job_.out / "masks" / "view 3.png");
  ExpectMessage(ReadMasks(job_.out / "masks", &again), "view 3.png: no such mask");
}

TEST_F(FitMaskFiles, AreSoughtWhereNoImageHasOne) {
  EXPECT_TRUE(SeekMasks(Background::kAuto, &job_.input).ok());
  EXPECT_TRUE(job_.input.seeks_masks);
  EXPECT_TRUE(CheckFit(job_).ok());
  const auto prepared = PrepareFit(job_, Workers(1));
  EXPECT_EQ(prepared.status().message(),
            "the images have no masks, which `tilegrad fit` would look for first");
  job_.input.posed = false;
  EXPECT_TRUE(SeekMasks(Background::kAuto, &job_.input).ok());
  EXPECT_FALSE(job_.input.seeks_masks);
  EXPECT_EQ(SeekMasks(Background::kViews, &job_.input).message(),
            "--background views takes cameras and at least 6 images; there are 12 images without "
            "cameras");
  job_.input.posed = true;
  job_.input.images.alpha[5] = 0;
  EXPECT_TRUE(SeekMasks(Background::kAuto, &job_.input).ok());
  EXPECT_FALSE(job_.input.seeks_masks);
}

}  // namespace tilegrad::train::masks_test
