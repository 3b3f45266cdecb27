# SPDX-License-Identifier: Apache-2.0
"""The equations of docs/models beside the library: each test follows the numbers of a section."""

# mypy: disable-error-code="union-attr, arg-type"

import numpy as np

import locfuse.core as lf


def test_kalman() -> None:  # docs/models/updates.md, section 1
    belief = lf.GaussianBelief()
    body = belief.add("body", lf.SlotKind.POSE2, [1.0, 2.0, 0.3], np.diag([0.2, 0.1, 0.05]) ** 2)
    P, x = belief.P, belief.x
    H, R, r = np.array([[0.8, 0.6, 0.1]]), np.array([[0.01]]), np.array([0.05])

    S = H @ P @ H.T + R  # (1.1)
    K = P @ H.T / S  # (1.3)
    outcome = lf.update(belief, lf.Linearization(r, H, R), [body], lf.Gate(0.999))

    assert np.isclose(outcome.nis, r @ np.linalg.solve(S, r))  # (1.2)
    assert np.allclose(belief.x, x + K @ r)  # (1.4)
    A = np.eye(3) - K @ H
    assert np.allclose(belief.P, A @ P @ A.T + K @ R @ K.T)  # (1.5)
    assert np.isclose(
        outcome.log_likelihood, -0.5 * (outcome.nis + np.log(2 * np.pi * S[0, 0]))
    )  # (1.9)


def test_robust() -> None:  # docs/models/updates.md, section 2
    belief = lf.GaussianBelief()
    level = belief.add("level", lf.SlotKind.SCALAR, [0.0], np.eye(1))
    noise = lf.NoiseShape(lf.NoiseKind.CAUCHY)
    r, C, R = 3.0, 1.0, 0.25

    share, _mean, f = noise.parts.T
    S = C + f * R  # (2.2)
    w = share * np.exp(-0.5 * r**2 / S) / np.sqrt(S)
    w /= w.sum()
    g, A = np.sum(w * r / S), np.sum(w / S)  # (2.3)
    B = np.sum(w * (r / S) ** 2) - g**2  # (2.4)

    range_like = lf.Linearization(np.array([r]), np.eye(1), np.array([[R]]))
    outcome = lf.update(belief, range_like, [level], lf.Gate(1), noise)
    assert np.isclose(belief.x[0], C * g)
    assert np.isclose(belief.P[0, 0], C - C * A * C + C * B * C)
    assert np.isclose(outcome.nis, r**2 / (C + R))


def test_odometry() -> None:  # docs/models/motion.md, section 1
    config = lf.OdometryConfig()
    pose, motion, seconds = lf.Pose2(1, 2, 0.4), lf.Pose2(0.3, 0.05, -0.2), 0.5
    step = lf.OdometryMotion(config).propagate(pose, motion, seconds)

    expected = pose * motion  # (1.1)
    assert np.allclose(lf.local(step.moved, expected), 0)
    c, s = np.cos(pose.heading), np.sin(pose.heading)
    ex, ey = c * motion.x - s * motion.y, s * motion.x + c * motion.y
    assert np.allclose(step.jacobian, [[1, 0, -ey], [0, 1, ex], [0, 0, 1]])  # (1.2)
    d, a = np.hypot(ex, ey), abs(motion.heading)
    q = [  # (1.3)
        config.sigma_longitudinal_per_sqrt_m**2 * d
        + (config.sigma_longitudinal_per_sqrt_s**2 + config.sigma_xy_per_sqrt_s**2) * seconds,
        config.sigma_lateral_per_sqrt_m**2 * d + config.sigma_xy_per_sqrt_s**2 * seconds,
        config.sigma_heading_per_sqrt_m**2 * d
        + config.sigma_heading_per_sqrt_rad**2 * a
        + config.sigma_heading_per_sqrt_s**2 * seconds,
    ]
    G = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert np.allclose(step.noise, G @ np.diag(q) @ G.T)  # (1.4)

    quarter = lf.arc(1.0, 0.0, np.pi / 2)  # (1.5): a quarter of a circle of radius 2 / pi
    assert np.allclose([quarter.x, quarter.y], 2 / np.pi)


def test_gyro_odometry() -> None:  # docs/models/motion.md, section 2
    odometry = lf.GyroOdometry(lf.GyroOdometryConfig())
    for k in range(500):  # standing for five seconds, with a bias of 0.02 rad/s
        odometry.on(lf.Imu(k * 10**7, [0.0, 0.0, 0.02], [0.0, 0.0, 9.81]))
        if k % 2:
            odometry.on(lf.Increment((k - 1) * 10**7, (k + 1) * 10**7, lf.Pose2()))
    assert abs(odometry.bias - 0.02) < 1e-3


def test_ackermann() -> None:  # docs/models/motion.md, section 3
    L, H, w, alpha = 2.83, 0.76, 3.0, 0.3
    config = lf.AckermannConfig(
        wheel_base_m=L, encoder_left_m=H, sigma_speed_mps=0.2, sigma_steering_rad=0.07
    )
    vehicle = lf.AckermannVehicle(config)
    u = vehicle.velocity(stamp=0, wheel_speed=w, steering=alpha)

    r = L / np.tan(alpha)  # (3.1)
    assert np.isclose(u.forward, w * r / (r - H))  # (3.2)
    assert np.isclose(u.turn_rate, u.forward / r)  # (3.3)
    s, k = 1 - np.tan(alpha) * H / L, 1 / (L * np.cos(alpha) ** 2)
    J = np.array([[1, u.forward * k * H], [np.tan(alpha) / L, u.forward * k]]) / s
    assert np.allclose(vehicle.jacobian(w, alpha), J)  # (3.4)
    C = vehicle.covariance(w, alpha)
    assert np.allclose(C, J @ np.diag([0.2**2, 0.07**2]) @ J.T)  # (3.5)

    T = 0.025
    straight = np.sqrt(np.diag(vehicle.covariance(w, 0.0)) * T**2 / (w * T))  # per root of a metre
    assert np.allclose(straight[1], 0.07 / L * np.sqrt(w * T))  # (3.6)
    laser = lf.Pose2(1, 2, 0.4) * lf.Pose2(3.78, 0.5, 0)
    assert np.allclose(lf.Pose2(1, 2, 0.4).act([3.78, 0.5]), [laser.x, laser.y])  # (3.7)


def test_constant_velocity() -> None:  # docs/models/motion.md, section 4
    config = lf.ConstantVelocityConfig()
    config.sigma_velocity_per_sqrt_s, config.sigma_climb_per_sqrt_s = 0.5, 0.3
    config.sigma_heading_per_sqrt_s = 0.2
    state = np.array([1.0, 2.0, 0.5, 3.0, 0.4, -0.2, 0.1])  # x, y, heading, height, velocity, climb
    T = 2.0
    step = lf.ConstantVelocityMotion(config).propagate(state, T)
    assert np.allclose(step.moved, [1.8, 1.6, 0.5, 3.2, 0.4, -0.2, 0.1])
    for place, rate, sigma in ((0, 4, 0.5), (1, 5, 0.5), (3, 6, 0.3)):
        axis = np.ix_([place, rate], [place, rate])
        assert np.allclose(step.jacobian[axis], [[1, T], [0, 1]])  # (4.2)
        assert np.allclose(
            step.noise[axis], sigma**2 * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
        )
    assert np.isclose(step.noise[2, 2], 0.2**2 * T)  # (4.3)


def test_range() -> None:  # docs/models/ranges.md, section 1
    config = lf.RangeConfig()
    config.sigma_m, config.sigma_relative = 0.05, 0.01
    anchor, tag = np.array([4.0, 1.0, 2.5]), np.array([0.2, -0.1, 1.1])
    scale, offset = 1.02, 0.1
    anchors = lf.AnchorMap([lf.Anchor(7, anchor, offset, scale)])
    model = lf.RangeModel(config, anchors, [lf.Tag(0, tag)])
    pose, z = lf.Pose2(1.0, 2.0, 0.7), lf.Range(stamp=0, tag=0, anchor=7, range=3.5)
    lin = model.linearize(pose, z)

    q = np.array([*pose.act(tag[:2]), tag[2]])
    distance = np.linalg.norm(anchor - q)
    u = (q - anchor) / distance  # (1.2)
    w = q[:2] - [pose.x, pose.y]
    assert np.isclose(lin.residual[0], z.range - (scale * distance + offset))  # (1.1)
    assert np.allclose(
        lin.jacobian, scale * np.array([u[0], u[1], u[1] * w[0] - u[0] * w[1]])
    )  # (1.3)
    assert np.isclose(lin.noise[0, 0], 0.05**2 + (0.01 * distance) ** 2)  # (1.4)
    space = model.linearize(pose, 0.0, z)
    assert np.array_equal(space.jacobian[:, :3], lin.jacobian)
    assert np.isclose(space.jacobian[0, 3], scale * u[2])  # (1.5)


def test_multilateration() -> None:  # docs/models/ranges.md, section 2
    anchors = np.array([[0.0, 0.0, 2.5], [10.0, 0.0, 2.0], [10.0, 8.0, 2.5], [0.0, 8.0, 2.2]])
    truth, height, sigma = np.array([3.0, 4.0]), 1.1, 0.05
    ranges = np.linalg.norm(anchors - [*truth, height], axis=1)
    solution = lf.locate(anchors, ranges, sigma, height=height)
    assert solution.status == lf.PositionStatus.UNIQUE
    assert np.allclose(solution.position, truth)
    bound = lf.cramer_rao(anchors, truth[None], sigma, height=height)[0]
    assert np.allclose(solution.covariance, bound)  # (2.17) is (2.22) at the truth

    ranges[2] += 1.0  # no line of sight
    solution = lf.locate(anchors[:4], ranges, sigma, height=height)
    assert solution.status == lf.PositionStatus.INCONSISTENT


def test_position() -> None:  # docs/models/poses.md, section 1
    config = lf.PositionConfig()
    config.antenna_forward_m, config.antenna_left_m = 0.4, -0.1
    pose, cov = lf.Pose2(1, 2, 0.7), np.array([[0.04, 0.01], [0.01, 0.09]])
    lin = lf.PositionModel(config).linearize(pose, lf.PositionFix(0, [1.3, 2.1], cov))

    p_antenna = pose.act([0.4, -0.1])
    w = p_antenna - [pose.x, pose.y]
    assert np.allclose(lin.residual, [1.3, 2.1] - p_antenna)  # (1.1)
    assert np.allclose(lin.jacobian, [[1, 0, -w[1]], [0, 1, w[0]]])  # (1.2)
    assert np.allclose(lin.noise, cov)

    tags = [lf.Tag(1, [0.5, 0.25, 1.0]), lf.Tag(2, [-0.5, 0.25, 1.0])]
    model, sigma, P_inverse = lf.PositionModel(config, tags), 0.1, np.zeros((3, 3))
    for tag in (1, 2):
        lin = model.linearize(pose, lf.PositionFix(0, [1, 2], sigma**2 * np.eye(2), tag))
        P_inverse += lin.jacobian.T @ np.linalg.solve(lin.noise, lin.jacobian)
    assert np.isclose(np.linalg.inv(P_inverse)[2, 2], 2 * sigma**2 / 1.0**2)  # (1.3)


def test_pose() -> None:  # docs/models/poses.md, section 2
    pose, cov = lf.Pose2(1, 2, 3.1), np.diag([0.04, 0.04, 0.01])
    lin = lf.PoseModel().linearize(pose, lf.PoseObservation(0, lf.Pose2(1.1, 1.9, -3.1), cov))
    assert np.allclose(lin.residual, [0.1, -0.1, 2 * np.pi - 6.2])  # (2.2)
    assert np.allclose(lin.jacobian, np.eye(3))
    assert np.allclose(lin.noise, cov)


def test_pose_source() -> None:  # docs/models/poses.md, section 3
    start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0), 4.0 * np.eye(3))
    ekf = lf.PoseEkf(lf.PoseEkfConfig(), lf.World(), start)
    R = 0.01 * np.eye(3)
    for k in range(10):  # the same error, again and again
        ekf.on(lf.PoseObservation(k, lf.Pose2(0.1, 0, 0), R))
    assert np.isclose(ekf.estimate().pose.x, 0.1, atol=1e-3)
    assert np.all(np.diag(ekf.estimate().covariance) > 0.009)  # it does not become surer


def test_rigid_fit() -> None:  # docs/models/poses.md, section 4
    rng = np.random.default_rng(3)
    body = np.array([[0.6, 0.0], [-0.45, 0.25], [-0.45, -0.25]])
    truth, sigma = lf.Pose2(2.0, 1.0, 2.5), 0.02
    nees = []
    for _ in range(500):
        world = np.array([truth.act(b) for b in body]) + sigma * rng.standard_normal((3, 2))
        fit = lf.rigid_fit(body, world, sigma**2 * np.eye(6))
        error = lf.local(truth, fit.pose)
        nees.append(error @ np.linalg.solve(fit.covariance, error))
    spread = np.sum((body - body.mean(axis=0)) ** 2)
    assert np.isclose(fit.covariance[2, 2], sigma**2 / spread)  # (4.7)
    print(f"mean NEES {np.mean(nees):.2f} (expected 3)")
    assert 2.7 < np.mean(nees) < 3.3
    mirrored = lf.rigid_fit(body + [0, 0.1], body * [1, -1], sigma**2 * np.eye(6))
    assert mirrored.status != lf.RigidFitStatus.FITTED or mirrored.nis > 16.3


def test_velocity() -> None:  # docs/models/poses.md, section 5
    config = lf.VelocityConfig()
    points = np.array([[0.6, 0.0], [-0.45, 0.25], [-0.45, -0.25]])
    heading, twist = 0.7, np.array([0.3, 0.0, 0.2])
    lin = lf.VelocityModel(config).linearize(np.zeros(6), heading, twist, points)
    here, T = lf.Pose2(0, 0, heading), 1e-6
    ahead = here * lf.arc(0.3 * T, 0.0, 0.2 * T)
    moved = [(np.array(ahead.act(t)) - here.act(t)) / T for t in points]
    assert np.allclose(lin.residual, np.ravel(moved), atol=1e-6)  # (5.1), (5.2)
    shared = lin.noise - config.sigma_point_mps**2 * np.eye(6)
    assert np.linalg.matrix_rank(shared, tol=1e-9) == 3  # (5.4)


def test_point_distance() -> None:  # docs/models/poses.md, section 6
    model = lf.PointDistanceModel(lf.PointDistanceConfig())
    a, b = np.array([1.0, 2.0]), np.array([1.6, 2.8])
    lin = model.linearize(a, b, 1.1)
    assert np.allclose(lin.residual, 0.1)  # (6.1)
    assert np.allclose(lin.jacobian, [[-0.6, -0.8, 0.6, 0.8]])  # (6.2)
    turned = a + lf.Pose2(0, 0, 0.1).act(b - a)
    linear = b + (turned - b) @ np.array([[-0.8], [0.6]]) * np.array([-0.8, 0.6])
    assert np.isclose(model.predict(a, linear) - 1.0, 0.1**2 / 2, rtol=0.02)


def test_landmark_ekf() -> None:  # docs/models/landmarks.md, section 4
    start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0), np.diag([0.1, 0.1, 0.05]) ** 2)
    config = lf.LandmarkEkfConfig()
    config.landmark.sigma_range_m, config.landmark.sigma_bearing_rad = 0.1, 0.02
    ekf = lf.LandmarkEkf(config, lf.World(), start)
    ekf.on(lf.RangeBearing(0, landmark=1, range=4.0, bearing=0.0))

    P, R = start.covariance, np.diag([0.1, 0.02]) ** 2
    G_x, G_z = np.array([[1, 0, 0], [0, 1, 4]]), np.diag([1.0, 4.0])  # (4.4), (4.5)
    assert np.allclose(ekf.landmarks()[0].position, [4, 0])  # (4.3)
    assert np.allclose(ekf.belief.P[3:, :3], G_x @ P)
    assert np.allclose(ekf.belief.P[3:, 3:], G_x @ P @ G_x.T + G_z @ R @ G_z.T)


def test_cylinders() -> None:  # docs/models/landmarks.md, section 5
    geometry = lf.LaserGeometry(lf.Pose2(), -np.pi, np.pi / 180, range_min=0.1, range_max=10.0)
    angle = -np.pi + np.arange(360) * np.pi / 180
    rng = np.random.default_rng(1)

    def to_disc(x: float, y: float, radius: float) -> np.ndarray:
        ahead, left = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        hit = (np.abs(left) < radius) & (ahead > 0)
        return np.where(hit, ahead - np.sqrt(np.maximum(radius**2 - left**2, 0)), 9.9)

    ranges = np.minimum(to_disc(2, 2, 1), to_disc(-2, 2, 1)) + rng.normal(0, 0.01, 360)
    scan = lf.LaserScan(0, geometry, ranges)
    right, left = lf.CylinderDetector(lf.CylinderDetectorConfig(radius_m=1.0)).detect(scan)
    assert abs(left.range - np.sqrt(8)) < 0.01
    assert abs(left.bearing - 3 * np.pi / 4) < 0.01
    closest = lf.closest_beam(scan, right.first, right.last, radius=1.0)
    assert abs(closest.bearing - np.pi / 4) > 2 * abs(right.bearing - np.pi / 4)


def test_scan_matching() -> None:  # docs/models/scans.md, section 1
    cells = np.zeros((122, 162), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100  # a room of 8 x 6 m
    matcher = lf.ScanMatcher(lf.OccupancyGrid(cells, 0.05, lf.Pose2(-0.05, -0.05, 0.0)))
    laser = lf.LaserGeometry(lf.Pose2(), 0.0, np.pi / 90, range_min=0.1, range_max=12.0)
    angle = 0.3 + np.arange(180) * np.pi / 90
    to_walls = np.minimum(4.0 / np.abs(np.cos(angle)), 3.0 / np.abs(np.sin(angle)))
    scan = lf.LaserScan(0, laser, to_walls)

    found = matcher.search(scan, position=[4.1, 2.9], covariance=0.01 * np.eye(2))
    assert found.status is lf.ScanSearchStatus.AMBIGUOUS  # turned by half a turn, it looks the same
    headings = sorted(h.match.pose.heading for h in found.hypotheses[:2])
    assert np.allclose(headings, [0.3 - np.pi, 0.3], atol=0.01)

    odometry = lf.ScanOdometry()
    start = lf.PoseEstimate(0, lf.Pose2(4, 3, 0.3), 1e-4 * np.eye(3))
    ekf = lf.PoseEkf(lf.PoseEkfConfig(), lf.World(), start)
    for stamp, x in ((1, 0.0), (2, 0.1), (3, 0.2)):  # from (4, 3) along the heading of 0.3 rad
        at_x, at_y = 4.0 + x * np.cos(0.3), 3.0 + x * np.sin(0.3)
        to_x = np.where(np.cos(angle) > 0, 8.0 - at_x, -at_x) / np.cos(angle)
        to_y = np.where(np.sin(angle) > 0, 6.0 - at_y, -at_y) / np.sin(angle)
        seen = lf.LaserScan(stamp, laser, np.minimum(to_x, to_y))
        step = odometry.on(
            seen, motion=lf.Pose2(0.12, 0, 0.01), covariance=np.diag([0.02, 0.01, 0.01]) ** 2
        )
        ekf.on(step.increment)
    now = ekf.estimate(3).pose
    assert np.allclose([now.x, now.y, now.heading], [at_x, at_y, 0.3], atol=0.01)
    assert step.match.weak_direction is None
