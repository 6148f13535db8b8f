// SPDX-License-Identifier: Apache-2.0
// A picture of curves over two logarithmic axes, as SVG.
#pragma once

#include <string>
#include <vector>

namespace tilegrad::train {

struct LogPoint {
  double x, y;        // > 0
  std::string title;  // shown by a browser where the mouse is
};

struct LogSeries {
  std::vector<std::string> name;  // lines of its key, at most two
  std::vector<LogPoint> points;   // joined in this order
};

struct LogPlot {
  std::string x_label, y_label;
  std::vector<LogSeries> series;
};

// 720 x 440 pixels; axes end at powers of ten. Texts are escaped.
std::string LogPlotSvg(const LogPlot& plot);

}  // namespace tilegrad::train
