// SPDX-License-Identifier: Apache-2.0
// The Renderer of the public interface, as the project itself uses it: on workers that it shares
// with others, and with an account of what ran.
#pragma once

#include "base/parallel.h"
#include "render/shading/plan.h"
#include "tilegrad/renderer.h"

namespace tilegrad {

// Keeps a reference. T: float or double.
template <class T = float>
RendererT<T> RendererOn(const Workers& workers);

// The last call, but one that failed for want of memory.
PlanReport Explain(const Renderer& renderer);

}  // namespace tilegrad
