// SPDX-License-Identifier: Apache-2.0
// The sanitizer of this build. GCC 12 defines macros; clang has __has_feature.
#pragma once

namespace tilegrad {

#ifdef __has_feature
inline constexpr bool kAddressSanitizer = __has_feature(address_sanitizer);
inline constexpr bool kThreadSanitizer = __has_feature(thread_sanitizer);
#else
#ifdef __SANITIZE_ADDRESS__
inline constexpr bool kAddressSanitizer = true;
#else
inline constexpr bool kAddressSanitizer = false;
#endif
#ifdef __SANITIZE_THREAD__
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif
#endif

// Both reserve terabytes of address space, so no memory limit may count it, and must be the first
// library that a process loads.
inline constexpr bool kSanitizer = kAddressSanitizer || kThreadSanitizer;

}  // namespace tilegrad
