// SPDX-License-Identifier: Apache-2.0
#include "proof/selftest/check.h"

#include <bit>

#include "base/simd_target.h"

namespace tilegrad::selftest {
namespace {

Result<Finding> RunOnEveryTarget(const Check& check, const CheckContext& context) {
  Finding worst;
  std::string fingerprints;
  for (const std::string& target : context.targets) {
    const TargetScope scope(target);
    TILEGRAD_TRY(scope.status());
    auto finding = check.run(context);
    if (!finding.ok()) return finding.status().Within(target);
    if (!finding->fingerprint.empty()) {
      fingerprints += (fingerprints.empty() ? "" : ", ") + target + " " + finding->fingerprint;
    }
    if (worst.text.empty() || finding->share > worst.share) worst = *finding;
  }
  if (!fingerprints.empty()) worst.text += ": " + fingerprints;
  return worst;
}

}  // namespace

Check OnEveryTarget(const Check& check) {
  return {check.title,
          [check](const CheckContext& context) { return RunOnEveryTarget(check, context); }};
}

Finding Gauge::Found() const {
  return {fmt::format("off by {:.1e}, allowed {:.1e}", off_, allowed_), share_};
}

Status Gauge::Add(std::string_view what, std::size_t index, double got, double want,
                  double allowed) {
  if (got == want) return {};
  const double off = std::abs(got - want);
  if (!(off <= allowed)) {
    return InternalError("{}[{}] is {:.9g}, expected {:.9g}: off by {:.1e}, allowed {:.1e}", what,
                         index, got, want, off, allowed);
  }
  if (off > share_ * allowed) {
    share_ = off / allowed;
    off_ = off;
    allowed_ = allowed;
  }
  return {};
}

Status ExpectSameBits(std::string_view what, std::span<const float> got,
                      std::span<const float> want) {
  if (got.size() != want.size()) {
    return InternalError("{} has {} numbers, expected {}", what, got.size(), want.size());
  }
  for (std::size_t i = 0; i < want.size(); ++i) {
    if (std::bit_cast<std::uint32_t>(got[i]) == std::bit_cast<std::uint32_t>(want[i])) continue;
    return InternalError("{}[{}] is {:.9g}, expected the bits of {:.9g}", what, i, got[i], want[i]);
  }
  return {};
}

std::vector<Check> AllChecks() {
  std::vector<Check> all;
  for (const auto& group :
       {TriangleChecks, SphereChecks, AlphaBoundChecks, SameBitsChecks, ExtremeChecks, KernelChecks,
        TrainingChecks, FileChecks, MetricChecks}) {
    for (Check& check : group()) all.push_back(std::move(check));
  }
  return all;
}

}  // namespace tilegrad::selftest
