// SPDX-License-Identifier: Apache-2.0
#include "report/tables.h"

#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <optional>

namespace tilegrad::bench {
namespace {

constexpr std::array kColumns = {
    "images", "pixels",   "faces",         "pairs",           "exps",
    "bytes",  "limit_ms", "limit_high_ms", "evaluated_pairs", "evaluated_exps"};

std::string Name(const std::string& axis) {
  if (axis == "pixels") return "pixels of a side";
  return axis;
}

// The place on the axis of "faces-1280", "delta-1e-06"; nothing if it is not a scene of this
// series.
std::optional<double> PlaceOn(const std::string& axis, const std::string& scene) {
  if (scene.rfind(axis + "-", 0) != 0) return std::nullopt;
  return std::strtod(scene.c_str() + axis.size() + 1, nullptr);
}

bool IsGrowth(const Measurement& m) {
  return PlaceOn("faces", m.scene) || PlaceOn("pixels", m.scene) || PlaceOn("delta", m.scene);
}

std::string Digits(double v) {
  return v >= 100 ? fmt::format("{:.0f}", v) : fmt::format("{:.2g}", v);
}

std::string Ratio(const Measurement* reference, double ours) {
  return reference == nullptr ? "" : Digits(reference->cpu_ms / ours);
}

std::string Cell(const Measurement* m) { return m == nullptr ? "" : Digits(m->cpu_ms); }

std::string SpeedRow(const std::vector<Measurement>& all, const Measurement& m) {
  const Measurement* two = Find(all, m, "2");
  const double low = m.counter("limit_ms"), high = m.counter("limit_high_ms");
  return fmt::format(
      "| {} | {} | {} | {:.2f} | {} | {} | {} | {} | {:.2f}-{:.2f} | {:.0f}-{:.0f} % |\n", m.scene,
      m.direction, m.what, m.cpu_ms, Cell(Find(all, m, "1-default")),
      Ratio(Find(all, m, "culled"), m.cpu_ms), Ratio(Find(all, m, "naive"), m.cpu_ms),
      two == nullptr ? "" : fmt::format("{:.2f}", m.wall_ms / two->wall_ms), low, high,
      100 * low / m.cpu_ms, 100 * high / m.cpu_ms);
}

// What is drawn as one curve.
struct Curve {
  const char *direction, *who, *name;
};
constexpr Curve kCurves[] = {{"forward", "1", "tilegrad forward, E = 1e-7"},
                             {"backward", "1", "tilegrad backward, E = 1e-7"},
                             {"forward", "1-E1e-3", "tilegrad forward, E = 1e-3"},
                             {"backward", "1-E1e-3", "tilegrad backward, E = 1e-3"},
                             {"forward", "culled", "scalar baseline, forward"},
                             {"backward", "culled", "scalar baseline, backward"}};

train::LogSeries SeriesOf(const std::vector<Measurement>& all, const std::string& axis,
                          const Curve& curve) {
  train::LogSeries series{{curve.name}, {}};
  for (const Measurement& m : all) {
    const auto place = PlaceOn(axis, m.scene);
    if (!place || m.direction != curve.direction || m.who != curve.who) continue;
    series.points.push_back({*place, m.cpu_ms, fmt::format("{:g}: {:.3g} ms", *place, m.cpu_ms)});
  }
  return series;
}

const Measurement* FindRequest(const std::vector<Measurement>& all, const std::string& scene,
                               const std::string& direction, const std::string& what) {
  for (const Measurement& m : all) {
    if (m.who == "shaded" && m.scene == scene && m.direction == direction && m.what == what) {
      return &m;
    }
  }
  return nullptr;
}

// Milliseconds and their ratio to the silhouette's; cells of what was not measured stay empty.
std::string RequestCells(const std::vector<Measurement>& all, const Measurement* m) {
  if (m == nullptr) return " | ";
  const Measurement* silhouette = FindRequest(all, m->scene, m->direction, "silhouette");
  return fmt::format("{:.2f} | {}", m->cpu_ms,
                     silhouette ? fmt::format("{:.2f}", m->cpu_ms / silhouette->cpu_ms) : "");
}

}  // namespace

std::string MeasurementsCsv(const std::vector<Measurement>& all) {
  std::string out = "scene,direction,what,who,repetitions,cpu_ms,wall_ms,share";
  for (const char* column : kColumns) out += fmt::format(",{}", column);
  out += "\n";
  for (const Measurement& m : all) {
    out += fmt::format("{},{},{},{},{},{:.6g},{:.6g},{:.6g}", m.scene, m.direction, m.what, m.who,
                       m.repetitions, m.cpu_ms, m.wall_ms, m.counter("share"));
    for (const char* column : kColumns) out += fmt::format(",{:.8g}", m.counter(column));
    out += "\n";
  }
  return out;
}

std::string SpeedTable(const std::vector<Measurement>& all) {
  std::string out =
      "| scene | direction | what | ms, E = 1e-7 | ms, default E | x scalar baseline | x naive | "
      "two workers, x | limit ms | of the limit |\n|---|---|---|--:|--:|--:|--:|--:|--:|--:|\n";
  for (const Measurement& m : all) {
    if (m.who == "1" && !IsGrowth(m)) out += SpeedRow(all, m);
  }
  return out;
}

std::string RequestTable(const std::vector<Measurement>& all) {
  std::string out;
  for (const Measurement& m : all) {
    if (m.who != "shaded") continue;
    const Measurement* forward = FindRequest(all, m.scene, "forward", m.what);
    if (forward != nullptr && forward != &m) continue;  // has its row
    out += fmt::format("| {} | {} | {} | {} |\n", m.scene, m.what, RequestCells(all, forward),
                       RequestCells(all, FindRequest(all, m.scene, "backward", m.what)));
  }
  if (out.empty()) return out;
  return "| scene | request | forward, ms | x silhouette | backward, ms | x silhouette |\n"
         "|---|---|--:|--:|--:|--:|\n" +
         out;
}

train::LogPlot GrowthPlot(const std::vector<Measurement>& all, const std::string& axis) {
  train::LogPlot plot{Name(axis), "CPU time, ms", {}};
  for (const Curve& curve : kCurves) {
    train::LogSeries series = SeriesOf(all, axis, curve);
    if (!series.points.empty()) plot.series.push_back(std::move(series));
  }
  return plot;
}

std::string GrowthTable(const std::vector<Measurement>& all, const std::string& axis) {
  const train::LogPlot plot = GrowthPlot(all, axis);
  if (plot.series.empty()) return "";
  std::string head = "| " + plot.x_label, line = "|--:", out;
  for (const train::LogSeries& series : plot.series) {
    head += " | " + series.name[0] + ", ms";
    line += "|--:";
  }
  for (const train::LogPoint& place : plot.series[0].points) {
    out += fmt::format("| {:g}", place.x);
    for (const train::LogSeries& series : plot.series) {
      std::string cell;
      for (const train::LogPoint& p : series.points) {
        if (p.x == place.x) cell = fmt::format("{:.3g}", p.y);
      }
      out += " | " + cell;
    }
    out += " |\n";
  }
  return head + " |\n" + line + "|\n" + out;
}

}  // namespace tilegrad::bench
