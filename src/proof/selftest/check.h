// SPDX-License-Identifier: Apache-2.0
// The checks of `tilegrad selftest`, and how they compare numbers. A check runs the code under
// test, passes every result through CheckContext::Take, and compares it with a formula or a slower
// and simpler computation, within a tolerance stated beside it.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/parallel.h"
#include "tilegrad/status.h"

namespace tilegrad::selftest {

using Numbers = std::variant<std::span<float>, std::span<double>, std::span<std::int32_t>,
                             std::span<std::uint8_t>>;

struct CheckContext {
  const Workers& workers;
  std::vector<std::string> targets;  // SIMD targets to check, named as in RunnableTargets
  // Receives each result before its check and may alter it, so that tests can see that the check
  // then fails. Empty in the program.
  std::function<void(std::string_view what, const Numbers& numbers)> tamper = {};

  template <class Vector>
  void Take(std::string_view what, Vector& result) const {
    if (tamper) tamper(what, Numbers(std::span(result)));
  }
};

// The result of a check that holds.
struct Finding {
  std::string text;              // "off by 1.2e-07, allowed 6.0e-05"
  double share = 0;              // largest deviation as a fraction of what is allowed; 0: exact
  std::string fingerprint = {};  // 8 hexadecimal digits of the bits of all results, or empty
};

struct Check {
  std::string title;
  std::function<Result<Finding>(const CheckContext&)> run;  // error: what is wrong, and by how much
};

// The check on each target of the context. Reports the finding with the largest deviation; errors
// name the target.
Check OnEveryTarget(const Check& check);

// Compares results with expected values and keeps the worst deviation. Errors name the first number
// that is too far off; NaN always is.
class Gauge {
 public:
  // |got - want| <= allowed, number by number; infinities must agree.
  template <class Got, class Want>
  Status Expect(std::string_view what, const Got& got, const Want& want, double allowed) {
    return ExpectEach(what, got, want, [allowed](std::size_t) { return allowed; });
  }

  // The same, allowing `share` of the largest |want|, which must not be 0: a comparison of zeros
  // proves nothing.
  template <class Got, class Want>
  Status ExpectOfLargest(std::string_view what, const Got& got, const Want& want, double share) {
    double most = 0;
    for (const auto& w : want) {
      if (std::isfinite(w)) most = std::max(most, std::abs(static_cast<double>(w)));
    }
    if (most == 0) return InternalError("{}: all {} numbers are 0", what, std::size(want));
    return Expect(what, got, want, share * most);
  }

  // The same with allowed(i) for number i.
  template <class Got, class Want, class Allowed>
  Status ExpectEach(std::string_view what, const Got& got, const Want& want,
                    const Allowed& allowed) {
    if (std::size(got) != std::size(want)) {
      return InternalError("{} has {} numbers, expected {}", what, std::size(got), std::size(want));
    }
    for (std::size_t i = 0; i < std::size(want); ++i) {
      TILEGRAD_TRY(
          Add(what, i, static_cast<double>(got[i]), static_cast<double>(want[i]), allowed(i)));
    }
    return {};
  }

  Finding Found() const;

 private:
  Status Add(std::string_view what, std::size_t index, double got, double want, double allowed);

  double share_ = 0, off_ = 0, allowed_ = 0;  // of the worst number
};

// Errors name the first number whose bits differ (0 and -0 do).
Status ExpectSameBits(std::string_view what, std::span<const float> got,
                      std::span<const float> want);

std::vector<Check> TriangleChecks();    // images of one triangle against closed formulas
std::vector<Check> SphereChecks();      // every gradient against float64, and that against steps
std::vector<Check> AlphaBoundChecks();  // the bound on alpha, and independence of face order
std::vector<Check> SameBitsChecks();    // threads, batches
std::vector<Check> ExtremeChecks();     // degenerate scenes, numbers that are not finite
std::vector<Check> KernelChecks();      // products and convolutions of networks
std::vector<Check> TrainingChecks();    // the gradient penalty, and training steps
std::vector<Check> FileChecks();        // write and read back
std::vector<Check> MetricChecks();      // scores with known values

std::vector<Check> AllChecks();  // in this order

}  // namespace tilegrad::selftest
