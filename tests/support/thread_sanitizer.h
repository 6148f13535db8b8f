// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace tilegrad::test {

// Under ThreadSanitizer loops run on threads that live for one loop (base/parallel.cc): they are
// not pinned, and starting them allocates.
#ifdef __SANITIZE_THREAD__
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif

}  // namespace tilegrad::test
