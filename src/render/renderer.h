// SPDX-License-Identifier: Apache-2.0
// The Renderer of the public interface for use inside the project: on shared workers, and with a
// report of what ran.
#pragma once

#include "base/parallel.h"
#include "render/shading/plan.h"
#include "tilegrad/renderer.h"

namespace tilegrad {

// Keeps a reference. T: float or double.
template <class T = float>
RendererT<T> RendererOn(const Workers& workers);

// Reports the last call, except one that ran out of memory.
PlanReport Explain(const Renderer& renderer);

}  // namespace tilegrad
