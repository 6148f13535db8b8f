// SPDX-License-Identifier: Apache-2.0
// Public names live in an inline namespace that carries the version of the binary interface: you
// write tilegrad::Renderer, the linker sees tilegrad::v0::Renderer, and a program built against
// another version fails to link instead of misbehaving.
#pragma once

#if __cplusplus <= 201703L
#error "tilegrad needs C++20: compile with -std=c++20"
#endif

#define TILEGRAD_API [[gnu::visibility("default")]]  // exported by the shared library
