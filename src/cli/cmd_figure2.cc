// SPDX-License-Identifier: Apache-2.0
// tilegrad figure2: the paper's sanity check of all gradients.
#include <nlohmann/json.hpp>

#include "base/output_guard.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/run_folder.h"
#include "fit/figure2.h"

namespace tilegrad::cli {
namespace {

struct FigureOptions {
  std::string out = "figure2.svg";
  int workers = 0;
  bool force = false;
  train::Figure2Options figure;
};

Status RunFigure(const FigureOptions& options) {
  const OutputGuard guard(options.force);
  TILEGRAD_TRY(guard.Check(options.out));  // before the work
  const Workers workers(options.workers);
  ProgressLine line;
  TILEGRAD_ASSIGN(const auto results,
                  train::RunFigure2(options.figure, workers, line.Sink(), StopOnSignals()));
  line.Finish();
  TILEGRAD_ASSIGN(const std::string svg, train::Figure2Svg(results));
  TILEGRAD_TRY(WriteGuarded(guard, options.out, [&] { return WriteTextAtomic(options.out, svg); }));
  Print("{}look at {}\n", train::Figure2Table(results), options.out);
  PrintResult({{"picture", options.out}});
  return {};
}

}  // namespace

void AddFigure2(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "figure2",
      "The paper's Figure 2: optimise positions, colours, texture, uv, camera, light and material\n"
      "in eight small scenes, and draw start, target, result and error curve of each",
      RunFigure);
  command->Add("--out", &options->out, "the picture, SVG", {EndsIn(".svg")});
  command->Add("--size", &options->figure.size, "pixels a side of each image", {Range{8, 2048}});
  command->Add("--steps", &options->figure.steps, "of each optimisation", {AboveZero()});
  AddForceOption(command, &options->force);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
