// SPDX-License-Identifier: Apache-2.0
// All checks, by what they check.
#pragma once

#include <vector>

#include "proof/selftest/check.h"

namespace tilegrad::selftest {

std::vector<Check> TriangleChecks();    // images of one triangle against closed formulas
std::vector<Check> SphereChecks();      // every gradient against float64, and that against steps
std::vector<Check> AlphaBoundChecks();  // the bound on alpha, and any order of faces
std::vector<Check> SameBitsChecks();    // threads, batches
std::vector<Check> ExtremeChecks();     // degenerate scenes, numbers that are none
std::vector<Check> KernelChecks();      // products and convolutions of networks
std::vector<Check> TrainingChecks();    // the gradient penalty, and steps of training
std::vector<Check> FileChecks();        // written and read back
std::vector<Check> MetricChecks();      // scores that are known

std::vector<Check> AllChecks();  // in this order

}  // namespace tilegrad::selftest
