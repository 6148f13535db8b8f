// SPDX-License-Identifier: Apache-2.0
#include "base/thread_data.h"

#include <exception>

namespace tilegrad {
namespace {

thread_local volatile int t_exceptions = 0;  // volatile: a compiler leaves out what nobody reads

}  // namespace

void ReserveThreadData() { t_exceptions = std::uncaught_exceptions(); }

}  // namespace tilegrad
