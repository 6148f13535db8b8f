// SPDX-License-Identifier: Apache-2.0
// TensorBoard event files: TFRecord framing around protocol-buffer events that hold scalars. The
// few fields needed are encoded by hand; TensorFlow's crc32c masking as in
// tensorflow/core/lib/io/record_writer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "base/file.h"

namespace tilegrad::train {

using Scalars = std::vector<std::pair<std::string, double>>;  // tag, value

// The bytes of one record; a file is a version record followed by any number of scalar records.
std::string TensorboardVersionRecord(double wall_time);
std::string TensorboardScalarsRecord(double wall_time, std::int64_t step, const Scalars& scalars);

// Castagnoli's CRC.
std::uint32_t Crc32c(std::string_view bytes);

}  // namespace tilegrad::train
