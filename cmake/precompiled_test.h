// SPDX-License-Identifier: Apache-2.0
// What every test includes besides precompiled.h.
#pragma once

#include <gtest/gtest.h>
