// SPDX-License-Identifier: Apache-2.0
// tilegrad selftest: that it holds here, what its command line does, that each check fails where a
// result that it looks at is wrong, and that nothing stays behind.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <regex>

#include "base/simd_target.h"
#include "proof/selftest/check.h"
#include "proof/tradeoff.h"
#include "scene/camera.h"
#include "scene/shapes.h"
#include "support/expect.h"
#include "support/run_program.h"
#include "support/temp_folder.h"

namespace tilegrad::selftest_test {

using selftest::Check;
using selftest::CheckContext;
using selftest::Numbers;

std::size_t Count(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; ++at) ++count;
  return count;
}

// ---- The program ----

class SelftestCommand : public TempFolderTest {
 protected:
  SelftestCommand() {
    ::unsetenv("TILEGRAD_TARGET");
    ::setenv("TMPDIR", folder_.c_str(), 1);
  }
  ~SelftestCommand() override {
    ::unsetenv("TILEGRAD_TARGET");
    ::unsetenv("TMPDIR");
  }
};

TEST_F(SelftestCommand, AllChecksHoldOnEveryTargetAndNothingStaysBehind) {
  const Outcome outcome = RunProgram("selftest");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  const std::size_t count = selftest::AllChecks().size();
  EXPECT_EQ(Count(outcome.output, "ok    "), count) << outcome.output;
  EXPECT_TRUE(std::regex_search(outcome.output, std::regex("\nall " + std::to_string(count) +
                                                           R"( checks hold \(\d+\.\d s\)\n$)")));
  for (const Check& check : selftest::AllChecks()) ExpectIn(outcome.output, "ok    " + check.title);
  for (const auto& target : RunnableTargets()) {
    const std::regex fingerprint(target + " [0-9a-f]{8}[,) ]");
    EXPECT_EQ(std::distance(
                  std::sregex_iterator(outcome.output.begin(), outcome.output.end(), fingerprint),
                  std::sregex_iterator()),
              2)
        << target;
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(SelftestCommand, AForcedTargetIsCheckedAlone) {
  const std::string target = RunnableTargets().back();
  ::setenv("TILEGRAD_TARGET", target.c_str(), 1);
  const Outcome outcome = RunProgram("selftest --only BITS");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  ExpectIn(outcome.output, "SIMD targets: " + target + " (forced by TILEGRAD_TARGET)\n",
           "all 2 checks hold");
  ExpectNotIn(outcome.output, "SSE4");
}

// The bits that it prints are those of any number of threads.
TEST_F(SelftestCommand, FingerprintsAreThoseOfAnyRun) {
  const std::regex seconds(R"(\(\d+\.\d+ s\)|\d+ threads?\n)");
  const auto run = [&](const std::string& more) {
    return std::regex_replace(RunProgram("selftest --only bits " + more).output, seconds, "");
  };
  EXPECT_EQ(run("--workers 1"), run("--workers 3"));
}

// Of three training steps, by target. A change of these digits needs a reason in the commit
// message.
const std::map<std::string, std::string> kTrainingDigits = {{"AVX3", "4e650640"}};

TEST_F(SelftestCommand, TrainingHasTheBitsThatItHad) {
  for (const std::string& target : RunnableTargets()) {
    const auto digits = kTrainingDigits.find(target);
    if (digits == kTrainingDigits.end()) continue;
    const Outcome outcome = RunProgram("selftest --only training");
    ExpectIn(outcome.output, target + " " + digits->second);
  }
}

TEST_F(SelftestCommand, ListsItsChecksAndRunsSome) {
  const Outcome list = RunProgram("selftest --list");
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_EQ(Count(list.output, "\n"), selftest::AllChecks().size());
  EXPECT_EQ(RunProgram("selftest --list --only png").output, "  files: PNG\n");
  EXPECT_EQ(RunProgram("selftest --list --workers 2").output, list.output);  // the old name
  const Outcome some = RunProgram("selftest --only png");
  EXPECT_EQ(some.exit_code, 0) << some.output;
  ExpectIn(some.output, "ok    files: PNG", "all 1 checks hold");
}

TEST_F(SelftestCommand, AnUnknownCheckIsAnErrorWithTheList) {
  const Outcome outcome = RunProgram("selftest --only nonsense");
  EXPECT_EQ(outcome.exit_code, 2);
  ExpectIn(outcome.output, "nonsense");
  for (const Check& check : selftest::AllChecks()) ExpectIn(outcome.output, check.title);
}

TEST_F(SelftestCommand, AFailureIsPrintedAndEndsWithOne) {
  ::setenv("TMPDIR", (folder_ / "nowhere").c_str(), 1);
  const Outcome outcome = RunProgram("selftest --only files");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(Count(outcome.output, "FAIL  files: "), 4u) << outcome.output;
  EXPECT_EQ(Count(outcome.output, "set TMPDIR"), 4u);
  ExpectIn(outcome.output, "4 of 4 checks FAILED (");
}

// ---- The checks ----

// How a result is altered.
enum class Wrong {
  kOff,  // the largest number by a quarter of a percent, integers by one
  kNaN,  // the first number
  kZero  // all numbers
};

template <class T>
void Spoil(Wrong wrong, std::span<T> numbers) {
  if (wrong == Wrong::kZero) std::fill(numbers.begin(), numbers.end(), T(0));
  if (wrong == Wrong::kNaN) numbers[0] = std::numeric_limits<T>::quiet_NaN();
  if (wrong != Wrong::kOff) return;
  const auto size = [](T x) { return std::isfinite(x) ? std::abs(x) : T(-1); };
  T& largest = *std::max_element(numbers.begin(), numbers.end(),
                                 [&](T a, T b) { return size(a) < size(b); });
  largest += T(0.0025) * (largest == 0 ? T(1) : largest);
}

template <class T>
void SpoilIntegers(Wrong wrong, std::span<T> numbers) {
  for (T& x : numbers) x = wrong == Wrong::kZero ? T(0) : static_cast<T>(x + 1);
}

struct Spoiler {
  Wrong wrong;
  void operator()(std::span<float> numbers) const { Spoil(wrong, numbers); }
  void operator()(std::span<double> numbers) const { Spoil(wrong, numbers); }
  void operator()(std::span<std::int32_t> numbers) const { SpoilIntegers(wrong, numbers); }
  void operator()(std::span<std::uint8_t> numbers) const { SpoilIntegers(wrong, numbers); }
};

class SelftestChecks : public testing::Test {
 protected:
  Workers workers_{2};
  // The best target: the others differ in the kernels that run, not in what is compared.
  CheckContext context_{workers_, {ActiveTarget()}};

  // How often a check looks at results, by name.
  std::map<std::string, int> LookedAt(const Check& check) {
    std::map<std::string, int> looks;
    context_.tamper = [&](std::string_view what, const Numbers&) { ++looks[std::string(what)]; };
    const auto finding = check.run(context_);
    EXPECT_TRUE(finding.ok()) << check.title << ": " << finding.status().message();
    return looks;
  }

  // What the check says if that is wrong at the last look, or OK.
  Status AfterSpoiling(const Check& check, const std::string& name, int looks, Wrong wrong) {
    context_.tamper = [&](std::string_view what, const Numbers& numbers) {
      if (what == name && --looks == 0) std::visit(Spoiler{wrong}, numbers);
    };
    return check.run(context_).status();
  }
};

TEST_F(SelftestChecks, AResultThatIsOffFailsTheCheck) {
  for (const Check& check : selftest::AllChecks()) {
    if (check.title.starts_with("degenerate")) continue;  // of numbers that have no right value
    const auto looks = LookedAt(check);
    EXPECT_FALSE(looks.empty()) << check.title;
    for (const auto& [name, count] : looks) {
      if (name == "alpha_error_bound") continue;  // below
      const Status status = AfterSpoiling(check, name, count, Wrong::kOff);
      EXPECT_FALSE(status.ok()) << check.title << " does not see that " << name << " is off";
    }
  }
}

TEST_F(SelftestChecks, NaNFailsTheCheck) {
  for (const Check& check : selftest::AllChecks()) {
    for (const auto& [name, count] : LookedAt(check)) {
      const Status status = AfterSpoiling(check, name, count, Wrong::kNaN);
      EXPECT_FALSE(status.ok()) << check.title << " does not see that " << name << " is NaN";
    }
  }
}

// Enough is dropped that a renderer which keeps silent about it is found out.
TEST_F(SelftestChecks, ABoundThatIsTooLowFailsTheCheck) {
  context_.tamper = [](std::string_view what, const Numbers& numbers) {
    if (what == "alpha_error_bound") std::visit(Spoiler{Wrong::kZero}, numbers);
  };
  for (const Check& check : selftest::AlphaBoundChecks()) {
    ExpectMessage(check.run(context_).status(), "alpha[", "off by", "allowed");
  }
}

TEST_F(SelftestChecks, ErrorsNameTargetNumberAndTolerance) {
  context_.tamper = [](std::string_view what, const Numbers& numbers) {
    if (what == "alpha") std::visit(Spoiler{Wrong::kOff}, numbers);
  };
  const Check alpha = selftest::TriangleChecks()[1];
  ExpectMessage(alpha.run(context_).status(), ActiveTarget() + ": alpha[", "is 1.0025",
                "expected 1: off by 2.5e-03, allowed 2.7e-05");
}

// The target that was in use is in use again, whatever the outcome.
TEST_F(SelftestChecks, TargetsAreRestored) {
  const std::string target = RunnableTargets().back();
  for (const bool spoilt : {false, true}) {
    ASSERT_TRUE(ForceTarget(target).ok());
    context_.targets = RunnableTargets();
    context_.tamper = [&](std::string_view, const Numbers& numbers) {
      if (spoilt) std::visit(Spoiler{Wrong::kNaN}, numbers);
    };
    EXPECT_EQ(selftest::TriangleChecks()[1].run(context_).ok(), !spoilt);
    EXPECT_EQ(ForcedTarget(), target);
    ASSERT_TRUE(ForceTarget("").ok());
  }
}

struct SphereJob {
  std::vector<float> positions;
  std::vector<std::int32_t> faces;
  TradeoffJob job;

  SphereJob() {
    const Mesh mesh = Icosphere(2, 0.5f);
    for (const auto& p : mesh.positions) positions.insert(positions.end(), {p.x, p.y, p.z});
    for (const Face& f : mesh.faces) faces.insert(faces.end(), f.begin(), f.end());
    job.scene.positions = positions;
    job.scene.faces = faces;
    job.scene.camera = OrbitCamera({30.0, 32, 32}, 30, 20, 2.732);
    job.options.width = job.options.height = 32;
    job.errors = {0, 1e-4, 1e-1};
    job.repetitions = 1;
  }
};

TEST(Tradeoff, ErrorsStayBelowWhatIsReportedAndWhatIsAsked) {
  SphereJob sphere;
  const auto result = Ok(MeasureTradeoff(sphere.job, {}));
  ASSERT_EQ(result->rows.size(), 4u);
  EXPECT_EQ(result->rows[3].rule, AlphaRule::kPaper);
  EXPECT_GT(result->rows[3].largest, 1e-3);  // it leaves out what is farther than its box
  EXPECT_EQ(result->faces, 320u);
  EXPECT_EQ(result->truth_rows, 32);
  EXPECT_EQ(result->image_rows, 32);
  EXPECT_GT(result->truth_forward_ms, 0);
  for (const TradeoffRow& row : result->rows) {
    // Rounding: screen coordinates carry 2^-24 * 32 pixels, 4 u of a kernel of 0.2 pixels at most.
    EXPECT_LE(row.largest, row.reported + 2e-5);
    EXPECT_LE(row.reported, row.max_alpha_error + 1e-30);
    EXPECT_LE(row.mean, row.largest);
    EXPECT_GT(row.forward_ms, 0);
    EXPECT_GT(row.backward_ms, 0);
  }
  EXPECT_LT(result->rows[0].gradient_error, 1e-4);
  EXPECT_LT(result->rows[0].gradient_angle, 1e-2);
  EXPECT_GT(result->rows[2].gradient_error, result->rows[0].gradient_error);
}

TEST(Tradeoff, EvenlySpreadRowsStandForTheWholeImage) {
  SphereJob sphere;
  sphere.job.truth_pairs = 8 * 32 * 320;
  const auto result = Ok(MeasureTradeoff(sphere.job, {}));
  EXPECT_EQ(result->truth_rows, 8);
  EXPECT_LT(result->rows[0].gradient_error, 1e-4);
}

TEST(Tradeoff, RefusesWhatHasNoAnswer) {
  SphereJob sphere;
  sphere.job.errors = {};
  EXPECT_FALSE(MeasureTradeoff(sphere.job, {}).ok());
  sphere.job.errors = {2};
  EXPECT_FALSE(MeasureTradeoff(sphere.job, {}).ok());
  sphere.job.errors = {0};
  const StopFlag stop{true};
  const auto stopped = MeasureTradeoff(sphere.job, {nullptr, &stop});
  EXPECT_EQ(stopped.status().code(), StatusCode::kCancelled);
  sphere.job.scene.camera = OrbitCamera({30.0, 32, 32}, 30, 20, -50);  // far behind the camera
  const auto nothing = MeasureTradeoff(sphere.job, {});
  ExpectIn(nothing.status().message(), "no gradient");
}

}  // namespace tilegrad::selftest_test
