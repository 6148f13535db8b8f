// SPDX-License-Identifier: Apache-2.0
#include "train/report/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_text.h"
#include "base/text.h"
#include "base/whole_number.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

// Pixels: the picture, and the margins for labels, of which the right one holds the key.
constexpr double kPlotWidth = 720, kPlotHeight = 440;
constexpr double kPlotLeft = 80, kPlotTop = 24, kPlotRight = 250, kPlotBottom = 56;
constexpr std::array kPlotColors = {"#0b6a9a", "#c2571a", "#3a7d44", "#7b4ea3",
                                    "#9a7d0a", "#a31f34", "#2a9d8f", "#555555"};

// In whole decades.
struct LogAxis {
  double from, to;        // pixels
  int low = 0, high = 1;  // powers of ten

  void Cover(double least, double largest) {
    low = WholeNumber<int>(std::floor(std::log10(least)));
    high = std::max(low + 1, WholeNumber<int>(std::ceil(std::log10(largest))));
  }
  double At(double v) const { return from + (to - from) * (std::log10(v) - low) / (high - low); }
};

class LogDrawing {
 public:
  explicit LogDrawing(const LogPlot& plot) {
    double x0 = HUGE_VAL, x1 = 0, y0 = HUGE_VAL, y1 = 0;
    for (const LogSeries& series : plot.series) {
      for (const LogPoint& p : series.points) {
        x0 = std::min(x0, p.x);
        x1 = std::max(x1, p.x);
        y0 = std::min(y0, p.y);
        y1 = std::max(y1, p.y);
      }
    }
    if (x1 == 0) return;
    x_.Cover(x0, x1);
    y_.Cover(y0, y1);
  }

  std::string Draw(const LogPlot& plot) {
    svg_ = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
        "{1}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222222\">\n<rect "
        "width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        kPlotWidth, kPlotHeight);
    Grid(plot);
    for (std::size_t i = 0; i < plot.series.size(); ++i) Curve(plot.series[i], i);
    return svg_ + "</svg>\n";
  }

 private:
  void Text(double x, double y, const char* anchor, const std::string& text) {
    svg_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y,
                        anchor, EscapeHtml(text));
  }
  void Line(double x0, double y0, double x1, double y1) {
    svg_ +=
        fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"#dddddd\" fill=\"none\"/>\n",
                    x0, y0, x1, y1);
  }
  void Grid(const LogPlot& plot) {
    for (int p = x_.low; p <= x_.high; ++p) {
      const double at = x_.At(std::pow(10.0, p));
      Line(at, y_.from, at, y_.to);
      Text(at, y_.from + 18, "middle", fmt::format("{:g}", std::pow(10.0, p)));
    }
    for (int p = y_.low; p <= y_.high; ++p) {
      const double at = y_.At(std::pow(10.0, p));
      Line(x_.from, at, x_.to, at);
      Text(x_.from - 8, at + 4, "end", fmt::format("{:g}", std::pow(10.0, p)));
    }
    Text((x_.from + x_.to) / 2, kPlotHeight - 16, "middle", plot.x_label);
    svg_ += fmt::format(
        "<text transform=\"translate(18 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
        (y_.from + y_.to) / 2, EscapeHtml(plot.y_label));
  }
  void Curve(const LogSeries& series, std::size_t index) {
    const char* color = kPlotColors[index % kPlotColors.size()];
    std::string line, dots;
    for (const LogPoint& p : series.points) {
      const double x = x_.At(p.x), y = y_.At(p.y);
      line += fmt::format("{:.1f},{:.1f} ", x, y);
      dots += fmt::format(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"><title>{}</title></circle>\n", x,
          y, color, EscapeHtml(p.title));
    }
    svg_ +=
        fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>\n{}",
                    line, color, dots);
    const double key = kPlotTop + 14 + 36 * static_cast<double>(index),
                 left = kPlotWidth - kPlotRight + 24;
    svg_ +=
        fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"5\" fill=\"{}\"/>\n", left, key - 4, color);
    for (std::size_t n = 0; n < series.name.size(); ++n)
      Text(left + 12, key + 15 * static_cast<double>(n), "start", series.name[n]);
  }

  LogAxis x_{kPlotLeft, kPlotWidth - kPlotRight}, y_{kPlotHeight - kPlotBottom, kPlotTop};
  std::string svg_;
};

// Scripts put texts on the page as they are: marks of writing direction have to be visible by then.
nlohmann::ordered_json Shown(nlohmann::ordered_json json) {
  if (json.is_string()) return EscapeControls(json.get_ref<const std::string&>());
  if (json.is_structured()) {
    for (auto& part : json) part = Shown(std::move(part));
  }
  return json;
}

}  // namespace

std::string LogPlotSvg(const LogPlot& plot) { return LogDrawing(plot).Draw(plot); }

std::string WithCommas(std::int64_t number) {
  std::string digits = std::to_string(number);
  for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3)
    digits.insert(static_cast<std::size_t>(at), ",");
  return digits;
}

std::string Base64(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t group = 0;
    for (std::size_t i = 0; i < 3; ++i) group = group << 8 | (i < count ? bytes[at + i] : 0u);
    for (std::size_t i = 0; i < 4; ++i)
      out += i <= count ? kDigits[group >> (18 - 6 * i) & 63] : '=';
  }
  return out;
}

std::string ScriptJson(const nlohmann::ordered_json& json) {
  std::string out = DumpJson(Shown(json));
  for (std::size_t at = out.find('<'); at != std::string::npos; at = out.find('<', at))
    out.replace(at, 1, "\\u003c");
  return out;
}

Result<std::string> PngAddress(const ImageU8& image) {
  TILEGRAD_ASSIGN(const Bytes png, io::EncodePng(image));
  return "data:image/png;base64," + Base64(png);
}

Result<std::string> FillTemplate(std::string_view text,
                                 const std::map<std::string, std::string>& values) {
  std::string out;
  for (std::size_t at = 0;;) {
    const std::size_t open = text.find("{{", at);
    out += text.substr(at, open - at);
    if (open == std::string_view::npos) return out;
    const std::size_t close = text.find("}}", open);
    const std::string name(text.substr(open + 2, close - open - 2));
    const auto value = values.find(name);
    if (close == std::string_view::npos || value == values.end())
      return InternalError("the page's template has no value for \"{}\"", name);
    out += value->second;
    at = close + 2;
  }
}

}  // namespace tilegrad::train
