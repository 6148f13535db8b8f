// SPDX-License-Identifier: Apache-2.0
// The bits of everything that the public interface computes, on every SIMD target that the machine
// has and of the reference in double, beside hashes that tests/api/fingerprints.txt holds. Other
// tests allow roundings, so that numbers may move within them unseen; here nothing moves unseen.
//
//   TILEGRAD_WRITE_FINGERPRINTS=1 build/release/tests/api/api_fingerprint_test
//
// writes the file anew, for the targets of this machine. A change of these numbers needs a reason
// in the commit message.
//
// Targets are forced in Highway itself, whose shared library is the engine's, too: so nothing is
// needed but public headers. With -ffp-contract=off, one target should give the same bits on every
// machine, but for what the C library makes of exp and log, which may be off by a rounding. Where
// that is not what it was when the file was written, the reference is skipped.
#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <tilegrad/tilegrad.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "api/fingerprint_cases.h"
#include "api/fingerprint_scenes.h"
#include "api/fingerprint_table.h"
#include "support/source_dir.h"

namespace tilegrad::test::fingerprint_test {

const std::string kFile = TILEGRAD_SOURCE_DIR "/tests/api/fingerprints.txt";
const std::string kReference = "double";  // the target of RendererT<double>

bool Writing() { return std::getenv("TILEGRAD_WRITE_FINGERPRINTS") != nullptr; }

// FNV-1a of 64 bits, array by array. An array goes on where one of the same name was before.
class Hashes {
 public:
  template <class T>
  void Add(const std::string& name, std::span<const T> values) {
    if (values.empty()) return;
    std::uint64_t& hash = hashes_.emplace(name, 0xcbf29ce484222325u).first->second;
    for (const std::byte byte : std::as_bytes(values)) {
      hash = (hash ^ static_cast<std::uint64_t>(byte)) * 0x100000001b3u;
    }
  }
  const Fingerprint& all() const { return hashes_; }

 private:
  Fingerprint hashes_;
};

template <class T>
void AddImages(const ImagesT<T>& images, Hashes* hashes) {
  hashes->Add("face_ids", images.face_ids);
  hashes->Add("color", images.color), hashes->Add("alpha", images.alpha);
  hashes->Add("attributes", images.attributes), hashes->Add("depth", images.depth);
  hashes->Add("normals", images.normals), hashes->Add("uv", images.uv);
  hashes->Add("barycentrics", images.barycentrics);
  if (images.alpha.empty()) return;
  hashes->Add("alpha_error_bound", std::span<const double>(&images.alpha_error_bound, 1));
}

// Gradients for each scene of a batch, or one set that all of them share.
template <class T>
class BatchGradients {
 public:
  BatchGradients(const Case& c, std::span<const SceneT<T>> scenes) {
    for (const SceneT<T>& scene : scenes) {
      if (owners_.empty() || !c.one_mesh) {
        owners_.push_back(std::make_unique<WantedGradients<T>>(c, scene));
      }
      views_.push_back(owners_.back()->view());
    }
  }
  std::span<const SceneGradientsT<T>> views() const { return views_; }
  void AddTo(Hashes* hashes) const {
    for (const auto& owner : owners_) {
      owner->ForEach([&](const std::string& name, std::span<const T> numbers) {
        hashes->Add("d_" + name, numbers);
      });
    }
  }

 private:
  std::vector<std::unique_ptr<WantedGradients<T>>> owners_;
  std::vector<SceneGradientsT<T>> views_;
};

template <class T>
Fingerprint RunCase(const Case& c, RendererT<T>* renderer, FrameT<T>* frame) {
  const TestBatch<T> batch(c);
  Hashes hashes;
  const Status rendered = renderer->Render(batch.scenes, c.options, c.outputs, frame);
  EXPECT_TRUE(rendered.ok()) << c.name << ": " << rendered.message();
  AddImages(frame->images(), &hashes);
  const PulledImages<T> pulled(c, frame->images());
  const BatchGradients<T> gradients(c, batch.scenes);
  const Status pulled_back = renderer->Backward(*frame, pulled.view, gradients.views(), c.mode);
  EXPECT_TRUE(pulled_back.ok()) << c.name << ": " << pulled_back.message();
  gradients.AddTo(&hashes);
  return hashes.all();
}

template <class T>
Fingerprint RunAlone(const Case& c) {
  RendererT<T> renderer({.threads = 1});
  FrameT<T> frame;
  return RunCase(c, &renderer, &frame);
}

// Has two threads, and has rendered the cases before: what they left behind may not matter either.
template <class T>
struct Reused {
  RendererT<T> renderer{{.threads = 2}};
  FrameT<T> frame;

  Fingerprint Run(const Case& c) { return RunCase(c, &renderer, &frame); }
};

// Names of arrays whose hashes differ, or that only one of two has.
std::string Differences(const Fingerprint& a, const Fingerprint& b) {
  std::string out;
  Fingerprint all = a;
  all.insert(b.begin(), b.end());
  for (const auto& [name, hash] : all) {
    const auto in_a = a.find(name), in_b = b.find(name);
    if (in_a != a.end() && in_b != b.end() && in_a->second == in_b->second) continue;
    out += (out.empty() ? "" : ", ") + name;
  }
  return out;
}

template <class T>
void AddCamera(const CameraT<T>& camera, Hashes* hashes) {
  const T lens[] = {camera.fx, camera.fy, camera.cx, camera.cy, camera.near_plane};
  hashes->Add("camera", std::span<const T>(camera.rotation));
  hashes->Add("camera", std::span<const T>(camera.translation));
  hashes->Add("camera", std::span<const T>(lens));
}

template <class T>
void AddParameters(const CameraParametersT<T>& parameters, Hashes* hashes) {
  const T lens[] = {parameters.fx, parameters.fy, parameters.cx, parameters.cy};
  hashes->Add("parameters", std::span<const T>(parameters.rotation));
  hashes->Add("parameters", std::span<const T>(parameters.translation));
  hashes->Add("parameters", std::span<const T>(lens));
}

// All functions of camera.h, one after the other.
template <class T>
void AddCameraFunctions(const Orbit& orbit, Hashes* hashes) {
  const auto made = MakeCamera<T>({.fov_y = 40, .width = 70, .height = 50}, orbit);
  ASSERT_TRUE(made.ok());
  AddCamera(*made, hashes);
  CameraParametersT<T> parameters = ParametersOf(*made);
  AddParameters(parameters, hashes);
  for (T& x : parameters.rotation) x *= T(1.25), x += T(0.0625);
  const auto moved = CameraFromParameters(parameters);
  ASSERT_TRUE(moved.ok());
  AddCamera(*moved, hashes);
  AddParameters(PullBack(parameters, *made), hashes);
}

Fingerprint FingerprintOfCameras() {
  Hashes hashes;
  for (const Orbit& orbit : {Orbit{}, Orbit{30, 20, 2}, Orbit{-125, 61, 0.5}, Orbit{200, -35, 7}}) {
    AddCameraFunctions<float>(orbit, &hashes);
    AddCameraFunctions<double>(orbit, &hashes);
  }
  return hashes.all();
}

// Of the C library, not of tilegrad.
Fingerprint FingerprintOfLibm() {
  Hashes hashes;
  for (int i = 1; i < 4000; ++i) {
    const double x = i / 256.0;
    const double values[] = {std::exp(-x), std::log(x), std::exp2(-x), std::log2(x),
                             std::sin(x),  std::cos(x), std::tan(x)};
    hashes.Add("values", std::span<const double>(values));
  }
  return hashes.all();
}

// Makes kernels use one target, the best one if it is 0.
void Force(std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

std::vector<std::string> Targets() {
  std::vector<std::string> out;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    out.emplace_back(hwy::TargetName(target));
  }
  out.push_back(kReference);
  return out;
}

void ForceByName(const std::string& name) {
  Force(0);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    if (name == hwy::TargetName(target)) return Force(target);
  }
}

class ApiFingerprint : public testing::TestWithParam<std::string> {
 protected:
  static void SetUpTestSuite() { table_ = FingerprintTable::Read(kFile); }
  static void TearDownTestSuite() {
    if (!Writing()) return;
    EXPECT_TRUE(table_.Write(kFile)) << kFile;
  }
  void SetUp() override { ForceByName(target_); }
  void TearDown() override { Force(0); }

  // Why there is nothing to compare with; empty if there is.
  std::string WhyNot() const {
    if (Writing()) return "";
    if (!table_.HasTarget(target_)) return "fingerprints.txt has no hashes of " + target_;
    const bool same = FingerprintOfLibm() == table_.Get(kReference, "libm");
    if (target_ != kReference || same) return "";
    return "fingerprints.txt was made with another C library, whose exp and log differ";
  }

  void Check(const std::string& name, const Fingerprint& got) {
    if (Writing()) return table_.Set(target_, name, got);
    EXPECT_EQ(Differences(got, table_.Get(target_, name)), "")
        << "bits of case " << name << " on " << target_ << " are not those of fingerprints.txt";
  }

  void CheckEngine() {
    Reused<float> reused;
    for (const Case& c : FingerprintCases()) {
      const Fingerprint alone = RunAlone<float>(c);
      EXPECT_EQ(Differences(alone, reused.Run(c)), "")
          << "bits of case " << c.name << " on " << target_ << " depend on threads";
      Check(c.name, alone);
    }
  }

  // Which is slow: every other case with two threads.
  void CheckReference() {
    Reused<double> reused;
    bool two_threads = false;
    for (const Case& c : FingerprintCases()) {
      Check(c.name, two_threads ? reused.Run(c) : RunAlone<double>(c));
      two_threads = !two_threads;
    }
    Check("cameras", FingerprintOfCameras());
    Check("libm", FingerprintOfLibm());
  }

  const std::string target_ = GetParam();
  static inline FingerprintTable table_;
};

TEST_P(ApiFingerprint, BitsAreThoseOfTheFile) {
  if (const std::string why = WhyNot(); !why.empty()) {
    std::cerr << "skipped: " << why << "\n";  // --gtest_brief does not show it
    GTEST_SKIP() << why;
  }
  if (Writing()) table_.Forget(target_);
  target_ == kReference ? CheckReference() : CheckEngine();
}

INSTANTIATE_TEST_SUITE_P(Targets, ApiFingerprint, testing::ValuesIn(Targets()),
                         [](const auto& target) { return target.param; });

TEST(ApiFingerprintCases, HaveNamesOfTheirOwn) {
  std::set<std::string> names;
  for (const Case& c : FingerprintCases()) EXPECT_TRUE(names.insert(c.name).second) << c.name;
}

}  // namespace tilegrad::test::fingerprint_test
