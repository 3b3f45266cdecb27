// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Everything a user of the library needs.
#include "locfuse/error.hpp"
#include "locfuse/estimators/initializer.hpp"
#include "locfuse/estimators/landmark_ekf.hpp"
#include "locfuse/estimators/mcl.hpp"
#include "locfuse/estimators/pose_ekf.hpp"
#include "locfuse/filters/kalman.hpp"
#include "locfuse/frontends/cylinder_detector.hpp"
#include "locfuse/frontends/locate.hpp"
#include "locfuse/frontends/range_batch.hpp"
#include "locfuse/frontends/scan_odometry.hpp"
#include "locfuse/frontends/single_beam_landmarks.hpp"
#include "locfuse/maps/anchor_map.hpp"
#include "locfuse/maps/ray_caster.hpp"
#include "locfuse/math/numerical_jacobian.hpp"
#include "locfuse/messages/message.hpp"
#include "locfuse/replay/localize.hpp"
#include "locfuse/replay/replay.hpp"
#include "locfuse/replay/start.hpp"
#include "locfuse/time.hpp"
