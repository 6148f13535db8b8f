// SPDX-License-Identifier: Apache-2.0
// The building blocks of pages: their files, safe text, and plots as SVG.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "scene/image.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

struct LogPoint {
  double x, y;        // > 0
  std::string title;  // the browser's tooltip
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

// The files of pages, and text that is safe to put into them.

// Compiled in: report.html with {{placeholders}}, report.css, report.js.
extern const std::string_view kReportHtml, kReportCss, kReportJs;
// The script that all pages share, the live page, and the page of a fit.
extern const std::string_view kPartsJs, kLiveHtml, kLiveJs, kFitHtml;

// 3214902 as "3,214,902".
std::string WithCommas(std::int64_t number);

std::string Base64(std::span<const std::uint8_t> bytes);

// JSON for a <script> element: every '<' is written as \u003c, so nothing in it can end the
// element. Bytes that are not UTF-8 become replacement characters.
std::string ScriptJson(const nlohmann::ordered_json& json);

// A PNG as data: address.
Result<std::string> PngAddress(const ImageU8& image);

// Replaces {{x}} in `text` by values["x"]; does not search the values again. kInternal names a
// placeholder without a value.
Result<std::string> FillTemplate(std::string_view text,
                                 const std::map<std::string, std::string>& values);

}  // namespace tilegrad::train
