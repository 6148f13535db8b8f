// SPDX-License-Identifier: Apache-2.0
// Cameras of pictures that came without.
#include "fit/poses/find_poses.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "fit/poses/crop.h"
#include "fit/poses/start_cameras.h"
#include "fit/score.h"
#include "fit/views_fixture.h"

namespace tilegrad::train::find_poses_test {

// Boxes of several colours: no two sides look alike.
Mesh Thing() {
  Mesh mesh = Box({0, 0, 0}, {0.8f, 0.4f, 0.5f});
  SetColor(mesh, {0.8f, 0.3f, 0.2f, 1});
  const auto add = [&](glm::vec3 centre, glm::vec3 size, glm::vec4 color) {
    Mesh box = Box(centre, size);
    SetColor(box, color);
    Append(mesh, box);
  };
  add({0.3f, 0.3f, 0.1f}, {0.2f, 0.3f, 0.25f}, {0.2f, 0.4f, 0.8f, 1});
  add({-0.2f, 0.0f, 0.35f}, {0.3f, 0.3f, 0.25f}, {0.9f, 0.85f, 0.2f, 1});
  add({-0.35f, -0.1f, -0.3f}, {0.1f, 0.2f, 0.3f}, {0.2f, 0.7f, 0.3f, 1});
  return mesh;
}

// Strips of pictures were divided by more than their height.
TEST(PosePictures, KeepTheShorterSide) {
  for (const auto& [width, height] : {std::pair(200, 2), {128, 1}, {1, 300}}) {
    TargetImages strip;
    strip.width = width;
    strip.height = height;
    strip.alpha.assign(strip.pixels(), 1.0f);
    strip.color.assign(3 * strip.pixels(), 0.5f);
    const Camera lens = OrbitCamera({50, width, height}, 0, 0, 2);
    const auto pictures = Ok(PreparePictures(strip, std::span(&lens, 1), 16));
    EXPECT_EQ(std::min(pictures->images.width, pictures->images.height), 1);
  }
}

class Poses : public ViewsTest {
 protected:
  FitInput Pictures(int views) {
    return Views(Thing(),
                 {.views = views, .held_out = 2, .size = 64, .lowest = -20, .highest = 60});
  }
  InputPosesJob Job() const {
    InputPosesJob job;
    job.file = folder_ / "run" / "cameras_start.json";
    return job;
  }
  Status Find(const InputPosesJob& job, FitInput* input, int workers = 2) {
    const Workers w(workers);
    return FindInputPoses(job, input, w, {}, stop_);
  }
  // Of two starts: the numbers of the searches that were begun, of which `last` stops the call.
  std::vector<std::uint64_t> SearchesUntil(std::uint64_t last, InputPosesJob job, FitInput* input) {
    job.options.starts = 2;
    job.options.sweeps = 1;
    std::vector<std::uint64_t> begun;
    const auto tell = [&](const Progress& p) {
      if (p.stage != "looking for cameras") return;
      begun.push_back(p.done);
      stop_ = p.done == last;
    };
    const Workers workers(2);
    const Status done = FindInputPoses(job, input, workers, tell, stop_);
    EXPECT_EQ(done.code(), stop_ ? StatusCode::kCancelled : StatusCode::kOk) << done.message();
    stop_ = false;
    return begun;
  }
};

using Numbers = std::vector<std::uint64_t>;

double MeanError(const FitInput& input) {
  std::vector<Camera> found, given;
  for (const int i : input.training) {
    found.push_back(input.cameras[static_cast<std::size_t>(i)]);
    given.push_back(input.given_cameras[static_cast<std::size_t>(i)]);
  }
  const Similarity alignment = AlignCameras(found, given);
  double sum = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    sum += AngleBetween(Moved(found[i], alignment), given[i]) / static_cast<double>(found.size());
  }
  return sum;
}

TEST_F(Poses, AreFoundFromMasksAndColours) {
  FitInput input = Pictures(20);
  // What the search must not see.
  const std::vector<Camera> given = input.cameras;
  for (const int i : input.training) {
    Camera& c = input.cameras[static_cast<std::size_t>(i)];
    std::fill_n(c.rotation, 9, std::numeric_limits<float>::quiet_NaN());
    std::fill_n(c.translation, 3, std::numeric_limits<float>::quiet_NaN());
  }
  InputPosesJob job = Job();
  job.options.starts = 1;
  Ok(Find(job, &input));
  input.given_cameras = given;
  EXPECT_LT(MeanError(input), 3);
  for (const Camera& camera : input.cameras) EXPECT_EQ(camera.fx, given[0].fx);
}

TEST_F(Poses, HeldOutCamerasFollow) {
  FitInput input = Pictures(12);
  InputPosesJob job = Job();
  job.options.starts = job.options.sweeps = 1;
  ASSERT_TRUE(Find(job, &input).ok());
  ASSERT_EQ(input.given_cameras.size(), 14u);
  EXPECT_TRUE(input.found);
  // The world moves with the training views, so what is between held-out cameras stays.
  const auto at = [](const std::vector<Camera>& c, int i) {
    return c[static_cast<std::size_t>(i)];
  };
  const int a = input.held_out[0], b = input.held_out[1];
  EXPECT_NEAR(AngleBetween(at(input.cameras, a), at(input.cameras, b)),
              AngleBetween(at(input.given_cameras, a), at(input.given_cameras, b)), 0.05);
}

TEST_F(Poses, SameBitsForAnyWorkersAndFromTheFile) {
  const FitInput input = Pictures(8);
  InputPosesJob job = Job();
  job.options.starts = job.options.sweeps = 1;
  FitInput one = input, two = input, again = input;
  ASSERT_TRUE(Find(job, &one, 1).ok());
  job.file = folder_ / "other" / "cameras_start.json";
  ASSERT_TRUE(Find(job, &two, 2).ok());
  job.reuse = true;
  ASSERT_TRUE(Find(job, &again, 1).ok());
  for (std::size_t i = 0; i < input.cameras.size(); ++i) {
    EXPECT_EQ(std::memcmp(&one.cameras[i], &two.cameras[i], sizeof(Camera)), 0) << i;
    EXPECT_EQ(std::memcmp(&one.cameras[i], &again.cameras[i], sizeof(Camera)), 0) << i;
  }
  // One that does not fit these images.
  Write("other/cameras_start.json", std::string(R"({"agreement": 1, "poses": [[1, 2]]})"));
  FitInput broken = input;
  ExpectMessage(Find(job, &broken), "8 poses of twelve numbers");
}

// The searches that a stopped call came through are not done again.
TEST_F(Poses, AStoppedSearchGoesOnToTheSameBits) {
  const FitInput input = Pictures(8);
  FitInput whole = input, stopped = input, parts = input;
  InputPosesJob job = Job();
  EXPECT_EQ(SearchesUntil(9, job, &whole), (Numbers{0, 1}));
  job.file = folder_ / "other" / "cameras_start.json";
  EXPECT_EQ(SearchesUntil(1, job, &stopped), (Numbers{0, 1}));
  job.reuse = true;
  EXPECT_EQ(SearchesUntil(9, job, &parts), Numbers{1});
  for (std::size_t i = 0; i < input.cameras.size(); ++i)
    EXPECT_EQ(std::memcmp(&whole.cameras[i], &parts.cameras[i], sizeof(Camera)), 0) << i;
}

// Of other images it says nothing.
TEST_F(Poses, AStoppedSearchOfOtherImagesBeginsAnew) {
  FitInput input = Pictures(8), other = input;
  InputPosesJob job = Job();
  EXPECT_EQ(SearchesUntil(1, job, &other), (Numbers{0, 1}));
  input.images.color[3] += 0.25f;
  job.reuse = true;
  EXPECT_EQ(SearchesUntil(1, job, &input), (Numbers{0, 1}));
}

TEST_F(Poses, SaysWhatIsMissing) {
  FitInput few = Pictures(5);
  ExpectMessage(Find(Job(), &few), "6 or more are needed");
  FitInput empty = Pictures(8);
  std::fill_n(empty.images.alpha.begin(), empty.images.pixels(), 0.0f);
  ExpectMessage(Find(Job(), &empty), "its mask is empty");
  FitInput bare = empty;
  bare.masked = false;
  ExpectMessage(Find(Job(), &bare), "plain background");
  FitInput stopped = Pictures(8);
  stop_ = true;
  EXPECT_EQ(Find(Job(), &stopped).code(), StatusCode::kCancelled);
}

// An object of 20 x 10 pixels at (left, top): red, the right half blue.
TargetImages Picture(int side, int left, int top, int scale) {
  TargetImages out;
  out.width = out.height = side;
  out.color.resize(3 * out.pixels());
  out.alpha.resize(out.pixels());
  for (int y = top; y < top + 10 * scale; ++y) {
    for (int x = left; x < left + 20 * scale; ++x) {
      const auto p = static_cast<std::size_t>(y * side + x);
      out.alpha[p] = 1;
      out.color[(x < left + 10 * scale ? 0 : 2) * out.pixels() + p] = 1;
    }
  }
  return out;
}

TEST(PoseCrop, DoesNotDependOnPlaceAndSize) {
  Camera camera;
  const TargetImages a = Picture(128, 20, 30, 1), b = Picture(128, 60, 70, 3);
  const auto crop_a = CropOf({128, 128, a.color, a.alpha}, camera);
  const auto crop_b = CropOf({128, 128, b.color, b.alpha}, camera);
  ASSERT_TRUE(crop_a.has_value() && crop_b.has_value());
  EXPECT_LT(CropCost(*crop_a, *crop_b, 1), 0.1);
  EXPECT_NEAR(crop_b->side / crop_a->side, 3, 1e-6);
  // Blue and red changed: the mask agrees, the colours do not.
  TargetImages c = a;
  std::swap_ranges(c.color.begin(), c.color.begin() + static_cast<std::ptrdiff_t>(c.pixels()),
                   c.color.begin() + static_cast<std::ptrdiff_t>(2 * c.pixels()));
  const auto crop_c = CropOf({128, 128, c.color, c.alpha}, camera);
  EXPECT_GT(CropCost(*crop_a, *crop_c, 1), 0.5);
  EXPECT_FALSE(CropOf({128, 128, a.color, std::vector<float>(a.pixels())}, camera).has_value());
}

// A point at the middle of what was seen lands at the middle of what is wanted.
TEST(PoseCrop, AlignedCamerasSeeItWhereItIsWanted) {
  const Camera from = OrbitCamera({45, 64, 64}, 30, 20, 2);
  Crop seen, wanted;
  seen.side = 0.5;
  wanted.x = 0.2;
  wanted.y = -0.1;
  wanted.side = 0.25;
  const Camera camera = Aligned(seen, wanted, from);
  EXPECT_NEAR(-camera.translation[0] / camera.translation[2], 0.2, 1e-6);
  EXPECT_NEAR(-camera.translation[1] / camera.translation[2], -0.1, 1e-6);
  // Half as large: twice as far away.
  EXPECT_NEAR(std::hypot(camera.translation[0], camera.translation[1], camera.translation[2]), 4,
              1e-5);
}

}  // namespace tilegrad::train::find_poses_test
