// SPDX-License-Identifier: Apache-2.0
// tilegrad selftest: does this program on this machine compute what formulas say?
#include <algorithm>
#include <chrono>
#include <exception>
#include <nlohmann/json.hpp>

#include "base/clocks.h"
#include "base/error.h"
#include "base/simd_target.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "proof/selftest/check.h"
#include "tilegrad/version.h"
#include "train/run/run_files.h"

namespace tilegrad::cli {
namespace {

using selftest::Check;
using selftest::CheckContext;

struct SelftestOptions {
  std::string only;
  bool list = false;
  int workers = 0;
};

std::string Titles(const std::vector<Check>& checks) {
  std::string out;
  for (const Check& check : checks) out += "  " + check.title + "\n";
  return out;
}

Result<std::vector<Check>> ChooseChecks(const std::string& only) {
  const std::vector<Check> all = selftest::AllChecks();
  std::vector<Check> chosen;
  for (const Check& check : all) {
    if (LowerCase(check.title).find(LowerCase(only)) != std::string::npos) chosen.push_back(check);
  }
  if (!chosen.empty()) return chosen;
  std::string titles = Titles(all);
  titles.pop_back();
  return InvalidArgument("--only {}: no check has this in its title; the checks are:\n{}", only,
                         titles);
}

Result<selftest::Finding> RunGuarded(const Check& check, const CheckContext& context) {
  try {
    return check.run(context);
  } catch (const std::exception& error) {  // whatever it is, the next check is run
    return InternalError("unexpected failure: {}", error.what());
  }
}

// Whether it holds. What it found is appended to `json`.
bool RunCheck(const Check& check, const CheckContext& context, nlohmann::ordered_json* json) {
  const auto start = std::chrono::steady_clock::now();
  const auto finding = RunGuarded(check, context);
  Print("{}  {:50} {} ({:.2f} s)\n", finding.ok() ? "ok  " : "FAIL", check.title,
        finding.ok() ? finding->text : finding.status().message(), SecondsSince(start));
  json->push_back({{"check", check.title},
                   {"holds", finding.ok()},
                   {"found", finding.ok() ? finding->text : finding.status().message()},
                   {"seconds", SecondsSince(start)}});
  std::fflush(stdout);  // a check that crashes is the one after the last line
  return finding.ok();
}

void PrintHeader(const CheckContext& context) {
  Print("tilegrad {}", TILEGRAD_VERSION);
  for (const auto& [name, value] : train::DescribeMachine()) {
    if (name == "compiler" || name == "cpu") Print(", {}", value);
  }
  const int threads = context.workers.count();
  Print(", {} thread{}\nSIMD targets:", threads, threads == 1 ? "" : "s");
  for (const std::string& target : context.targets) Print(" {}", target);
  Print("{}\n", ForcedTarget().empty() ? "" : " (forced by TILEGRAD_TARGET)");
}

Status RunSelftest(const SelftestOptions& options) {
  TILEGRAD_ASSIGN(const auto checks, ChooseChecks(options.only));
  if (options.list) {
    Print("{}", Titles(checks));
    std::vector<std::string> titles;
    for (const Check& check : checks) titles.push_back(check.title);
    PrintResult(titles);
    return {};
  }
  const Workers workers(options.workers);
  const std::string forced = ForcedTarget();
  const CheckContext context{workers, forced.empty() ? RunnableTargets() : std::vector{forced}};
  PrintHeader(context);
  const auto start = std::chrono::steady_clock::now();
  nlohmann::ordered_json json;
  const auto failed = std::count_if(checks.begin(), checks.end(), [&](const Check& check) {
    return !RunCheck(check, context, &json);
  });
  PrintResult(json);
  if (failed == 0) {
    Print("all {} checks hold ({:.1f} s)\n", checks.size(), SecondsSince(start));
    return {};
  }
  Print("{} of {} checks FAILED ({:.1f} s)\n", failed, checks.size(), SecondsSince(start));
  return InternalError(
      "do not trust results of this program on this machine; please report the lines above");
}

}  // namespace

void AddSelftest(CommandList* list) {
  const auto [command, options] = AddCommand(list, "selftest",
                                             "Check images, gradients, networks and files on this "
                                             "machine, on every SIMD target, in seconds",
                                             RunSelftest);
  command->Add("--only", &options->only, "run checks whose title contains this (case-insensitive)");
  AddWorkersOption(command, &options->workers);
  command->Add("--list", &options->list, "list the checks without running them");
}

}  // namespace tilegrad::cli
