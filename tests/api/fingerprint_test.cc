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

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <memory>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "api/fingerprint_cases.h"
#include "api/fingerprint_scenes.h"
#include "support/source_dir.h"

namespace tilegrad::test::fingerprint_test {

const std::string kFile = TILEGRAD_SOURCE_DIR "/tests/api/fingerprints.txt";
const std::string kReference = "double";  // the target of RendererT<double>

bool Writing() { return std::getenv("TILEGRAD_WRITE_FINGERPRINTS") != nullptr; }

// FNV-1a of 64 bits.
class Fnv {
 public:
  template <class T>
  void Add(std::span<const T> values) {
    for (const std::byte byte : std::as_bytes(values)) {
      hash_ = (hash_ ^ static_cast<std::uint64_t>(byte)) * 0x100000001b3u;
    }
  }
  std::uint64_t hash() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

// Of arrays by name. An array goes on where one of the same name was before.
class Hashes {
 public:
  template <class T>
  void Add(const std::string& name, std::span<const T> values) {
    if (!values.empty()) arrays_[name].Add(values);
  }
  // Of all arrays, and their names.
  std::string Text() const {
    Fnv all;
    for (const auto& [name, array] : arrays_) {
      const std::uint64_t hash = array.hash();
      all.Add(std::span<const char>(name));
      all.Add(std::span<const std::uint64_t>(&hash, 1));
    }
    std::ostringstream out;
    out << std::hex << std::setw(16) << std::setfill('0') << all.hash();
    return out.str();
  }

 private:
  std::map<std::string, Fnv> arrays_;
};

// A row for each case, a column for each target.
struct Table {
  std::vector<std::string> targets;
  std::map<std::string, std::map<std::string, std::string>> rows;  // by name and target

  static Table Read() {
    Table table;
    std::ifstream file(kFile);
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      std::string name, word;
      words >> name;
      if (name == "#") continue;
      for (std::size_t i = 0; words >> word; ++i) {
        if (name == "case") table.targets.push_back(word);
        if (name != "case" && word != "-") table.rows[name][table.targets.at(i)] = word;
      }
    }
    return table;
  }
  void Write() const {
    std::ofstream file(kFile);
    file << "# Hashes of the bits of images and gradients of the cases of fingerprint_cases.h, by "
            "target;\n# \"double\" is the scalar reference, - none. Written by "
            "fingerprint_test.cc: a change needs a\n# reason in the commit message.\ncase";
    for (const std::string& target : targets) file << ' ' << target;
    for (const auto& [name, hashes] : rows) {
      file << '\n' << name;
      for (const std::string& target : targets) {
        const auto hash = hashes.find(target);
        file << ' ' << (hash == hashes.end() ? "-" : hash->second);
      }
    }
    EXPECT_TRUE(file << std::endl) << kFile;
  }
  bool Has(const std::string& target) const {
    return std::find(targets.begin(), targets.end(), target) != targets.end();
  }
};

template <class T>
void AddImages(const ImagesT<T>& images, Hashes* hashes) {
  hashes->Add("face_ids", images.face_ids);
  hashes->Add("color", images.color);
  hashes->Add("alpha", images.alpha);
  hashes->Add("attributes", images.attributes);
  hashes->Add("depth", images.depth);
  hashes->Add("normals", images.normals);
  hashes->Add("uv", images.uv);
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

using Fingerprint = std::map<std::string, std::string>;  // rows of a target

template <class T>
Fingerprint RunCase(const Case& c, RendererT<T>* renderer, FrameT<T>* frame) {
  const TestBatch<T> batch(c);
  Hashes images, d_scenes;
  const Status rendered = renderer->Render(batch.scenes, c.options, c.outputs, frame);
  EXPECT_TRUE(rendered.ok()) << c.name << ": " << rendered.message();
  AddImages(frame->images(), &images);
  const PulledImages<T> pulled(c, frame->images());
  const BatchGradients<T> gradients(c, batch.scenes);
  const Status pulled_back = renderer->Backward(*frame, pulled.view, gradients.views(), c.mode);
  EXPECT_TRUE(pulled_back.ok()) << c.name << ": " << pulled_back.message();
  gradients.AddTo(&d_scenes);
  return {{c.name + "/images", images.Text()}, {c.name + "/gradients", d_scenes.Text()}};
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

// Of the C library, not of tilegrad.
std::string HashOfLibm() {
  Hashes hashes;
  for (int i = 1; i < 4000; ++i) {
    const double x = i / 256.0;
    const double values[] = {std::exp(-x), std::log(x), std::exp2(-x), std::log2(x),
                             std::sin(x),  std::cos(x), std::tan(x)};
    hashes.Add("values", std::span<const double>(values));
  }
  return hashes.Text();
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
  static void SetUpTestSuite() { table_ = Table::Read(); }
  static void TearDownTestSuite() {
    if (Writing()) table_.Write();
  }
  void SetUp() override { ForceByName(target_); }
  void TearDown() override { Force(0); }

  // Why there is nothing to compare with; empty if there is.
  std::string WhyNot() const {
    if (Writing()) return "";
    if (!table_.Has(target_)) return "fingerprints.txt has no hashes of " + target_;
    if (target_ != kReference || HashOfLibm() == table_.rows["libm"][kReference]) return "";
    return "fingerprints.txt was made with another C library, whose exp and log differ";
  }

  void Check(const Fingerprint& got) {
    for (const auto& [name, hash] : got) {
      std::string& expected = table_.rows[name][target_];
      if (Writing()) expected = hash;
      EXPECT_EQ(hash, expected) << "bits of " << name << " on " << target_
                                << " are not those of fingerprints.txt";
    }
  }

  void CheckEngine() {
    Reused<float> reused;
    for (const Case& c : kFingerprintCases) {
      const Fingerprint alone = RunAlone<float>(c);
      EXPECT_EQ(alone, reused.Run(c)) << "bits on " << target_ << " depend on threads";
      Check(alone);
    }
  }

  // Which is slow: every other case with two threads.
  void CheckReference() {
    Reused<double> reused;
    bool two_threads = false;
    for (const Case& c : kFingerprintCases) {
      Check(two_threads ? reused.Run(c) : RunAlone<double>(c));
      two_threads = !two_threads;
    }
    Check({{"libm", HashOfLibm()}});
  }

  const std::string target_ = GetParam();
  static inline Table table_;
};

TEST_P(ApiFingerprint, BitsAreThoseOfTheFile) {
  if (const std::string why = WhyNot(); !why.empty()) {
    std::cerr << "skipped: " << why << "\n";  // --gtest_brief does not show it
    GTEST_SKIP() << why;
  }
  if (Writing() && !table_.Has(target_)) table_.targets.push_back(target_);
  target_ == kReference ? CheckReference() : CheckEngine();
}

INSTANTIATE_TEST_SUITE_P(Targets, ApiFingerprint, testing::ValuesIn(Targets()),
                         [](const auto& target) { return target.param; });

}  // namespace tilegrad::test::fingerprint_test
