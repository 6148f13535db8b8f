// SPDX-License-Identifier: Apache-2.0
// Public names live in an inline namespace that carries the version of the binary interface: you
// write tilegrad::Renderer, the linker sees tilegrad::v0::Renderer, and a program built against
// another version fails to link instead of misbehaving.
#pragma once

#ifdef TILEGRAD_BUILDS_LIBRARY  // whose engine has names of its own in tilegrad
#define TILEGRAD_ABI v0
#else
#define TILEGRAD_ABI inline v0
#endif

#define TILEGRAD_API [[gnu::visibility("default")]]  // what the shared library exports
