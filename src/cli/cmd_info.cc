// SPDX-License-Identifier: Apache-2.0
// tilegrad info: version, SIMD targets and why one was chosen, cores.
#include <nlohmann/json.hpp>

#include "base/parallel.h"
#include "base/simd_target.h"
#include "cli/command.h"
#include "cli/console.h"
#include "tilegrad/version.h"

namespace tilegrad::cli {
namespace {

Status PrintInfo() {
  Print("tilegrad {}\n", TILEGRAD_VERSION);
  Print("cores this process may use: {}\n", AvailableCores());
  Print("SIMD targets this CPU and build offer, best first:");
  for (const auto& name : RunnableTargets()) Print(" {}", name);
  const bool forced = !ForcedTarget().empty();
  Print(
      "\nin use: {} ({})\n", ActiveTarget(),
      forced ? "forced by TILEGRAD_TARGET" : "the best; set TILEGRAD_TARGET=NAME to force another");
  PrintResult({{"version", TILEGRAD_VERSION},
               {"cores", AvailableCores()},
               {"targets", RunnableTargets()},
               {"target", ActiveTarget()},
               {"forced", forced}});
  return {};
}

}  // namespace

void AddInfo(CommandList* list) {
  Command& command = list->emplace_back(Command{"info", "Show version, SIMD targets and cores"});
  command.action = PrintInfo;
}

}  // namespace tilegrad::cli
