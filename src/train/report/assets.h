// SPDX-License-Identifier: Apache-2.0
// The files of the page, compiled in: report.html with {{placeholders}}, report.css, report.js.
#pragma once

#include <string_view>

namespace tilegrad::train {

extern const std::string_view kReportHtml, kReportCss, kReportJs;
// What all pages draw with, the live page, and that of a fit.
extern const std::string_view kPartsJs, kLiveHtml, kLiveJs, kFitHtml;

}  // namespace tilegrad::train
