// SPDX-License-Identifier: Apache-2.0
// Figure 2 as a picture: two columns of four rows, each start | target | result | error curve.
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/escape_html.h"
#include "fit/figure2.h"
#include "train/report/html.h"

namespace tilegrad::train {
namespace {

constexpr double kTile = 100, kGap = 6, kCurve = 130, kTitle = 20, kHeadHeight = 22,
                 kColumnGap = 24;
constexpr double kRow = kTile + kTitle + 10, kColumn = 3 * (kTile + kGap) + kCurve + kColumnGap;
constexpr double kLowestPower = -3;  // power of ten of the curve's lower end
constexpr double kGoal = 0.05;       // of the starting loss

std::string Text(double x, double y, const char* anchor, const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                     EscapeHtml(text));
}

std::string Line(double x0, double y0, double x1, double y1, const char* color) {
  return fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" fill=\"none\"/>\n", x0,
                     y0, x1, y1, color);
}

double CurveY(double top, double share) {
  const double power = std::clamp(std::log10(std::max(share, 1e-12)), kLowestPower, 0.0);
  return top + kTile * power / kLowestPower;
}

// Loss over its start, logarithmic from 1 to 10^kLowestPower.
std::string Curve(const Figure2Result& r, double left, double top) {
  std::string svg;
  for (int power = 0; power >= static_cast<int>(kLowestPower); --power) {
    const double y = CurveY(top, std::pow(10.0, power));
    svg += Line(left, y, left + kCurve, y, "#dddddd");
  }
  svg += Line(left, CurveY(top, kGoal), left + kCurve, CurveY(top, kGoal), "#c2571a");
  std::string points;
  const std::size_t count = r.losses.size(), stride = std::max<std::size_t>(1, count / 130);
  for (std::size_t i = 0; i < count; i = i + 1 < count ? std::min(i + stride, count - 1) : count) {
    const double x = left + kCurve * static_cast<double>(i) / static_cast<double>(count - 1);
    points += fmt::format("{:.1f},{:.1f} ", x, CurveY(top, r.losses[i] / r.losses[0]));
  }
  return svg +
         fmt::format(
             "<polyline points=\"{}\" fill=\"none\" stroke=\"#0b6a9a\" "
             "stroke-width=\"1.5\"/>\n",
             points) +
         Text(left + kCurve, top - 5, "end", fmt::format("{:.2g} %", 100 * r.remaining()));
}

Result<std::string> Tiles(const Figure2Result& r, double left, double top) {
  std::string svg;
  for (const ImageU8* image : {&r.start, &r.target, &r.result}) {
    TILEGRAD_ASSIGN(const std::string address, PngAddress(*image));
    svg += fmt::format(
        "<image x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" href=\"{}\"/>\n"
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" fill=\"none\" "
        "stroke=\"#cccccc\"/>\n",
        left, top, kTile, kTile, address, left, top, kTile, kTile);
    left += kTile + kGap;
  }
  return svg;
}

}  // namespace

Result<std::string> Figure2Svg(const std::vector<Figure2Result>& results) {
  const auto rows = (results.size() + 1) / 2;
  const double width = 2 * kColumn, height = kHeadHeight + static_cast<double>(rows) * kRow + 4;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" "
      "viewBox=\"0 0 {0} {1}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222222\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n",
      width, height);
  for (int column = 0; column < 2; ++column) {
    static constexpr std::array kHeads = {"start", "target", "result", "L1 / its start"};
    for (std::size_t i = 0; i < kHeads.size(); ++i) {
      const double at = kGap + column * kColumn + static_cast<double>(i) * (kTile + kGap);
      svg += Text(at + (i < 3 ? kTile : kCurve) / 2, 15, "middle", kHeads[i]);
    }
  }
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Figure2Result& r = results[i];
    const double left = kGap + static_cast<double>(i / rows) * kColumn;
    const double top = kHeadHeight + static_cast<double>(i % rows) * kRow + kTitle;
    svg += Text(left, top - 5, "start", fmt::format("({}) {}: {}", r.label, r.model, r.what));
    TILEGRAD_ASSIGN(const std::string tiles, Tiles(r, left, top));
    svg += tiles + Curve(r, left + 3 * (kTile + kGap), top);
  }
  return svg + "</svg>\n";
}

std::string Figure2Table(const std::vector<Figure2Result>& results) {
  std::string out =
      "|   | model | optimised | L1 at the start | at the end | left | seconds |\n"
      "|---|---|---|--:|--:|--:|--:|\n";
  for (const Figure2Result& r : results) {
    out += fmt::format("| {} | {} | {} | {:.5f} | {:.6f} | {:.2f} % | {:.1f} |\n", r.label, r.model,
                       r.what, r.losses.front(), r.losses.back(), 100 * r.remaining(), r.seconds);
  }
  return out;
}

}  // namespace tilegrad::train
