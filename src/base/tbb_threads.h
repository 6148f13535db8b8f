// SPDX-License-Identifier: Apache-2.0
// The threads that oneTBB may start. It ends the process where the system refuses it one.
#pragma once

namespace tilegrad {

// For one more Workers of `count` >= 1: how many they may be, 1..count; the rest is refused.
int AddTbbThreads(int count);
// Workers of `count`, as AddTbbThreads has it, end.
void RemoveTbbThreads(int count);

}  // namespace tilegrad
