# SPDX-License-Identifier: Apache-2.0
"""Ackermann vehicles from Python: single readings, columns of them, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import locfuse.core as lf


def truck(sigma_speed_mps: float = 0.0, sigma_steering_rad: float = 0.0) -> lf.AckermannVehicle:
    config = lf.AckermannConfig(
        wheel_base_m=2.83,
        encoder_left_m=0.76,
        sigma_speed_mps=sigma_speed_mps,
        sigma_steering_rad=sigma_steering_rad,
    )
    return lf.AckermannVehicle(config)


def test_columns_say_what_single_readings_say() -> None:
    rng = np.random.default_rng(1)
    speed, steering = rng.uniform(-5.0, 5.0, 50), rng.uniform(-0.6, 0.6, 50)
    single = [truck().velocity(0, w, alpha) for w, alpha in zip(speed, steering, strict=True)]
    expected = [[u.forward, u.turn_rate] for u in single]
    np.testing.assert_array_equal(truck().velocities(speed, steering), expected)
    assert truck().velocities(np.empty(0), np.empty(0)).shape == (0, 2)


def test_a_rigid_body_comes_back_from_its_wheel() -> None:
    forward, turn_rate = 3.0, np.array([-0.4, 0.0, 0.4])
    wheel, steering = forward - 0.76 * turn_rate, np.arctan(2.83 * turn_rate / forward)
    found = truck().velocities(wheel, steering)
    np.testing.assert_allclose(found, [[3.0, -0.4], [3.0, 0.0], [3.0, 0.4]], rtol=1e-14)


def test_the_covariance_is_that_of_the_readings_through_the_jacobian() -> None:
    vehicle = truck(0.2, 0.07)
    assert (vehicle.config.sigma_speed_mps, vehicle.config.sigma_steering_rad) == (0.2, 0.07)
    J = vehicle.jacobian(3.0, 0.3)
    np.testing.assert_allclose(vehicle.covariance(3.0, 0.3), J @ np.diag([0.04, 0.0049]) @ J.T)
    step = 1e-6
    for column, (w, alpha) in enumerate([(step, 0.0), (0.0, step)]):
        ends = vehicle.velocities([3.0 - w, 3.0 + w], [0.3 - alpha, 0.3 + alpha])
        np.testing.assert_allclose(J[:, column], (ends[1] - ends[0]) / (2.0 * step), atol=1e-8)


def test_what_is_no_vehicle_and_no_reading_is_refused_with_its_value() -> None:
    with pytest.raises(ValueError, match=r"wheel_base_m is -1\.0"):
        lf.AckermannVehicle(lf.AckermannConfig(wheel_base_m=-1.0))
    pole = float(np.arctan2(2.83, 0.76))
    with pytest.raises(ValueError, match=rf"steering is {pole:.6f}: the turn is not about"):
        truck().velocity(0, 1.0, pole)
    with pytest.raises(ValueError, match="wheel_speed is nan"):
        truck().velocities([1.0, np.nan], [0.0, 0.0])
    with pytest.raises(ValueError, match=r"steering has shape \(1,\), expected \(2,\)"):
        truck().velocities([1.0, 1.0], [0.0])
    with pytest.raises(ValueError, match=r"wheel_speed has shape \(1, 2\)"):
        truck().velocities([[1.0, 1.0]], [0.0])
