// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "circle.hpp"

/// Orocos BFL's extended Kalman filter on the same input and noise.
/// Estimates: x, y, heading per step.
void run_bfl(const Circle& input, std::vector<double>& estimates);
