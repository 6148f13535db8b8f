// SPDX-License-Identifier: Apache-2.0
// Measurements as text and pictures.
#pragma once

#include <string>
#include <vector>

#include "report/measurements.h"
#include "train/report/html.h"

namespace tilegrad::bench {

// All of them, one a line, times in milliseconds of a whole batch.
std::string MeasurementsCsv(const std::vector<Measurement>& all);

// Markdown: the renderer on one worker against the references, two workers and the counted limit.
// A row for each scene, direction and what; growth series are left out.
std::string SpeedTable(const std::vector<Measurement>& all);

// Markdown: what requests cost beside the silhouette alone of the same scene and direction; empty
// where shade_bench was not run.
std::string RequestTable(const std::vector<Measurement>& all);

// Growth series `axis` ("faces", "pixels" or "delta"): CPU time against it. Empty series where it
// was not measured.
train::LogPlot GrowthPlot(const std::vector<Measurement>& all, const std::string& axis);
// The same as Markdown; empty where it was not measured.
std::string GrowthTable(const std::vector<Measurement>& all, const std::string& axis);

}  // namespace tilegrad::bench
