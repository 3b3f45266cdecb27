"""
The C++ core of locfuse; use it through `import locfuse`.
"""

from __future__ import annotations
import collections.abc
import enum
import numpy
import numpy.typing
import typing

__all__: list[str] = [
    "Anchor",
    "AnchorMap",
    "Gate",
    "GaussianBelief",
    "Increment",
    "Linearization",
    "MessageLog",
    "NumericalError",
    "OdometryConfig",
    "OdometryMotion",
    "Outcome",
    "Pose2",
    "PoseEkf",
    "PoseEkfConfig",
    "PoseEstimate",
    "PoseModel",
    "PoseObservation",
    "PositionConfig",
    "PositionFix",
    "PositionModel",
    "Propagation",
    "Range",
    "RangeConfig",
    "RangeModel",
    "RunLog",
    "Slot",
    "SlotKind",
    "Tag",
    "Velocity",
    "Verdict",
    "arc",
    "chi_squared_quantile",
    "local",
    "parse_table",
    "predict",
    "replay",
    "update",
    "wrap_angle",
]

class NumericalError(ArithmeticError):
    pass

class Linearization:
    """
    What a measurement says about its variables.

    Parameters
    ----------
    residual : float64 array, shape (m,)
        z minus h(x), angle rows wrapped to [-pi, pi).
    jacobian : float64 array, shape (m, n)
        d h / d(error state of the n local variables).
    noise : float64 array, shape (m, m)
        R, symmetric positive definite, in the squared unit of the measurement.

    Raises
    ------
    ValueError
        If the shapes do not fit, a number is not finite or the noise not positive definite.

    Examples
    --------
    >>> import locfuse
    >>> compass = locfuse.Linearization(residual=[0.02], jacobian=[[0, 0, 1]], noise=[[0.01]])
    >>> compass.jacobian.shape
    (1, 3)
    """
    def __init__(
        self,
        residual: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        jacobian: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        noise: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None: ...
    def __repr__(self) -> str: ...
    def log_likelihood(self) -> float:
        """
        log N(residual; 0, noise): the log weight of a particle.
        """
    @property
    def jacobian(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (m, n).
        """
    @property
    def noise(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        R, shape (m, m).
        """
    @property
    def residual(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        z - h(x), shape (m,).
        """

class Pose2:
    """
    Pose in the plane, or a motion in the previous body frame.

    Parameters
    ----------
    x, y : float
        Metres.
    heading : float
        Radians, counter-clockwise; results are wrapped to [-pi, pi).

    Examples
    --------
    >>> from locfuse import Pose2
    >>> Pose2(1, 2, 0) * Pose2(0.5, 0, 0.25)
    Pose2(x=1.5, y=2, heading=0.25)
    """

    __hash__: typing.ClassVar[None] = None  # type: ignore[assignment]
    def __eq__(self, arg0: typing.Any) -> bool: ...
    def __init__(
        self,
        x: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        y: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        heading: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None: ...
    def __mul__(self, arg0: Pose2) -> Pose2: ...
    def __repr__(self) -> str: ...
    def act(
        self, point: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Point (2,) in the target frame.
        """
    def inverse(self) -> Pose2: ...
    @property
    def heading(self) -> float:
        """
        Radians.
        """
    @property
    def x(self) -> float:
        """
        Metres.
        """
    @property
    def y(self) -> float:
        """
        Metres.
        """

class Velocity:
    """
    Wheel odometry as body velocities, held from `stamp` [ns] until the next: `forward` [m/s], `turn_rate` [rad/s].
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        forward: typing.SupportsFloat | typing.SupportsIndex,
        turn_rate: typing.SupportsFloat | typing.SupportsIndex,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def forward(self) -> float: ...
    @property
    def stamp(self) -> int: ...
    @property
    def turn_rate(self) -> float: ...

class Increment:
    """
    Wheel odometry as the motion driven from `begin` to `stamp` [ns]: a Pose2 in the body frame at `begin`.
    """
    @staticmethod
    def from_trans_rot(
        begin: typing.SupportsInt | typing.SupportsIndex,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        trans: typing.SupportsFloat | typing.SupportsIndex,
        rot: typing.SupportsFloat | typing.SupportsIndex,
    ) -> Increment:
        """
        ekim2020 eq. (6): drive `trans` [m] along the old heading, then turn by `rot` [rad].
        """
    def __init__(
        self,
        begin: typing.SupportsInt | typing.SupportsIndex,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        motion: Pose2,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def begin(self) -> int: ...
    @property
    def motion(self) -> Pose2: ...
    @property
    def stamp(self) -> int: ...

class Range:
    """
    Distance [m] between a tag on the body and an anchor in the world. Without `sigma` [m] the model's own is used.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        tag: typing.SupportsInt | typing.SupportsIndex,
        anchor: typing.SupportsInt | typing.SupportsIndex,
        range: typing.SupportsFloat | typing.SupportsIndex,
        sigma: typing.SupportsFloat | typing.SupportsIndex | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def anchor(self) -> int: ...
    @property
    def range(self) -> float: ...
    @property
    def sigma(self) -> float | None: ...
    @property
    def stamp(self) -> int: ...
    @property
    def tag(self) -> int: ...

class PositionFix:
    """
    Position (2,) [m] in world with its covariance (2, 2) [m^2].
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 2]"],
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]: ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]: ...
    @property
    def stamp(self) -> int: ...

class PoseObservation:
    """
    T_world_body from another localizer, with the covariance (3, 3) of (x, y, heading).
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        pose: Pose2,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"],
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]: ...
    @property
    def pose(self) -> Pose2: ...
    @property
    def stamp(self) -> int: ...

class Anchor:
    """
    A fixed radio at `position` (3,) [m] in world; a range to it reads scale * distance + offset [m].
    """
    def __init__(
        self,
        id: typing.SupportsInt | typing.SupportsIndex,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        offset: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        scale: typing.SupportsFloat | typing.SupportsIndex = 1.0,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def id(self) -> int: ...
    @property
    def offset(self) -> float: ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]: ...
    @property
    def scale(self) -> float: ...

class AnchorMap:
    """
    The anchors, by id; immutable.

    Raises
    ------
    ValueError
        On a duplicate id, a number that is not finite or a scale that is not positive.
    """
    def __contains__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> bool: ...
    def __init__(self, anchors: collections.abc.Sequence[Anchor]) -> None: ...
    def __len__(self) -> int: ...
    def __repr__(self) -> str: ...
    @property
    def anchors(self) -> list[Anchor]:
        """
        All anchors in order of id.
        """

class Tag:
    """
    A radio on the robot, at `position` (3,) in body: forward, left, up [m].
    """
    def __init__(
        self,
        id: typing.SupportsInt | typing.SupportsIndex,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def id(self) -> int: ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]: ...

class Propagation:
    """
    What a motion model says about one step of a pose.
    """
    @property
    def jacobian(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        F, shape (3, 3).
        """
    @property
    def moved(self) -> Pose2:
        """
        f(x, u).
        """
    @property
    def noise(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Q of this step, shape (3, 3).
        """

class OdometryConfig:
    """
    Noise of wheel odometry: a random walk over distance and turn.
    """
    def __init__(self) -> None: ...
    @property
    def sigma_heading_per_sqrt_m(self) -> float:
        """
        rad / sqrt(m)
        """
    @sigma_heading_per_sqrt_m.setter
    def sigma_heading_per_sqrt_m(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_heading_per_sqrt_rad(self) -> float:
        """
        rad / sqrt(rad)
        """
    @sigma_heading_per_sqrt_rad.setter
    def sigma_heading_per_sqrt_rad(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_heading_per_sqrt_s(self) -> float:
        """
        rad / sqrt(s)
        """
    @sigma_heading_per_sqrt_s.setter
    def sigma_heading_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_lateral_per_sqrt_m(self) -> float:
        """
        m / sqrt(m)
        """
    @sigma_lateral_per_sqrt_m.setter
    def sigma_lateral_per_sqrt_m(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_longitudinal_per_sqrt_m(self) -> float:
        """
        m / sqrt(m)
        """
    @sigma_longitudinal_per_sqrt_m.setter
    def sigma_longitudinal_per_sqrt_m(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_xy_per_sqrt_s(self) -> float:
        """
        m / sqrt(s)
        """
    @sigma_xy_per_sqrt_s.setter
    def sigma_xy_per_sqrt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class OdometryMotion:
    """
    Wheel odometry; docs/models/odometry.md.
    """
    def __init__(self, config: OdometryConfig) -> None: ...
    def propagate(
        self,
        T_world_body: Pose2,
        motion: Pose2,
        seconds: typing.SupportsFloat | typing.SupportsIndex,
    ) -> Propagation:
        """
        Pose after `motion` (a Pose2 in the previous body frame), which took `seconds`.
        """

class RangeConfig:
    """
    R = sigma_m^2 + (sigma_relative * distance)^2 where a range brings no sigma.
    """
    def __init__(self) -> None: ...
    @property
    def sigma_m(self) -> float:
        """
        m
        """
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_relative(self) -> float:
        """
        share of the distance
        """
    @sigma_relative.setter
    def sigma_relative(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class RangeModel:
    """
    Range from a body-fixed tag to an anchor, both in 3D; docs/models/range.md.
    """
    def __init__(
        self, config: RangeConfig, anchors: AnchorMap, tags: collections.abc.Sequence[Tag]
    ) -> None: ...
    def linearize(self, T_world_body: Pose2, z: Range) -> Linearization | None:
        """
        Linearization (1 x 3); None if anchor or tag is unknown, or the tag sits on the anchor.
        """
    def predict(self, T_world_body: Pose2, z: Range) -> float | None:
        """
        Expected range [m]; None if anchor or tag is unknown.
        """

class PositionConfig:
    """
    Lever arm of the antenna of position fixes.
    """
    def __init__(self) -> None: ...
    @property
    def antenna_forward_m(self) -> float: ...
    @antenna_forward_m.setter
    def antenna_forward_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def antenna_left_m(self) -> float: ...
    @antenna_left_m.setter
    def antenna_left_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PositionModel:
    """
    Position of an antenna on the body; docs/models/position.md.
    """
    def __init__(self, config: PositionConfig) -> None: ...
    def linearize(self, T_world_body: Pose2, z: PositionFix) -> Linearization:
        """
        Linearization (2 x 3).
        """
    def predict(
        self, T_world_body: Pose2
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]: ...

class PoseModel:
    """
    Pose from another localizer; docs/models/pose.md.
    """
    def __init__(self) -> None: ...
    def linearize(self, T_world_body: Pose2, z: PoseObservation) -> Linearization:
        """
        Linearization (3 x 3).
        """
    def predict(self, T_world_body: Pose2) -> Pose2: ...

class Verdict(enum.IntEnum):
    """
    What became of a message.
    """

    FUSED = ...
    GATED = ...
    IGNORED = ...
    NOT_MODELLED = ...
    STALE = ...

class Outcome:
    """
    Verdict on one message, with the numbers behind it.
    """
    def __repr__(self) -> str: ...
    @property
    def dof(self) -> int:
        """
        Rows of the innovation.
        """
    @property
    def log_likelihood(self) -> float:
        """
        log N(r; 0, S).
        """
    @property
    def nis(self) -> float:
        """
        r' S^-1 r; NaN where nothing was compared.
        """
    @property
    def residual(self) -> float:
        """
        First row of the innovation.
        """
    @property
    def verdict(self) -> Verdict: ...

class Gate:
    """
    Chi-square gate: `probability` that a good measurement passes, 1 for no gate.
    """
    def __init__(self, probability: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    def limit(self, dof: typing.SupportsInt | typing.SupportsIndex) -> float:
        """
        Largest NIS that passes.
        """
    @property
    def probability(self) -> float: ...

class SlotKind(enum.Enum):
    """
    What a slot of a belief holds.
    """

    POINT2 = ...
    POSE2 = ...

class Slot:
    """
    Handle of a variable in a belief.
    """
    @property
    def id(self) -> int: ...

class GaussianBelief:
    """
    Gaussian over named slots at one stamp.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import GaussianBelief, SlotKind
    >>> belief = GaussianBelief()
    >>> body = belief.add("body", SlotKind.POSE2, [0, 0, 0], np.eye(3))
    >>> lamp = belief.add("lamp", SlotKind.POINT2, [4, 3], np.eye(2))
    >>> belief.dimension
    5
    """
    def __init__(self) -> None: ...
    def __repr__(self) -> str: ...
    def add(
        self,
        name: str,
        kind: SlotKind,
        mean: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"],
        covariance: typing.Annotated[
            numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.f_contiguous"
        ],
    ) -> Slot: ...
    def marginal(
        self, slots: collections.abc.Sequence[Slot]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    def mean(
        self, slots: collections.abc.Sequence[Slot]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
    def pose(self, slot: Slot) -> Pose2: ...
    def remove(self, slot: Slot) -> None: ...
    def slot(self, name: str) -> Slot: ...
    @property
    def P(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Covariance, (n, n).
        """
    @property
    def dimension(self) -> int: ...
    @property
    def stamp(self) -> int:
        """
        Nanoseconds.
        """
    @stamp.setter
    def stamp(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def x(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Mean, (n,).
        """

class PoseEstimate:
    """
    A pose at one instant [ns], with the covariance of (x, y, heading).
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        pose: Pose2,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"],
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Shape (3, 3).
        """
    @property
    def pose(self) -> Pose2: ...
    @property
    def stamp(self) -> int: ...

class PoseEkfConfig:
    """
    Noise, gates and behaviour of a PoseEkf.
    """

    odometry: OdometryConfig
    position: PositionConfig
    range: RangeConfig
    def __init__(self) -> None: ...
    @property
    def gate_pose(self) -> float: ...
    @gate_pose.setter
    def gate_pose(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_position(self) -> float: ...
    @gate_position.setter
    def gate_position(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_range(self) -> float:
        """
        Probability that a good range passes.
        """
    @gate_range.setter
    def gate_range(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        How long the last motion is believed without new odometry.
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_lost_heading_per_sqrt_s(self) -> float: ...
    @sigma_lost_heading_per_sqrt_s.setter
    def sigma_lost_heading_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_lost_xy_per_sqrt_s(self) -> float: ...
    @sigma_lost_xy_per_sqrt_s.setter
    def sigma_lost_xy_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class PoseEkf:
    """
    Extended Kalman filter over (x, y, heading) in world.

    Odometry predicts; ranges, positions and poses correct (ekim2020, section 2.1).

    Parameters
    ----------
    config : PoseEkfConfig
    anchors : AnchorMap
    tags : list of Tag
    start : PoseEstimate

    Raises
    ------
    ValueError
        If the config is out of range or the start not finite and positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 2]), Anchor(2, [8, 0, 2]), Anchor(3, [4, 6, 2])])
    >>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.5, 0.5, 0.1]) ** 2)
    >>> ekf = PoseEkf(PoseEkfConfig(), anchors, [Tag(0, [0, 0, 1.1])], start)
    >>> ekf.on(Increment(0, 100_000_000, Pose2(0.05, 0, 0))).verdict.name
    'FUSED'
    >>> ekf.on(Range(100_000_000, tag=0, anchor=2, range=5.4)).verdict.name
    'FUSED'
    """
    def __copy__(self) -> PoseEkf:
        """
        A snapshot.
        """
    def __deepcopy__(self, memo: typing.Any) -> PoseEkf:
        """
        A snapshot.
        """
    def __init__(
        self,
        config: PoseEkfConfig,
        anchors: AnchorMap,
        tags: collections.abc.Sequence[Tag],
        start: PoseEstimate,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @typing.overload
    def estimate(self) -> PoseEstimate:
        """
        The pose now: the belief carried to the end of what odometry has told.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> PoseEstimate:
        """
        The belief carried to `stamp` [ns], which must not lie before it.
        """
    def fuse(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        linearization: Linearization,
        gate: Gate,
    ) -> Outcome:
        """
        Fuses what a model of your own says of the pose at `stamp` [ns]: a Jacobian of m x 3. Linearize at `estimate(stamp).pose`.
        """
    @typing.overload
    def on(self, message: Velocity) -> Outcome: ...
    @typing.overload
    def on(self, message: Increment) -> Outcome: ...
    @typing.overload
    def on(self, message: Range) -> Outcome: ...
    @typing.overload
    def on(self, message: PositionFix) -> Outcome: ...
    @typing.overload
    def on(self, message: PoseObservation) -> Outcome:
        """
        Fuses one message. One that is not fused changes no bit of the estimator.
        """
    def on_epoch(
        self,
        begin: typing.SupportsInt | typing.SupportsIndex,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        motion: Pose2,
        anchors: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        ranges: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        tag: typing.SupportsInt | typing.SupportsIndex = 0,
    ) -> list[Outcome]:
        """
        The motion from `begin` to `stamp` [ns], then the ranges (n,) [m] to the anchors (n,) at `stamp`, in one call. Returns n + 1 outcomes.
        """
    def on_joint(self, epoch: collections.abc.Sequence[Range]) -> Outcome:
        """
        Fuses ranges of one stamp as one measurement: one linearization, one gate.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def motion_model(self) -> OdometryMotion: ...
    @property
    def range_model(self) -> RangeModel: ...

class MessageLog:
    """
    Recorded messages, added as columns.

    Every `add_...` takes arrays of equal length; `arrival_ns`, where given, is when each message
    reaches the estimator, otherwise it arrives when it takes effect. A row that is not valid raises
    ValueError, names the row, and nothing is added. A log that another thread adds to, sorts or
    replays raises RuntimeError; several threads may replay it at once.
    """
    def __init__(self) -> None: ...
    def __len__(self) -> int: ...
    def add_increments(
        self,
        begin_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        motion: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Motions (n, 3): dx, dy [m], dheading [rad] from begin_ns to stamp_ns.
        """
    def add_poses(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        pose: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma_xy: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma_heading: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Poses (n, 3): x, y [m], heading [rad], with their sigmas.
        """
    def add_positions(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Positions (n, 2) [m] with one sigma [m] each.
        """
    def add_ranges(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        tag: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        anchor: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        range: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None: ...
    def add_velocities(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        forward: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        turn_rate: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None: ...
    def sort(self) -> None:
        """
        Sorts by arrival; messages of one instant stay in the order they were added in.
        """

class RunLog:
    """
    What a replay leaves behind, as columns.
    """
    def __repr__(self) -> str: ...
    @property
    def covariances(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n, 3, 3).
        """
    @property
    def dof(self) -> numpy.typing.NDArray[numpy.int64]: ...
    @property
    def last(self) -> PoseEstimate:
        """
        The estimate at the end of the log.
        """
    @property
    def log_likelihood(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def nis(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def poses(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        x, y, heading, (n, 3).
        """
    @property
    def residual(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of the estimates, (n,).
        """
    @property
    def verdict(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Verdict, one per message in order of arrival.
        """

def arc(
    forward: typing.SupportsFloat | typing.SupportsIndex,
    left: typing.SupportsFloat | typing.SupportsIndex,
    turn: typing.SupportsFloat | typing.SupportsIndex,
) -> Pose2:
    """
    Motion along the arc of a constant body twist (metres, metres, radians): SE(2) exponential.
    """

def chi_squared_quantile(
    dof: typing.SupportsInt | typing.SupportsIndex,
    probability: typing.SupportsFloat | typing.SupportsIndex,
) -> float:
    """
    Value that a chi-squared variable with `dof` degrees of freedom stays below with `probability`.

    Raises
    ------
    ValueError
        Unless dof >= 1 and 0 <= probability <= 1.
    """

def local(
    to: Pose2, origin: Pose2
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
    """
    Error state (3,) that leads from `origin` to `to`, heading wrapped.
    """

def parse_table(
    text: bytes,
    kinds: str,
    delimiter: str,
    first_line: typing.SupportsInt | typing.SupportsIndex,
    name: str,
) -> list[numpy.ndarray[typing.Any, numpy.dtype[typing.Any]]]:
    """
    Parse delimited decimal text, column by column.

    Blank lines and lines that start with ``#`` are skipped. Spaces and tabs around a field do not
    count. Nothing is quoted.

    Parameters
    ----------
    text : bytes
        UTF-8; lines end in ``\\n`` or ``\\r\\n``.
    kinds : str
        One letter per column: ``f`` finite float64; ``g`` the same, where an empty field is NaN;
        ``s`` decimal seconds read exactly as int64 nanoseconds (what is below a nanosecond is rounded
        half away from zero); ``t`` text of at most 255 bytes.
    delimiter : str
        ``,``, ``;``, ``|``, tab, or a space for any run of spaces and tabs.
    first_line : int
        Number of the first line to parse, from 1; those before it (a header) are passed over.
    name : str
        Name of the text in error messages.

    Returns
    -------
    list of array
        One per column, shape (rows,): float64, int64 [ns] or str.

    Raises
    ------
    ValueError
        If a line has too few or too many fields or a field is not of its kind; the text names the
        line and the column, both from 1.

    Examples
    --------
    >>> stamp_ns, name = parse_table(b"stamp_s,tag\\n1.25,left\\n", "st", ",", 2, "example")
    >>> int(stamp_ns[0]), str(name[0])
    (1250000000, 'left')
    """

def predict(belief: GaussianBelief, step: Propagation, slot: Slot) -> None:
    """
    Moves the pose in `slot`: P to F P F' + Q with its cross-covariances.
    """

def replay(
    start: PoseEkf,
    log: MessageLog,
    history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
    record: bool = True,
    progress: collections.abc.Callable[[int], None] | None = None,
) -> RunLog:
    """
    Feeds a sorted log to a copy of an estimator; late messages are fused where they belong.

    Parameters
    ----------
    start : PoseEkf
    log : MessageLog
    history : int
        How late a message may be, nanoseconds; older ones are stale.
    record : bool
        Keep outcomes and estimates, or only the last estimate.
    progress : callable, optional
        Told the number of messages done, now and then.
    """

def update(
    belief: GaussianBelief,
    linearization: Linearization,
    slots: collections.abc.Sequence[Slot],
    gate: Gate,
) -> Outcome:
    """
    Fuses a measurement into the belief, or gates it.

    Parameters
    ----------
    belief : GaussianBelief
        Updated whole or not at all.
    linearization : Linearization
        From a model of the library or made by hand.
    slots : list of Slot
        Variables that the Jacobian's columns stand for, in order.
    gate : Gate

    Raises
    ------
    ValueError
        If the slots do not match the Jacobian.
    NumericalError
        If the innovation covariance is not positive definite or a result not finite.
    """

def wrap_angle(angle: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    The same direction in [-pi, pi) [rad].
    """

__version__: str = "0.1.0"
