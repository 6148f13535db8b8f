// SPDX-License-Identifier: Apache-2.0
// bench_report RENDER.json FOLDER: prints the tables of docs/benchmarks.md, and writes
// FOLDER/render.csv, FOLDER/render.md and FOLDER/growth_{faces,pixels,delta}.svg; of the JSON of
// shade_bench, FOLDER/shade.csv and FOLDER/shade.md.
#include <cstdio>

#include "base/error.h"
#include "base/file.h"
#include "report/tables.h"

namespace tilegrad::bench {
namespace {

Status Report(const Path& json, const Path& folder) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(json));
  const auto parsed = ParseMeasurements(text);
  if (!parsed.ok()) return parsed.status().Within(json.string());
  const std::vector<Measurement>& all = parsed.value();
  if (const std::string requests = RequestTable(all); !requests.empty()) {
    TILEGRAD_TRY(WriteTextAtomic(folder / "shade.csv", MeasurementsCsv(all)));
    TILEGRAD_TRY(WriteTextAtomic(folder / "shade.md", requests));
    std::printf("%s\n", requests.c_str());
    return {};
  }
  std::string tables = SpeedTable(all);
  TILEGRAD_TRY(WriteTextAtomic(folder / "render.csv", MeasurementsCsv(all)));
  for (const char* axis : {"faces", "pixels", "delta"}) {
    const std::string table = GrowthTable(all, axis);
    if (table.empty()) continue;
    tables += "\n" + table;
    TILEGRAD_TRY(WriteTextAtomic(folder / (std::string("growth_") + axis + ".svg"),
                                 train::LogPlotSvg(GrowthPlot(all, axis))));
  }
  TILEGRAD_TRY(WriteTextAtomic(folder / "render.md", tables));
  std::printf("%s\nwritten: %s\n", tables.c_str(), folder.string().c_str());
  return {};
}

}  // namespace
}  // namespace tilegrad::bench

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: bench_report RENDER.json FOLDER\n");
    return 2;
  }
  const tilegrad::Status status = tilegrad::bench::Report(argv[1], argv[2]);
  if (status.ok()) return 0;
  std::fprintf(stderr, "bench_report: %s\n", status.message().c_str());
  return 1;
}
