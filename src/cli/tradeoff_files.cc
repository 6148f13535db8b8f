// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "cli/tradeoff_study.h"

namespace tilegrad::cli {
namespace {

double Cost(const TradeoffRow& row) { return row.forward_ms + row.backward_ms; }

std::string Heading(const StudyResult& r) {
  return fmt::format("{}, {} faces, {} x {} pixels, delta = {:.3g}", r.scene, r.tradeoff.faces,
                     r.size, r.size, r.delta);
}

std::string Table(const StudyResult& r) {
  std::string out = fmt::format(
      "### {}\n\nTruth: float64 over all faces on {} of {} rows; it would take {:.0f} ms forward "
      "and {:.0f} ms backward.\n\n"
      "| max_alpha_error | forward ms | backward ms | reported bound | largest error | mean error "
      "| "
      "gradient angle, degrees | gradient error |\n|--:|--:|--:|--:|--:|--:|--:|--:|\n",
      Heading(r), r.tradeoff.truth_rows, r.tradeoff.image_rows, r.tradeoff.truth_forward_ms,
      r.tradeoff.truth_backward_ms);
  for (const TradeoffRow& row : r.tradeoff.rows) {
    out += fmt::format("| {:g} | {:.3f} | {:.3f} | {:.1e} | {:.1e} | {:.1e} | {:.2g} | {:.1e} |\n",
                       row.max_alpha_error, row.forward_ms, row.backward_ms, row.reported,
                       row.largest, row.mean, row.gradient_angle, row.gradient_error);
  }
  return out + "\n";
}

// The picture, in pixels.
constexpr double kWidth = 720, kHeight = 440, kLeft = 80, kTop = 24, kRight = 250, kBottom = 56;
constexpr std::array kColors = {"#0b6a9a", "#c2571a", "#3a7d44", "#7b4ea3",
                                "#9a7d0a", "#a31f34", "#2a9d8f", "#555555"};

// One logarithmic axis, in whole decades.
struct Axis {
  int low = 99, high = -99;  // powers of ten
  double from, to;           // pixels

  void Include(double v) {
    low = std::min(low, static_cast<int>(std::floor(std::log10(v))));
    high = std::max(high, static_cast<int>(std::ceil(std::log10(v))));
  }
  double At(double v) const {
    return from + (to - from) * (std::log10(v) - low) / std::max(high - low, 1);
  }
};

// An error of nothing has no logarithm: half a unit in the last place of 1 stands for it.
double Shown(double error) { return std::max(error, 0x1p-25); }

struct Picture {
  Axis x{99, -99, kLeft, kWidth - kRight}, y{99, -99, kHeight - kBottom, kTop};
  std::string svg;

  void Text(double at_x, double at_y, const char* anchor, const std::string& text) {
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", at_x, at_y,
                       anchor, text);
  }
  void Line(double x0, double y0, double x1, double y1) {
    svg +=
        fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"#dddddd\" fill=\"none\"/>\n",
                    x0, y0, x1, y1);
  }
  void Grid() {
    for (int p = x.low; p <= x.high; ++p) {
      const double at = x.At(std::pow(10.0, p));
      Line(at, y.from, at, y.to),
          Text(at, y.from + 18, "middle", fmt::format("{:g}", std::pow(10, p)));
    }
    for (int p = y.low; p <= y.high; ++p) {
      const double at = y.At(std::pow(10.0, p));
      Line(x.from, at, x.to, at), Text(x.from - 8, at + 4, "end", fmt::format("1e{}", p));
    }
    Text((x.from + x.to) / 2, kHeight - 16, "middle", "CPU time, forward and backward, ms");
    svg += fmt::format(
        "<text transform=\"translate(18 {:.1f}) rotate(-90)\" text-anchor=\"middle\">largest error "
        "of alpha</text>\n",
        (y.from + y.to) / 2);
  }
  void Curve(const StudyResult& r, std::size_t index) {
    const char* color = kColors[index % kColors.size()];
    std::string points, dots;
    for (const TradeoffRow& row : r.tradeoff.rows) {
      const double at_x = x.At(Cost(row)), at_y = y.At(Shown(row.largest));
      points += fmt::format("{:.1f},{:.1f} ", at_x, at_y);
      dots += fmt::format(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"><title>max_alpha_error = "
          "{:g}</title></circle>\n",
          at_x, at_y, color, row.max_alpha_error);
    }
    svg +=
        fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>\n{}",
                    points, color, dots);
    const double key = kTop + 14 + 36 * static_cast<double>(index);
    svg += fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"5\" fill=\"{}\"/>\n", kWidth - kRight + 24,
                       key - 4, color);
    Text(kWidth - kRight + 36, key, "start",
         fmt::format("{}, {} faces", r.scene, r.tradeoff.faces));
    Text(kWidth - kRight + 36, key + 15, "start",
         fmt::format("{} pixels, delta = {:.3g}", r.size, r.delta));
  }
};

}  // namespace

std::string StudyMarkdown(const std::vector<StudyResult>& results,
                          const std::vector<StudyTraining>& training) {
  std::string out;
  for (const StudyResult& r : results) out += Table(r);
  if (training.empty()) return out;
  out +=
      "### Training\n\n| max_alpha_error | steps | training s | mean 3D IoU | F-score |\n"
      "|--:|--:|--:|--:|--:|\n";
  for (const StudyTraining& t : training) {
    out += fmt::format("| {:g} | {} | {:.0f} | {:.1f} % | {:.1f} % |\n", t.max_alpha_error, t.steps,
                       t.seconds, 100 * t.iou, 100 * t.f_score);
  }
  return out + "\n";
}

std::string StudyCsv(const std::vector<StudyResult>& results) {
  std::string out =
      "scene,faces,size,delta,max_alpha_error,forward_ms,backward_ms,reported_bound,largest_error,"
      "mean_error,gradient_angle_degrees,gradient_error,truth_forward_ms,truth_backward_ms\n";
  for (const StudyResult& r : results) {
    for (const TradeoffRow& row : r.tradeoff.rows) {
      out += fmt::format(
          "{},{},{},{:.6g},{:g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n",
          r.scene, r.tradeoff.faces, r.size, r.delta, row.max_alpha_error, row.forward_ms,
          row.backward_ms, row.reported, row.largest, row.mean, row.gradient_angle,
          row.gradient_error, r.tradeoff.truth_forward_ms, r.tradeoff.truth_backward_ms);
    }
  }
  return out;
}

std::string StudyPicture(const std::vector<StudyResult>& results) {
  Picture picture;
  for (const StudyResult& r : results) {
    for (const TradeoffRow& row : r.tradeoff.rows) {
      picture.x.Include(std::max(Cost(row), 1e-3)), picture.y.Include(Shown(row.largest));
    }
  }
  picture.svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {} {}\" "
      "font-family=\"sans-serif\" font-size=\"12\" fill=\"#222222\">\n<rect width=\"100%\" "
      "height=\"100%\" fill=\"#ffffff\"/>\n",
      kWidth, kHeight, kWidth, kHeight);
  picture.Grid();
  for (std::size_t i = 0; i < results.size(); ++i) picture.Curve(results[i], i);
  return picture.svg + "</svg>\n";
}

}  // namespace tilegrad::cli
