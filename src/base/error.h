// SPDX-License-Identifier: Apache-2.0
// Short ways to make a Status with a formatted message: InvalidArgument("faces must be [F,3], got
// {} indices", n).
#pragma once

#include <fmt/format.h>

#include "tilegrad/status.h"

namespace tilegrad {

#define TILEGRAD_ERROR_MAKER(Name, kCode)                                      \
  template <class... A>                                                        \
  Status Name(fmt::format_string<A...> format, A&&... args) {                  \
    return {StatusCode::kCode, fmt::format(format, std::forward<A>(args)...)}; \
  }
TILEGRAD_ERROR_MAKER(InvalidArgument, kInvalidArgument)
TILEGRAD_ERROR_MAKER(NotFound, kNotFound)
TILEGRAD_ERROR_MAKER(DataLoss, kDataLoss)
TILEGRAD_ERROR_MAKER(IoError, kIo)
TILEGRAD_ERROR_MAKER(ResourceExhausted, kResourceExhausted)
TILEGRAD_ERROR_MAKER(Cancelled, kCancelled)
TILEGRAD_ERROR_MAKER(InternalError, kInternal)
#undef TILEGRAD_ERROR_MAKER

}  // namespace tilegrad
