// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "circle.hpp"

/// Orocos BFL's extended Kalman filter on the same input and noise.
/// Estimates: x, y, heading per step. Returns the heap allocations of the steps.
std::size_t run_bfl(const Circle& input, std::vector<double>& estimates);
