// SPDX-License-Identifier: Apache-2.0
// Which sanitizer a test is built under: GCC defines macros, clang answers __has_feature.
#pragma once

#ifndef __has_feature
#define __has_feature(feature) 0
#endif

namespace tilegrad::test {

// Under ThreadSanitizer loops run on threads that live for one loop (base/parallel.cc): they are
// not pinned, and starting them allocates.
#if defined(__SANITIZE_THREAD__) || __has_feature(thread_sanitizer)
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif

// Under AddressSanitizer memory is reserved by terabytes, and a child that is forked while another
// thread allocates waits for ever for the allocator.
#if defined(__SANITIZE_ADDRESS__) || __has_feature(address_sanitizer)
inline constexpr bool kAddressSanitizer = true;
#else
inline constexpr bool kAddressSanitizer = false;
#endif

}  // namespace tilegrad::test
