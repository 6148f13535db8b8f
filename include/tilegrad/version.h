// SPDX-License-Identifier: Apache-2.0
// The version of the library, the only place in code that states it (CMakeLists.txt repeats it, a
// test compares).
#pragma once
#define TILEGRAD_VERSION_MAJOR 0
#define TILEGRAD_VERSION_MINOR 2
#define TILEGRAD_VERSION_PATCH 0
#define TILEGRAD_VERSION "0.2.0"
