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
    "AckermannConfig",
    "AckermannVehicle",
    "AdaptiveNoiseConfig",
    "AirEkf",
    "AirEkfConfig",
    "AirEstimate",
    "AirMotion",
    "Altitude",
    "AltitudeConfig",
    "AltitudeModel",
    "Anchor",
    "AnchorMap",
    "Association",
    "Attitude",
    "BeamLandmark",
    "BeamModelConfig",
    "BodyPropagation",
    "CalibratedError",
    "CalibrationConfig",
    "ClockJump",
    "ConditionedFix",
    "ConstantVelocityConfig",
    "ConstantVelocityMotion",
    "Cylinder",
    "CylinderDetector",
    "CylinderDetectorConfig",
    "CylinderMethod",
    "Dilution",
    "DistanceField",
    "Gate",
    "GaussianBelief",
    "GyroMotion",
    "GyroOdometry",
    "GyroOdometryConfig",
    "GyroTurn",
    "GyroVerdict",
    "Heading",
    "HeadingConfig",
    "HeadingModel",
    "HeadingSearch",
    "HeadingSearchReason",
    "Health",
    "HealthConfig",
    "HealthReason",
    "HealthReport",
    "HealthState",
    "Imu",
    "Increment",
    "InertialConfig",
    "Initializer",
    "InitializerConfig",
    "Injection",
    "InjectionReason",
    "KnownHeight",
    "KnownLandmark",
    "Landmark",
    "LandmarkEkf",
    "LandmarkEkfConfig",
    "LandmarkEstimate",
    "LandmarkMap",
    "LandmarkSensor",
    "LaserGeometry",
    "LaserScan",
    "LikelihoodFieldConfig",
    "Limits",
    "Linearization",
    "Live",
    "LiveMcl",
    "LocalMap",
    "LocalMapConfig",
    "LocalizeReport",
    "LocalizeRun",
    "MadeMotion",
    "MadeOdometry",
    "Mcl",
    "MclConfig",
    "MessageLog",
    "MlComparison",
    "Multilateration",
    "NamedSource",
    "NoiseKind",
    "NoiseShape",
    "NumericalError",
    "OccupancyGrid",
    "OdometryConfig",
    "OdometryMotion",
    "OdometryTimeline",
    "Outcome",
    "PointDistanceConfig",
    "PointDistanceModel",
    "PointMotionConfig",
    "Pose2",
    "PoseConfig",
    "PoseEkf",
    "PoseEkfConfig",
    "PoseEstimate",
    "PoseHypothesis",
    "PoseModel",
    "PoseObservation",
    "PoseRelation",
    "PoseWatch",
    "PoseWatchConfig",
    "PositionBatch",
    "PositionConfig",
    "PositionFix",
    "PositionHypothesis",
    "PositionModel",
    "PositionSolution",
    "PositionStatus",
    "Propagation",
    "Range",
    "RangeBearing",
    "RangeBearingConfig",
    "RangeBearingInSpace",
    "RangeBearingModel",
    "RangeConfig",
    "RangeCulprit",
    "RangeModel",
    "RangePosition2",
    "RangePosition3",
    "RayCaster",
    "Reason",
    "RecoveringEkf",
    "RecoveringEkfConfig",
    "RigidFit",
    "RigidFitStatus",
    "RunLog",
    "ScanDrive",
    "ScanHypothesis",
    "ScanLikelihood",
    "ScanLoop",
    "ScanMapping",
    "ScanMatch",
    "ScanMatchReason",
    "ScanMatcher",
    "ScanMatcherConfig",
    "ScanMotion",
    "ScanOdometry",
    "ScanOdometryConfig",
    "ScanProposal",
    "ScanSearch",
    "ScanSearchReason",
    "ScanSearchStatus",
    "Slot",
    "SlotKind",
    "Smoothed",
    "SolvedPoseGraph",
    "SolverComparison",
    "Source",
    "SourceStatus",
    "StartMethod",
    "StartRun",
    "StartState",
    "StartStatus",
    "StartStep",
    "Survey",
    "SurveyStatus",
    "SurveyedAnchor",
    "SwitchingMcl",
    "SwitchingMclConfig",
    "Tag",
    "TagConditioner",
    "TagConditionerConfig",
    "TagOrder",
    "TagOrderVerdict",
    "TagTriangleEkf",
    "TagTriangleEkfConfig",
    "TagVerdict",
    "UncertainPlace",
    "Velocity",
    "VelocityConfig",
    "VelocityModel",
    "Verdict",
    "WatchReason",
    "WatchReport",
    "World",
    "arc",
    "chi_squared_quantile",
    "closest_beam",
    "compiler",
    "cramer_rao",
    "draw_grid",
    "find_start",
    "kernels",
    "local",
    "localize",
    "locate",
    "locate_batch",
    "map_scans",
    "parse_table",
    "predict",
    "recognize_landmarks",
    "replay",
    "rigid_fit",
    "smooth",
    "solve_pose_graph",
    "survey",
    "tag_order",
    "update",
    "wrap_angle",
]

class NumericalError(ArithmeticError):
    """
    Numerical failure: an innovation covariance that is not positive definite, a result that is not finite. The belief is unchanged where it is raised.
    """

class NoiseKind(enum.Enum):
    """
    Shape of the measurement noise.
    """

    CAUCHY = ...
    GAUSSIAN = ...
    ONE_SIDED = ...
    STUDENT_T = ...

class Linearization:
    """
    Linearized measurement: residual, Jacobian and noise.

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

class Source(enum.Enum):
    """
    Kind of sensor that a message comes from.
    """

    ALTITUDES = ...
    HEADINGS = ...
    IMU = ...
    LANDMARK_SIGHTINGS = ...
    ODOMETRY = ...
    POSES = ...
    POSITIONS = ...
    RANGES = ...
    SCANS = ...

class Velocity:
    """
    Wheel odometry as body velocities, constant from `stamp` [ns] until the next message: `forward` [m/s], `turn_rate` [rad/s], and `left` [m/s] of wheels that roll sideways, too.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        forward: typing.SupportsFloat | typing.SupportsIndex,
        turn_rate: typing.SupportsFloat | typing.SupportsIndex,
        left: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def forward(self) -> float: ...
    @property
    def left(self) -> float: ...
    @property
    def stamp(self) -> int: ...
    @property
    def turn_rate(self) -> float: ...

class Increment:
    """
    Wheel odometry as the motion from `begin` to `stamp` [ns]: a Pose2 in the body frame at `begin`. `variance` of its dx, dy [m^2] and dheading [rad^2] defaults to that of the model.
    """
    @staticmethod
    def from_drive_then_turn(
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
        variance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def begin(self) -> int: ...
    @property
    def motion(self) -> Pose2: ...
    @property
    def stamp(self) -> int: ...
    @property
    def variance(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None: ...

class Imu:
    """
    Angular rate [rad/s] and specific force [m/s^2] (at rest 9.81 upwards; None without an accelerometer) in the axes of the sensor, (3,) each.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        angular_rate: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        specific_force: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]
        | None = None,
    ) -> None: ...
    @property
    def angular_rate(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]: ...
    @property
    def specific_force(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None: ...
    @property
    def stamp(self) -> int: ...

class Range:
    """
    Distance [m] between a tag on the body and an anchor in the world. `sigma` [m] defaults to that of the model.
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
    Position (2,) [m] in world with its covariance (2, 2) [m^2], of `tag` or, without one, of the antenna.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 2]"],
        tag: typing.SupportsInt | typing.SupportsIndex | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]: ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]: ...
    @property
    def stamp(self) -> int: ...
    @property
    def tag(self) -> int | None: ...

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

class Altitude:
    """
    Height [m] of an altimeter above z = 0 of the world. With a PositionFix of the same stamp it forms a 3D fix. `sigma` [m] defaults to that of the model.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        height: typing.SupportsFloat | typing.SupportsIndex,
        sigma: typing.SupportsFloat | typing.SupportsIndex | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def height(self) -> float: ...
    @property
    def sigma(self) -> float | None: ...
    @property
    def stamp(self) -> int: ...

class Heading:
    """
    Heading [rad] of the body in world, counter-clockwise from x: of a magnetometer, the orientation of an inertial unit or two antennas. With `is_course` the direction in which the antenna of GPS travels. `sigma` [rad] defaults to that of the model.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        heading: typing.SupportsFloat | typing.SupportsIndex,
        sigma: typing.SupportsFloat | typing.SupportsIndex | None = None,
        is_course: bool = False,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def heading(self) -> float: ...
    @property
    def is_course(self) -> bool: ...
    @property
    def sigma(self) -> float | None: ...
    @property
    def stamp(self) -> int: ...

class RangeBearing:
    """
    Landmark observation from a sensor on the body: `range` [m] to its centre, `bearing` [rad] counter-clockwise from the sensor's x axis, or one of the two. Without `landmark` it is associated; `covariance` (2, 2) of (range, bearing) defaults to that of the model. Only an AirEkf uses `elevation` [rad], positive upwards, of the line of sight along which the range is measured.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        landmark: typing.SupportsInt | typing.SupportsIndex | None = None,
        range: typing.SupportsFloat | typing.SupportsIndex | None = None,
        bearing: typing.SupportsFloat | typing.SupportsIndex | None = None,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 2]"] | None = None,
        elevation: typing.SupportsFloat | typing.SupportsIndex | None = None,
        sigma_elevation: typing.SupportsFloat | typing.SupportsIndex | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def bearing(self) -> float | None: ...
    @property
    def covariance(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"] | None: ...
    @property
    def elevation(self) -> float | None: ...
    @property
    def landmark(self) -> int | None: ...
    @property
    def range(self) -> float | None: ...
    @property
    def sigma_elevation(self) -> float | None: ...
    @property
    def stamp(self) -> int: ...

class LaserGeometry:
    """
    Mounting and beams of a 2D laser: beam i points at angle_min + i * angle_increment [rad] from the laser's x axis, `time_increment` [s] after the one before; `pose_in_body` is T_body_laser; ranges [m].
    """
    def __init__(
        self,
        pose_in_body: Pose2,
        angle_min: typing.SupportsFloat | typing.SupportsIndex,
        angle_increment: typing.SupportsFloat | typing.SupportsIndex,
        range_min: typing.SupportsFloat | typing.SupportsIndex,
        range_max: typing.SupportsFloat | typing.SupportsIndex,
        time_increment: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None: ...
    @property
    def angle_increment(self) -> float: ...
    @property
    def angle_min(self) -> float: ...
    @property
    def pose_in_body(self) -> Pose2: ...
    @property
    def range_max(self) -> float: ...
    @property
    def range_min(self) -> float: ...
    @property
    def time_increment(self) -> float: ...

class LaserScan:
    """
    One scan of a 2D laser, `stamp` [ns] that of its middle beam: `ranges` (beams,) [m], NaN without return. Ranges outside (range_min, range_max) do not count as returns: many lasers report range_max if there is none. `intensities` (beams,) in the unit of the laser; empty if not reported.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        geometry: LaserGeometry,
        ranges: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        intensities: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def geometry(self) -> LaserGeometry: ...
    @property
    def intensities(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        In the unit of the laser, (beams,) or (0,), a read-only view.
        """
    @property
    def ranges(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Metres (beams,), a read-only view.
        """
    @property
    def stamp(self) -> int: ...

class Limits:
    """
    Physical limits of robot and sensors; a message beyond them is IMPLAUSIBLE.
    """
    def __init__(self) -> None: ...
    @property
    def distance_m(self) -> float:
        """
        Maximum distance of positions from the world origin [m].
        """
    @distance_m.setter
    def distance_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def range_m(self) -> float: ...
    @range_m.setter
    def range_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def speed_mps(self) -> float: ...
    @speed_mps.setter
    def speed_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def turn_rate_radps(self) -> float: ...
    @turn_rate_radps.setter
    def turn_rate_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Anchor:
    """
    Fixed radio at `position` (3,) [m] in world; a range to it reads scale * distance + offset [m].
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
    Immutable map of anchors by id.

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

class Landmark:
    """
    Landmark with its centre at `position` (2,) in world, its `radius` and, for an AirEkf, its `height` [m].
    """
    def __init__(
        self,
        id: typing.SupportsInt | typing.SupportsIndex,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        radius: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        height: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def height(self) -> float: ...
    @property
    def id(self) -> int: ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]: ...
    @property
    def radius(self) -> float: ...

class LandmarkMap:
    """
    Immutable map of landmarks by id.

    Raises
    ------
    ValueError
        On a duplicate id, a number that is not finite or a negative radius.
    """
    def __contains__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> bool: ...
    def __init__(self, landmarks: collections.abc.Sequence[Landmark]) -> None: ...
    def __len__(self) -> int: ...
    def __repr__(self) -> str: ...
    @property
    def landmarks(self) -> list[Landmark]:
        """
        All landmarks in order of id.
        """

class OccupancyGrid:
    """
    Immutable occupancy grid of square cells: free, occupied or unknown.

    Parameters
    ----------
    cells : integer array, shape (height, width)
        0 free, 100 occupied, -1 unknown; row 0 has the lowest y.
    resolution : float
        Metres per cell.
    origin : Pose2
        T_world_grid: lower left corner of the grid.

    Raises
    ------
    ValueError
        On other cell values, an empty grid, or numbers that are not finite.
    TypeError
        On cells that are not integers.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import OccupancyGrid, Pose2
    >>> OccupancyGrid(np.zeros((3, 4), dtype=np.int8), 0.05, Pose2(-1, -1, 0))
    OccupancyGrid(4 x 3 cells of 0.05 m)
    """
    def __init__(
        self,
        cells: typing.Annotated[numpy.typing.ArrayLike, numpy.int8],
        resolution: typing.SupportsFloat | typing.SupportsIndex,
        origin: Pose2 = ...,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def center(
        self,
        column: typing.SupportsInt | typing.SupportsIndex,
        row: typing.SupportsInt | typing.SupportsIndex,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Centre (2,) of a cell in world [m].
        """
    def contains(
        self, point: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"]
    ) -> bool:
        """
        Whether a point (2,) in world lies on the grid.
        """
    @property
    def cells(self) -> numpy.typing.NDArray[numpy.int8]:
        """
        int8 (height, width), a read-only view.
        """
    @property
    def height(self) -> int: ...
    @property
    def origin(self) -> Pose2:
        """
        T_world_grid.
        """
    @property
    def resolution(self) -> float:
        """
        Metres per cell.
        """
    @property
    def width(self) -> int: ...

class DistanceField:
    """
    Distances to the nearest occupied cell, precomputed for a map and a margin.

    Parameters
    ----------
    grid : OccupancyGrid
    margin : float
        How far the field reaches beyond the map [m].

    Raises
    ------
    ValueError
        If there is no map, or no cell of it is occupied.
    """
    def __init__(
        self, grid: OccupancyGrid, margin: typing.SupportsFloat | typing.SupportsIndex = 1.0
    ) -> None: ...
    def distance(
        self, points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Distances (n,) [m] for points (n, 2) in world by table lookup: from the centre of the cell of the point to the centre of the nearest occupied cell.
        """
    def nearest_distance(
        self, points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Exact distances (n,) [m] from points (n, 2) in world to the centre of the nearest occupied cell.
        """

class RayCaster:
    """
    Exact ranges of beams on a map to the first occupied cell.

    The range from an occupied cell is 0. Beams pass through free cells and outside the map, so they may
    start outside.

    Parameters
    ----------
    grid : OccupancyGrid
    unknown_stops : bool
        Whether unknown cells stop beams like occupied ones.

    Raises
    ------
    ValueError
        If there is no map.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import OccupancyGrid, Pose2, RayCaster
    >>> cells = np.zeros((20, 40), dtype=np.int8)
    >>> cells[:, 30] = 100
    >>> caster = RayCaster(OccupancyGrid(cells, 0.1))
    >>> caster.scan(Pose2(1, 1, 0), angle_min=0.0, angle_increment=0.1, count=3).round(3).tolist()
    [2.0, 2.01, 2.041]
    """
    def __init__(self, grid: OccupancyGrid, unknown_stops: bool = False) -> None: ...
    def cast(
        self,
        points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        headings: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        max_range: typing.SupportsFloat | typing.SupportsIndex = ...,
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Ranges of single beams.

        Parameters
        ----------
        points : float64 array, shape (n, 2)
            Start points in world [m].
        headings : float64 array, shape (n,)
            Directions in world [rad].
        max_range : float
            Maximum range [m].

        Returns
        -------
        float64 array, shape (n,)
            Metres; infinite where nothing is hit.

        Raises
        ------
        ValueError
            On other shapes, numbers that are not finite, a start 1e9 cells or more from the map, a
            negative `max_range`.
        """
    def scan(
        self,
        pose: Pose2,
        angle_min: typing.SupportsFloat | typing.SupportsIndex,
        angle_increment: typing.SupportsFloat | typing.SupportsIndex,
        count: typing.SupportsInt | typing.SupportsIndex,
        max_range: typing.SupportsFloat | typing.SupportsIndex = ...,
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Ranges of the beams of a laser.

        Parameters
        ----------
        pose : Pose2
            T_world_laser.
        angle_min, angle_increment : float
            Beam i points at angle_min + i * angle_increment in the laser's frame [rad].
        count : int
            Number of beams.
        max_range : float
            Maximum range [m].

        Returns
        -------
        float64 array, shape (count,)
            Metres; infinite where nothing is hit.

        Raises
        ------
        ValueError
            On numbers that are not finite, a start 1e9 cells or more from the map, a negative `count` or
            `max_range`.
        """

class HeadingSearchReason(enum.Enum):
    """
    Result of a heading search.
    """

    FOUND = ...
    NO_RETURNS = ...
    OUTSIDE_MAP = ...

class HeadingSearch:
    """
    Result of the heading search of ekim2020.
    """
    @property
    def heading(self) -> float | None:
        """
        Heading of the body in world [rad], a multiple of ten degrees; None unless found.
        """
    @property
    def reason(self) -> HeadingSearchReason: ...
    @property
    def returns(self) -> int:
        """
        Number of beams that each sum is of.
        """
    @property
    def rms_range(self) -> float:
        """
        RMS of their ranges [m].
        """
    @property
    def sums(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Sums (36,) [m] of nearest distances with the body at 0, 10, ..., 350 degrees.
        """

class ScanMatchReason(enum.Enum):
    """
    How a refinement ended.
    """

    CONVERGED = ...
    NO_CONVERGENCE = ...
    NO_RETURNS = ...
    OUTSIDE_MAP = ...
    TOO_FEW_MATCHES = ...

class ScanMatch:
    """
    Fit of a scan to the map near a guess.
    """
    def __repr__(self) -> str: ...
    @property
    def converged(self) -> bool:
        """
        If False, only `reason` and `iterations` are valid.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"] | None:
        """
        Covariance of (x, y, heading) from scan and prior, shape (3, 3); None if neither determines a direction.
        """
    @property
    def explained(self) -> float:
        """
        Fraction of the returns that end at a wall.
        """
    @property
    def information(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Information matrix of (x, y, heading) from the scan alone, shape (3, 3).
        """
    @property
    def iterations(self) -> int: ...
    @property
    def pose(self) -> Pose2:
        """
        T_world_body; the guess unless `converged`.
        """
    @property
    def reason(self) -> ScanMatchReason: ...
    @property
    def rms(self) -> float:
        """
        RMS distance of those returns to the wall lines [m].
        """
    @property
    def weak_direction(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None:
        """
        Unobservable change (3,) of (x, y, heading), or None.
        """

class ScanHypothesis:
    """
    Pose hypothesis of a scan search.
    """
    @property
    def cost(self) -> float:
        """
        Negative log of likelihood and prior; 0 is a perfect fit.
        """
    @property
    def match(self) -> ScanMatch: ...
    @property
    def probability(self) -> float:
        """
        Probability among the hypotheses found.
        """

class ScanSearchStatus(enum.Enum):
    """
    Result of a scan search.
    """

    AMBIGUOUS = ...
    NONE = ...
    READY = ...

class ScanSearchReason(enum.Enum):
    """
    Reason for a ScanSearchStatus.
    """

    HEADING_UNOBSERVED = ...
    NO_RETURNS = ...
    OUTSIDE_MAP = ...
    POOR_FIT = ...
    SEVERAL_FIT = ...
    UNIQUE = ...

class ScanSearch:
    """
    All poses in a search window at which a scan fits.
    """
    @property
    def hypotheses(self) -> list[ScanHypothesis]:
        """
        Likeliest first.
        """
    @property
    def reason(self) -> ScanSearchReason: ...
    @property
    def status(self) -> ScanSearchStatus: ...

class ScanMatcherConfig:
    """
    Settings of a ScanMatcher.

    Parameters
    ----------
    sigma_range_m : float
        Range noise of one beam.
    outlier_share : float
        Fraction of returns from objects that are not on the map.
    no_return_share : float
        Fraction of beams without a return where one is expected.
    wrong_probability : float
        Maximum total probability of the other hypotheses when a search is READY.
    min_explained : float
        Minimum fraction of the returns that a pose explains.
    max_hypotheses : int
        Maximum number of hypotheses of a search.
    max_iterations : int
        Maximum number of iterations of one refinement.
    exact_neighbours : bool
        Use the nearest cell of each end point instead of that of the cell it lies in.
    """
    def __init__(
        self,
        *,
        sigma_range_m: typing.SupportsFloat | typing.SupportsIndex = 0.01,
        outlier_share: typing.SupportsFloat | typing.SupportsIndex = 0.1,
        no_return_share: typing.SupportsFloat | typing.SupportsIndex = 0.1,
        wrong_probability: typing.SupportsFloat | typing.SupportsIndex = 0.001,
        min_explained: typing.SupportsFloat | typing.SupportsIndex = 0.5,
        max_hypotheses: typing.SupportsInt | typing.SupportsIndex = 8,
        max_iterations: typing.SupportsInt | typing.SupportsIndex = 30,
        exact_neighbours: bool = False,
    ) -> None: ...
    @property
    def exact_neighbours(self) -> bool: ...
    @property
    def max_hypotheses(self) -> int: ...
    @property
    def max_iterations(self) -> int: ...
    @property
    def min_explained(self) -> float: ...
    @property
    def no_return_share(self) -> float: ...
    @property
    def outlier_share(self) -> float: ...
    @property
    def sigma_range_m(self) -> float: ...
    @property
    def wrong_probability(self) -> float: ...

class ScanMatcher:
    """
    Finds the pose of a body on a map from single laser scans.

    Raises
    ------
    ValueError
        If there is no map or it has no occupied cell; from the methods, if a scan or a number is not
        valid.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import LaserGeometry, LaserScan, OccupancyGrid, Pose2, ScanMatcher
    >>> cells = np.full((60, 80), 0, dtype=np.int8)  # a room of 4 x 3 m
    >>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
    >>> matcher = ScanMatcher(OccupancyGrid(cells, resolution=0.05))
    >>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
    >>> scan = LaserScan(0, around, [2.45, 1.45, 1.45, 1.45])  # ahead, left, back, right
    >>> matcher.heading_search(scan, position=[1.5, 1.5]).heading
    0.0
    """
    def __init__(self, grid: OccupancyGrid, config: ScanMatcherConfig = ...) -> None: ...
    def heading_search(
        self,
        scan: LaserScan,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> HeadingSearch:
        """
        Heading search of ekim2020, Table 1, at a position (2,) in world [m]: 36 headings, nearest cells by a kd-tree.
        """
    def heading_search_by_lookup(
        self,
        scan: LaserScan,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> HeadingSearch:
        """
        Heading search with distances from a lookup table, exact within half a cell diagonal.
        """
    def nearest_by_kdtree(
        self, point: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"]
    ) -> float:
        """
        Distance [m] from a point (2,) in world to the nearest occupied cell's centre.
        """
    def refine(
        self,
        scan: LaserScan,
        guess: Pose2,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"] | None = None,
    ) -> ScanMatch:
        """
        Fit the scan to the map near a guess.

        Parameters
        ----------
        scan : LaserScan
        guess : Pose2
            T_world_body, within 20 cm and 5 degrees.
        covariance : array, shape (3, 3), optional
            Covariance of (x, y, heading) [m, rad]; with it the guess is also a prior.

        Returns
        -------
        ScanMatch
        """
    def search(
        self,
        scan: LaserScan,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 2]"],
    ) -> ScanSearch:
        """
        Find every pose near a position at which the scan fits, at any heading.

        Parameters
        ----------
        scan : LaserScan
        position : array, shape (2,)
            Position of the body in world [m].
        covariance : array, shape (2, 2)
            Covariance of the position [m^2]; the search covers three sigma.

        Returns
        -------
        ScanSearch
        """
    @property
    def config(self) -> ScanMatcherConfig: ...

class LocalMapConfig:
    """
    Settings of a LocalMap.

    Parameters
    ----------
    sigma_range_m : float
        Range noise of one beam.
    max_distance_m : float
        Maximum distance between an end point and its match.
    trimmed_share : float
        Fraction of the matches, the worst, that is dropped if beyond three sigma.
    min_explained : float
        Minimum fraction of explained returns; below it the fit is searched again.
    max_iterations : int
        Maximum number of iterations of one fit.
    """
    def __init__(
        self,
        *,
        sigma_range_m: typing.SupportsFloat | typing.SupportsIndex = 0.01,
        max_distance_m: typing.SupportsFloat | typing.SupportsIndex = 1.0,
        trimmed_share: typing.SupportsFloat | typing.SupportsIndex = 0.1,
        min_explained: typing.SupportsFloat | typing.SupportsIndex = 0.5,
        max_iterations: typing.SupportsInt | typing.SupportsIndex = 30,
    ) -> None: ...
    @property
    def max_distance_m(self) -> float: ...
    @property
    def max_iterations(self) -> int: ...
    @property
    def min_explained(self) -> float: ...
    @property
    def sigma_range_m(self) -> float: ...
    @property
    def trimmed_share(self) -> float: ...

class LocalMap:
    """
    Local map of the end points of a few scans, to which another scan is fitted.

    Parameters
    ----------
    scans : list of (LaserScan, Pose2)
        Scans and their poses T_map_body; a single one for scan-to-scan matching.
    config : LocalMapConfig, optional

    Raises
    ------
    ValueError
        If a setting is out of bounds, or a scan, pose or covariance is not valid.

    Examples
    --------
    A room of 8 x 6 m, seen from its middle and from 0.2 m further on:

    >>> import numpy as np
    >>> from locfuse.core import LaserGeometry, LaserScan, LocalMap, Pose2
    >>> angle = np.pi / 180 * (np.arange(360) + 0.5)
    >>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
    >>> def seen_at(x):
    ...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
    ...     return LaserScan(0, around, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))
    >>> match = LocalMap([(seen_at(0.0), Pose2())]).match(seen_at(0.2), guess=Pose2(0.1, 0.05, 0.02))
    >>> match.converged, round(match.pose.x, 3), match.weak_direction is None
    (True, 0.2, True)
    """
    def __init__(
        self, scans: collections.abc.Sequence[tuple[LaserScan, Pose2]], config: LocalMapConfig = ...
    ) -> None: ...
    def match(
        self,
        scan: LaserScan,
        guess: Pose2,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"] | None = None,
    ) -> ScanMatch:
        """
        Fit a scan near a guess.

        Parameters
        ----------
        scan : LaserScan
        guess : Pose2
            T_map_body, within 20 cm and 5 degrees.
        covariance : array, shape (3, 3), optional
            Covariance of (x, y, heading) [m, rad]; with it the guess is also a prior. If it exceeds those
            bounds or the fit explains too little, a search over three sigma of the position and all
            headings gives another start.

        Returns
        -------
        ScanMatch
            TOO_FEW_MATCHES on an empty map.

        Raises
        ------
        ValueError
            If scan, guess or covariance is not valid.
        """
    @property
    def config(self) -> LocalMapConfig: ...

class ScanOdometryConfig:
    """
    Settings of a ScanOdometry.

    Parameters
    ----------
    map : LocalMapConfig
    window_scans : int
        Number of key scans in the local map; 1 is scan-to-scan matching.
    window_m : float
        Maximum distance of key scans from the newest one.
    key_distance_m, key_turn_rad : float
        Motion since the newest key scan after which a scan becomes a key scan; 0: every scan.
    least_sigma_m, least_sigma_rad : float
        Minimum sigmas of odometry, whatever its covariance: it is not sampled at the instant of the
        scan, and a robot that seems to stand may be moving.
    """
    def __init__(
        self,
        *,
        map: LocalMapConfig = ...,
        window_scans: typing.SupportsInt | typing.SupportsIndex = 10,
        window_m: typing.SupportsFloat | typing.SupportsIndex = 5.0,
        key_distance_m: typing.SupportsFloat | typing.SupportsIndex = 0.3,
        key_turn_rad: typing.SupportsFloat | typing.SupportsIndex = 0.3,
        least_sigma_m: typing.SupportsFloat | typing.SupportsIndex = 0.01,
        least_sigma_rad: typing.SupportsFloat | typing.SupportsIndex = 0.01,
    ) -> None: ...
    @property
    def key_distance_m(self) -> float: ...
    @property
    def key_turn_rad(self) -> float: ...
    @property
    def least_sigma_m(self) -> float: ...
    @property
    def least_sigma_rad(self) -> float: ...
    @property
    def map(self) -> LocalMapConfig: ...
    @property
    def window_m(self) -> float: ...
    @property
    def window_scans(self) -> int: ...

class ScanMotion:
    """
    Motion estimated from a scan.
    """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Covariance of T_key_body, (x, y, heading) [m, rad], shape (3, 3); that of odometry if there is no match.
        """
    @property
    def increment(self) -> Increment:
        """
        Motion since the previous scan as a message for a PoseEkf; zero duration for the first scan.
        """
    @property
    def key(self) -> int:
        """
        Stamp of that key scan [ns].
        """
    @property
    def match(self) -> ScanMatch:
        """
        Match against the local map in the body frame of the newest key scan (T_key_body).
        """
    @property
    def pose(self) -> Pose2:
        """
        T_start_body, accumulated since the first scan.
        """

class ScanOdometry:
    """
    Laser odometry without a map.

    Each scan is fitted to the latest key scans, starting from wheel odometry.

    Raises
    ------
    ValueError
        If a setting is out of bounds.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import LaserGeometry, LaserScan, Pose2, ScanOdometry
    >>> angle = np.pi / 180 * (np.arange(360) + 0.5)
    >>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
    >>> odometry = ScanOdometry()
    >>> for k, x in enumerate([0.0, 0.1, 0.2]):  # in a room of 8 x 6 m; wheels report 12 cm each time
    ...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
    ...     scan = LaserScan(k * 10**9, around, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))
    ...     result = odometry.on(scan, Pose2(0.12, 0.0, 0.0), np.diag([0.03, 0.01, 0.02]) ** 2)
    >>> round(result.pose.x, 2)
    0.2
    """
    def __init__(self, config: ScanOdometryConfig = ...) -> None: ...
    def on(
        self,
        scan: LaserScan,
        motion: Pose2,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"],
    ) -> ScanMotion:
        """
        Process the next scan.

        Parameters
        ----------
        scan : LaserScan
        motion : Pose2
            Motion since the previous scan from odometry; ignored for the first scan.
        covariance : array, shape (3, 3)
            Covariance of that motion: (x, y, heading) in the body frame of its start [m, rad].

        Returns
        -------
        ScanMotion
            The motion is that of odometry if the scan does not fit.

        Raises
        ------
        ValueError
            If scan, motion or covariance is not valid or the stamp is not later than the previous one; the
            state is then unchanged.
        """
    @property
    def config(self) -> ScanOdometryConfig: ...

class CylinderMethod(enum.IntEnum):
    """
    How a CylinderDetector finds cylinders and their centres.
    """

    ARCS = ...
    CLOSEST_BEAM = ...
    CONE = ...

class CylinderDetectorConfig:
    """
    Settings of a CylinderDetector.

    Parameters
    ----------
    method : CylinderMethod
        How cylinders are found and their centres computed.
    sigma_range_m, sigma_bearing_rad : float
        Noise of the length and of the direction (beam width, quantization) of one beam.
    radius_m : float
        Radius of all cylinders; 0: estimated for each.
    radius_min_m, radius_max_m : float
        Bounds of an estimated radius.
    least_beams : int
        Minimum number of beams on a cylinder.
    jump_gaps : float
        A depth step between two beams is an edge if it exceeds six sigma plus this multiple of the gap
        between beams.
    misfit_probability : float
        Probability that the arc of a cylinder passes the chi-square gate.
    least_evidence : float
        Minimum chi-square difference to a straight wall. An object too small to decide is a cylinder
        if it is isolated and as wide as `radius_m`, or for 0 any width within bounds.
    least_corner_evidence : float
        Minimum chi-square difference to a right-angled corner. Thin cylinders resemble corners of
        equally small boxes; -20 accepts all of them where there are no boxes.
    leg_radius_m, leg_distance_m : float
        A cylinder up to this radius and this close to anything as thin is a leg; 0: no people.
    least_intensity : float
        Minimum intensity of at least one beam; 0: any.
    """
    def __init__(
        self,
        *,
        method: CylinderMethod = ...,
        sigma_range_m: typing.SupportsFloat | typing.SupportsIndex = 0.01,
        sigma_bearing_rad: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        radius_m: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        radius_min_m: typing.SupportsFloat | typing.SupportsIndex = 0.03,
        radius_max_m: typing.SupportsFloat | typing.SupportsIndex = 1.5,
        least_beams: typing.SupportsInt | typing.SupportsIndex = 7,
        jump_gaps: typing.SupportsFloat | typing.SupportsIndex = 6.0,
        misfit_probability: typing.SupportsFloat | typing.SupportsIndex = 0.99999,
        least_evidence: typing.SupportsFloat | typing.SupportsIndex = 25.0,
        least_corner_evidence: typing.SupportsFloat | typing.SupportsIndex = 4.0,
        leg_radius_m: typing.SupportsFloat | typing.SupportsIndex = 0.12,
        leg_distance_m: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        least_intensity: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None: ...
    @property
    def jump_gaps(self) -> float: ...
    @property
    def least_beams(self) -> int: ...
    @property
    def least_corner_evidence(self) -> float: ...
    @property
    def least_evidence(self) -> float: ...
    @property
    def least_intensity(self) -> float: ...
    @property
    def leg_distance_m(self) -> float: ...
    @property
    def leg_radius_m(self) -> float: ...
    @property
    def method(self) -> CylinderMethod: ...
    @property
    def misfit_probability(self) -> float: ...
    @property
    def radius_m(self) -> float: ...
    @property
    def radius_max_m(self) -> float: ...
    @property
    def radius_min_m(self) -> float: ...
    @property
    def sigma_bearing_rad(self) -> float: ...
    @property
    def sigma_range_m(self) -> float: ...

class Cylinder:
    """
    Upright cylinder in the scan plane.
    """
    def __repr__(self) -> str: ...
    @property
    def beams(self) -> int:
        """
        Number of beams in the fit.
        """
    @property
    def bearing(self) -> float:
        """
        Bearing of the centre in the laser frame [rad].
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Covariance of (range, bearing, radius) [m, rad, m], shape (3, 3); row and column of a fixed radius are zero. Mean squared error of a single beam's.
        """
    @property
    def first(self) -> int:
        """
        First beam of the arc by bearing; larger than `last` across the end of the scan.
        """
    @property
    def last(self) -> int:
        """
        Last beam of the arc by bearing.
        """
    @property
    def misfit(self) -> float:
        """
        Chi-square per degree of freedom.
        """
    @property
    def radius(self) -> float:
        """
        Metres.
        """
    @property
    def range(self) -> float:
        """
        Range of the centre from the laser [m].
        """

class CylinderDetector:
    """
    Detects cylinders in single scans.

    Raises
    ------
    ValueError
        If a setting is out of bounds.

    Examples
    --------
    A single cylinder of radius 0.5 m, 2 m ahead:

    >>> import numpy as np
    >>> from locfuse import CylinderDetector, LaserGeometry, LaserScan, Pose2
    >>> angle = np.pi / 180 * (np.arange(360) - 180)
    >>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
    >>> with np.errstate(invalid="ignore"):
    ...     ranges = 2 * np.cos(angle) - np.sqrt(0.5**2 - (2 * np.sin(angle)) ** 2)
    >>> seen = LaserScan(0, around, np.where(np.cos(angle) > 0, ranges, np.nan))
    >>> [found] = CylinderDetector().detect(seen)
    >>> round(found.range, 3), round(abs(found.bearing), 3), round(found.radius, 3), found.beams
    (2.0, 0.0, 0.5, 29)
    """
    def __init__(self, config: CylinderDetectorConfig = ...) -> None: ...
    def detect(self, scan: LaserScan) -> list[Cylinder]:
        """
        Detect the cylinders of a scan.

        Parameters
        ----------
        scan : LaserScan

        Returns
        -------
        list of Cylinder
            In order of `first`.

        Raises
        ------
        ValueError
            If the scan is not valid, or lacks the intensities that `least_intensity` requires.
        """
    @property
    def config(self) -> CylinderDetectorConfig: ...

class BeamLandmark:
    """
    Beam that represents a landmark: `beam`, `range` [m], `bearing` in the laser frame [rad]; -1, -1 and 0 if there is none.
    """
    @property
    def beam(self) -> int: ...
    @property
    def bearing(self) -> float: ...
    @property
    def range(self) -> float: ...

class AckermannConfig:
    """
    Geometry and noise of a vehicle with steered front wheels.

    Parameters
    ----------
    wheel_base_m : float
        Distance from the rear to the front axle.
    encoder_left_m : float
        Lateral offset of the rear wheel with the encoder from the middle of the axle, positive to the
        left.
    sigma_speed_mps, sigma_steering_rad : float
        Noise of that wheel's speed and of the steering angle.
    """
    def __init__(
        self,
        *,
        wheel_base_m: typing.SupportsFloat | typing.SupportsIndex,
        encoder_left_m: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        sigma_speed_mps: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        sigma_steering_rad: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None: ...
    @property
    def encoder_left_m(self) -> float: ...
    @property
    def sigma_speed_mps(self) -> float: ...
    @property
    def sigma_steering_rad(self) -> float: ...
    @property
    def wheel_base_m(self) -> float: ...

class AckermannVehicle:
    """
    Body velocity of an Ackermann vehicle from wheel speed and steering angle.

    The body origin is the middle of the rear axle; docs/models/motion.md. The steering angle [rad]
    is that of a virtual wheel in the middle of the front axle, positive to the left; the wheel speed
    [m/s] is negative backwards. Every method raises ValueError for a value that is not finite and where
    the speed is not observable: steering angles of 90 degrees and more, or a turning centre that does
    not lie beyond the wheel.

    Raises
    ------
    ValueError
        If the wheel base is not positive, a sigma is negative, or a value is not finite.

    Examples
    --------
    >>> import math
    >>> from locfuse.core import AckermannConfig, AckermannVehicle
    >>> vehicle = AckermannVehicle(AckermannConfig(wheel_base_m=2.0, encoder_left_m=1.0))
    >>> u = vehicle.velocity(0, wheel_speed=1.5, steering=math.atan(0.5))
    >>> round(u.forward, 9), round(u.turn_rate, 9)
    (2.0, 0.5)
    """
    def __init__(self, config: AckermannConfig) -> None: ...
    def covariance(
        self,
        wheel_speed: typing.SupportsFloat | typing.SupportsIndex,
        steering: typing.SupportsFloat | typing.SupportsIndex,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]:
        """
        Covariance of (forward, turn rate) from the sigmas, shape (2, 2).
        """
    def jacobian(
        self,
        wheel_speed: typing.SupportsFloat | typing.SupportsIndex,
        steering: typing.SupportsFloat | typing.SupportsIndex,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]:
        """
        Jacobian of (forward, turn rate) with respect to (wheel speed, steering), shape (2, 2).
        """
    def velocities(
        self,
        wheel_speed: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        steering: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Forward speed [m/s] and turn rate [rad/s], shape (n, 2), of readings of shape (n,).
        """
    def velocity(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        wheel_speed: typing.SupportsFloat | typing.SupportsIndex,
        steering: typing.SupportsFloat | typing.SupportsIndex,
    ) -> Velocity:
        """
        A Velocity at `stamp` [ns].
        """
    @property
    def config(self) -> AckermannConfig: ...

class Tag:
    """
    Radio on the robot at `position` (3,) in the body frame: forward, left, up [m].
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
    One prediction step of a pose by a motion model.
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

class BodyPropagation:
    """
    One prediction step of several variables by a motion model.

    Parameters
    ----------
    moved : float64 array, shape (n,)
        f(x) of the predicted variables.
    jacobian : float64 array, shape (n, m)
        d f / d(all m variables that f depends on), the predicted ones first.
    noise : float64 array, shape (n, n)
        Q of this step, symmetric positive semidefinite.

    Raises
    ------
    ValueError
        If the shapes do not fit, a number is not finite or the noise not symmetric positive
        semidefinite.

    Examples
    --------
    >>> import numpy as np
    >>> import locfuse.core as lf
    >>> belief = lf.GaussianBelief()
    >>> rate = belief.add("rate", lf.SlotKind.SCALAR, [1.0], [[0.04]])
    >>> lf.predict(belief, lf.BodyPropagation([0.5], [[0.5]], [[0.03]]), [rate])
    >>> belief.x.tolist(), belief.P.round(9).tolist()
    ([0.5], [[0.04]])
    """
    def __init__(
        self,
        moved: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        jacobian: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        noise: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None: ...
    @property
    def jacobian(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        F, shape (n, m).
        """
    @property
    def moved(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        f(x), shape (n,).
        """
    @property
    def noise(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Q of this step, shape (n, n).
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
    def sigma_longitudinal_per_sqrt_s(self) -> float:
        """
        m / sqrt(s)
        """
    @sigma_longitudinal_per_sqrt_s.setter
    def sigma_longitudinal_per_sqrt_s(
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
    Wheel odometry; docs/models/motion.md.
    """
    def __init__(self, config: OdometryConfig) -> None: ...
    def propagate(
        self,
        T_world_body: Pose2,
        motion: Pose2,
        seconds: typing.SupportsFloat | typing.SupportsIndex,
        variance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] | None = None,
    ) -> Propagation:
        """
        Pose after `motion` (a Pose2 in the previous body frame), which took `seconds`. `variance` of its dx, dy and dheading replaces that of the model.
        """

class RangeConfig:
    """
    Noise of ranges without a sigma: R = sigma_m^2 + (sigma_relative * distance)^2.
    """
    def __init__(self) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good range passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def noise(self) -> NoiseKind:
        """
        Distribution of the noise of ranges.
        """
    @noise.setter
    def noise(self, arg0: NoiseKind) -> None: ...
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
        fraction of the distance
        """
    @sigma_relative.setter
    def sigma_relative(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class RangeModel:
    """
    Range from a body-fixed tag to an anchor, both in 3D; docs/models/ranges.md.
    """
    def __init__(
        self, config: RangeConfig, anchors: AnchorMap, tags: collections.abc.Sequence[Tag]
    ) -> None: ...
    @typing.overload
    def linearize(self, T_world_body: Pose2, z: Range) -> Linearization | None:
        """
        Linearization (1 x 3); None if anchor or tag is unknown or their positions coincide.
        """
    @typing.overload
    def linearize(
        self, T_world_body: Pose2, height: typing.SupportsFloat | typing.SupportsIndex, z: Range
    ) -> Linearization | None:
        """
        Linearization (1 x 4), the last column that of the height [m].
        """
    def linearize_point(
        self,
        tag_in_world: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        z: Range,
    ) -> Linearization | None:
        """
        Linearization (1 x 2) with respect to the position of the tag (2,) in world.
        """
    @typing.overload
    def predict(self, T_world_body: Pose2, z: Range) -> float | None:
        """
        Expected range [m]; None if anchor or tag is unknown.
        """
    @typing.overload
    def predict(
        self, T_world_body: Pose2, height: typing.SupportsFloat | typing.SupportsIndex, z: Range
    ) -> float | None:
        """
        Expected range [m] with the body at `height` [m] above z = 0; None if anchor or tag is unknown.
        """

class RangeBearingConfig:
    """
    Noise of landmark observations without a covariance.
    """
    def __init__(self) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good observation passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_bearing_rad(self) -> float:
        """
        rad
        """
    @sigma_bearing_rad.setter
    def sigma_bearing_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_range_m(self) -> float:
        """
        m
        """
    @sigma_range_m.setter
    def sigma_range_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_range_relative(self) -> float:
        """
        fraction of the range, in addition to sigma_range_m
        """
    @sigma_range_relative.setter
    def sigma_range_relative(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class RangeBearingInSpace:
    """
    Additional settings of range and bearing on a flying body.
    """
    def __init__(self) -> None: ...
    @property
    def sensor_up_m(self) -> float:
        """
        Height of the sensor above the body's origin [m].
        """
    @sensor_up_m.setter
    def sensor_up_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_elevation_rad(self) -> float:
        """
        Sigma of an elevation without its own [rad].
        """
    @sigma_elevation_rad.setter
    def sigma_elevation_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class RangeBearingModel:
    """
    Range and bearing from a sensor on the body to a landmark at (2,) in world; docs/models/landmarks.md.
    """
    @typing.overload
    def __init__(self, config: RangeBearingConfig, T_body_sensor: Pose2 = ...) -> None: ...
    @typing.overload
    def __init__(
        self, config: RangeBearingConfig, T_body_sensor: Pose2, in_space: RangeBearingInSpace
    ) -> None: ...
    @typing.overload
    def linearize(
        self,
        T_world_body: Pose2,
        height: typing.SupportsFloat | typing.SupportsIndex,
        landmark: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        z: RangeBearing,
    ) -> Linearization | None:
        """
        Linearization (1 to 3 x 4), the last column that of the height; None if the landmark is straight above or below the sensor.
        """
    @typing.overload
    def linearize(
        self,
        T_world_body: Pose2,
        landmark: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        z: RangeBearing,
    ) -> Linearization | None:
        """
        Linearization (1 or 2 x 3); None if landmark and sensor coincide.
        """
    @typing.overload
    def predict(
        self,
        T_world_body: Pose2,
        landmark: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Expected range [m] and bearing [rad], (2,).
        """
    @typing.overload
    def predict(
        self,
        T_world_body: Pose2,
        height: typing.SupportsFloat | typing.SupportsIndex,
        landmark: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Expected range [m], bearing and elevation [rad], (3,), of a landmark at (3,) from a height of the body over z = 0 [m].
        """

class PositionConfig:
    """
    Lever arm of the antenna and noise of position fixes.
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
    @property
    def gate(self) -> float:
        """
        Probability that a good fix passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def least_sigma_m(self) -> float:
        """
        Minimum sigma of any fix.
        """
    @least_sigma_m.setter
    def least_sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def noise(self) -> NoiseKind:
        """
        Distribution of the noise of fixes.
        """
    @noise.setter
    def noise(self, arg0: NoiseKind) -> None: ...
    @property
    def sigma_m(self) -> float:
        """
        Sigma of a fix without a covariance; 0: not modelled.
        """
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PositionModel:
    """
    Position of an antenna on the body, or of one of its tags; docs/models/poses.md.
    """
    def __init__(
        self, config: PositionConfig, tags: collections.abc.Sequence[Tag] = []
    ) -> None: ...
    def linearize(self, T_world_body: Pose2, z: PositionFix) -> Linearization | None:
        """
        Linearization (2 x 3, or 1 x 3 where an axis is not measured); None if the tag is unknown or nothing is measured.
        """
    def linearize_point(
        self,
        point: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        z: PositionFix,
    ) -> Linearization | None:
        """
        Linearization (2 x 2) with respect to the point (2,) in world.
        """
    @typing.overload
    def predict(
        self, T_world_body: Pose2
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Position of the antenna (2,) in world [m].
        """
    @typing.overload
    def predict(
        self, T_world_body: Pose2, tag: typing.SupportsInt | typing.SupportsIndex
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"] | None:
        """
        Position of a tag (2,) in world [m]; None if the tag is unknown.
        """

class PoseConfig:
    """
    Sigmas of poses without a covariance (0: not modelled) and minimum sigmas of any pose.
    """

    shares_odometry: bool
    def __init__(self) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good pose passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def least_sigma_heading_rad(self) -> float: ...
    @least_sigma_heading_rad.setter
    def least_sigma_heading_rad(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def least_sigma_m(self) -> float: ...
    @least_sigma_m.setter
    def least_sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def noise(self) -> NoiseKind:
        """
        Distribution of the noise of poses.
        """
    @noise.setter
    def noise(self, arg0: NoiseKind) -> None: ...
    @property
    def sigma_heading_rad(self) -> float: ...
    @sigma_heading_rad.setter
    def sigma_heading_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_m(self) -> float: ...
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PoseModel:
    """
    Pose from another localizer; docs/models/poses.md.
    """
    @typing.overload
    def __init__(self) -> None: ...
    @typing.overload
    def __init__(self, config: PoseConfig) -> None: ...
    def linearize(self, T_world_body: Pose2, z: PoseObservation) -> Linearization | None:
        """
        Linearization (3 x 3, fewer rows if an axis is not measured); None if none is.
        """
    def predict(self, T_world_body: Pose2) -> Pose2: ...

class HeadingConfig:
    """
    Noise and mounting of what measures headings.
    """
    def __init__(self) -> None: ...
    @property
    def antenna_forward_m(self) -> float:
        """
        Place of the antenna of courses in body [m].
        """
    @antenna_forward_m.setter
    def antenna_forward_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def antenna_left_m(self) -> float: ...
    @antenna_left_m.setter
    def antenna_left_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good heading passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def least_sigma_rad(self) -> float:
        """
        Minimum sigma of a heading [rad].
        """
    @least_sigma_rad.setter
    def least_sigma_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def min_speed_mps(self) -> float:
        """
        Minimum speed of the antenna at which a course is fused [m/s].
        """
    @min_speed_mps.setter
    def min_speed_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def offset_rad(self) -> float:
        """
        What it reads more than the heading [rad]: its mount, the declination.
        """
    @offset_rad.setter
    def offset_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_rad(self) -> float:
        """
        Sigma of a heading without a sigma of its own [rad].
        """
    @sigma_rad.setter
    def sigma_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class HeadingModel:
    """
    Heading of the body or course of its antenna; docs/models/poses.md.
    """
    @typing.overload
    def __init__(self) -> None: ...
    @typing.overload
    def __init__(self, config: HeadingConfig) -> None: ...
    def direction(self, rate: Pose2) -> float | None:
        """
        Direction [rad] in which the antenna travels in body, for a body that moves at `rate` (Pose2: m/s, m/s, rad/s); None below the minimum speed.
        """
    def linearize(self, T_world_body: Pose2, z: Heading, rate: Pose2 = ...) -> Linearization | None:
        """
        Linearization (1 x 3); None of a course below the minimum speed.
        """

class PositionStatus(enum.IntEnum):
    """
    Result of range-only positioning.
    """

    AMBIGUOUS = ...
    BAD_RANGE = ...
    EXCLUDED = ...
    INCONSISTENT = ...
    NOT_CONVERGED = ...
    UNDERDETERMINED = ...
    UNIQUE = ...

class RangePosition2:
    """
    Position of one epoch, returned by `Multilateration.solve`.
    """
    @property
    def cost(self) -> float:
        """
        Chi-square, or the sum of losses.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]:
        """
        First order [m^2].
        """
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"] | None:
        """
        Best fit [m], or None. Check `status` first.
        """
    @property
    def status(self) -> PositionStatus: ...

class RangePosition3:
    """
    Position of one epoch, returned by `Multilateration.solve`.
    """
    @property
    def cost(self) -> float:
        """
        Chi-square, or the sum of losses.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        First order [m^2].
        """
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None:
        """
        Best fit [m], or None. Check `status` first.
        """
    @property
    def status(self) -> PositionStatus: ...

class PositionHypothesis:
    """
    A position that fits the ranges.
    """
    def __repr__(self) -> str: ...
    @property
    def cost(self) -> float:
        """
        Chi-square, or the sum of losses.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        First order, shape (d, d) [m^2]; infinite if a direction is unobservable.
        """
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Shape (d,) [m].
        """
    @property
    def weak_direction(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Unit vector of the largest uncertainty.
        """
    @property
    def weak_sigma(self) -> float:
        """
        Sigma along it [m].
        """

class SolverComparison:
    """
    SR-LS compared to maximum likelihood on the same ranges.
    """
    @property
    def agree(self) -> bool: ...
    @property
    def difference(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Maximum likelihood minus SR-LS [m].
        """
    @property
    def dof(self) -> int:
        """
        0 if they cannot be compared.
        """
    @property
    def limit(self) -> float:
        """
        Largest statistic of inlier ranges.
        """
    @property
    def squared_range_covariance(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        First-order covariance of SR-LS [m^2].
        """
    @property
    def squared_range_position(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        [m]
        """
    @property
    def statistic(self) -> float:
        """
        Squared Mahalanobis norm of the difference under its predicted covariance.
        """

class MlComparison:
    """
    How far apart the two solvers of maximum likelihood end.
    """
    @property
    def ceres_cost(self) -> float: ...
    @property
    def ceres_covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        First order, at that minimum, shape (d, d) [m^2].
        """
    @property
    def ceres_position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Minimum of Ceres nearest to the best of `hypotheses`, shape (d,) [m].
        """
    @property
    def distance(self) -> float:
        """
        Between the two [m].
        """
    @property
    def sigmas(self) -> float:
        """
        The same in standard deviations of the covariance of the best hypothesis.
        """

class RangeCulprit:
    """
    Range whose removal improves a bad fit most.
    """
    @property
    def explains(self) -> bool:
        """
        Whether the other ranges are consistent.
        """
    @property
    def index(self) -> int:
        """
        Index of the range.
        """
    @property
    def statistic(self) -> float:
        """
        Decrease of the cost by its removal: chi-square of 1 dof.
        """
    @property
    def without(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Position from the others [m].
        """

class Dilution:
    """
    Dilution of precision: sigma of a position per sigma of ranges.
    """
    @property
    def horizontal(self) -> float: ...
    @property
    def position(self) -> float: ...
    @property
    def vertical(self) -> float: ...

class PositionSolution:
    """
    Position and diagnostics from one set of ranges.
    """
    @property
    def comparison(self) -> SolverComparison | None: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"] | None:
        """
        Its covariance (d, d) [m^2], or None unless the status is UNIQUE.
        """
    @property
    def culprit(self) -> RangeCulprit | None: ...
    @property
    def dop(self) -> Dilution | None: ...
    @property
    def fit_dof(self) -> int: ...
    @property
    def fit_limit(self) -> float:
        """
        Largest cost of inlier ranges.
        """
    @property
    def fits(self) -> bool: ...
    @property
    def hypotheses(self) -> list[PositionHypothesis]:
        """
        All hypotheses, ordered by cost.
        """
    @property
    def iterations(self) -> int: ...
    @property
    def ml_comparison(self) -> MlComparison | None:
        """
        Newton against Ceres, with `ml` 'both' where each found a minimum; else None.
        """
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"] | None:
        """
        The position (d,) [m], or None unless the status is UNIQUE.
        """
    @property
    def reason(self) -> str:
        """
        The status in words; '' if unique.
        """
    @property
    def residuals(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Range minus distance from the best hypothesis, shape (m,) [m].
        """
    @property
    def status(self) -> PositionStatus: ...
    @property
    def termination(self) -> str:
        """
        Why the solver stopped.
        """

class PositionBatch:
    """
    Positions of n epochs, as arrays.
    """
    @property
    def cost(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Shape (n,).
        """
    @property
    def covariance(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Shape (n, d, d) [m^2].
        """
    @property
    def position(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Shape (n, d) [m].
        """
    @property
    def status(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Values of `PositionStatus`, shape (n,).
        """

class Multilateration:
    """
    Range-only positioning with a fixed set of anchors; parameters as in `locate`.
    """
    def __init__(
        self,
        anchors: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma: typing.SupportsFloat
        | typing.SupportsIndex
        | typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = 0.1,
        *,
        height: typing.SupportsFloat | typing.SupportsIndex | None = None,
        loss: str = "none",
        loss_scale: typing.SupportsFloat | typing.SupportsIndex | None = None,
        wrong_side_probability: typing.SupportsFloat | typing.SupportsIndex = 1e-06,
        false_alarm_probability: typing.SupportsFloat | typing.SupportsIndex = 0.001,
    ) -> None: ...
    def solve(
        self, ranges: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> RangePosition2 | RangePosition3:
        """
        Position from one range per anchor [m]; NaN for an anchor without a range.
        """

class Verdict(enum.IntEnum):
    """
    Result of processing a message.
    """

    FUSED = ...
    GATED = ...
    IGNORED = ...
    IMPLAUSIBLE = ...
    NOT_MODELLED = ...
    STALE = ...

class Reason(enum.IntEnum):
    """
    Why a message was not fused.
    """

    AMBIGUOUS = ...
    BEFORE_ESTIMATE = ...
    BEYOND_LIMITS = ...
    COVERED = ...
    FROZEN = ...
    INCOMPLETE = ...
    JUMPED = ...
    MAP_FULL = ...
    NONE = ...
    NOT_STARTED = ...
    NOT_USED = ...
    NO_DIRECTION = ...
    NO_DURATION = ...
    NO_NEWS = ...
    NO_RETURNS = ...
    NO_SIGMA = ...
    NUMERICAL = ...
    REPLACED = ...
    SOURCE_EXCLUDED = ...
    SWITCHED_OFF = ...
    TOO_FAR_AHEAD = ...
    TOO_LATE = ...
    UNKNOWN_ANCHOR = ...
    UNKNOWN_LANDMARK = ...
    UNKNOWN_TAG = ...
    UNLIKELY = ...
    UNNAMED = ...
    WAITS = ...
    WATCHED = ...

class Outcome:
    """
    Verdict on one message with its innovation statistics.
    """
    def __repr__(self) -> str: ...
    @property
    def dof(self) -> int:
        """
        Rows of the innovation.
        """
    @property
    def interventions(self) -> int:
        """
        Number of variances clamped to their bounds.
        """
    @property
    def limit(self) -> float:
        """
        Largest `nis` that the gate passes.
        """
    @property
    def log_likelihood(self) -> float:
        """
        log N(r; 0, S).
        """
    @property
    def nis(self) -> float:
        """
        Normalized innovation squared r' S^-1 r; NaN if the message was not compared.
        """
    @property
    def reason(self) -> Reason:
        """
        Why it was not fused; NONE if it was.
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
    Chi-square gate; `probability` that an inlier passes, 1 for no gate.
    """
    def __init__(self, probability: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    def limit(self, dof: typing.SupportsInt | typing.SupportsIndex) -> float:
        """
        Largest NIS that passes.
        """
    @property
    def probability(self) -> float: ...

class NoiseShape:
    """
    Measurement noise as a mixture of Gaussians wider than R.

    Parameters
    ----------
    kind : NoiseKind
    dof : float, optional
        Degrees of freedom of STUDENT_T, at least 1.
    late_share : float, optional
        Fraction of measurements that read long under ONE_SIDED; between 0 and 1.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """
    def __init__(
        self,
        kind: NoiseKind,
        dof: typing.SupportsFloat | typing.SupportsIndex = 4.0,
        late_share: typing.SupportsFloat | typing.SupportsIndex = 0.05,
    ) -> None: ...
    @property
    def is_gaussian(self) -> bool: ...
    @property
    def parts(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Weight, mean and variance of each component for R = 1, (n, 3); empty if Gaussian.
        """

class SlotKind(enum.Enum):
    """
    Type of variable in a slot.
    """

    POINT2 = ...
    POINT3 = ...
    POSE2 = ...
    SCALAR = ...

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
    def consider(self, slot: Slot) -> None:
        """
        Marks a variable as considered: its uncertainty is accounted for, but measurements no longer change it (Schmidt-Kalman filter).
        """
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
    Pose T_world_body at one stamp [ns], with the covariance (3, 3) of (x, y, heading).
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
    def sigma_heading(self) -> float:
        """
        [rad].
        """
    @property
    def sigma_position(self) -> float:
        """
        Semi-major axis of the 1-sigma position ellipse [m].
        """
    @property
    def stamp(self) -> int: ...

class PoseHypothesis:
    """
    One of several pose hypotheses.
    """
    def __init__(
        self, estimate: PoseEstimate, probability: typing.SupportsFloat | typing.SupportsIndex = 1.0
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def estimate(self) -> PoseEstimate: ...
    @property
    def probability(self) -> float:
        """
        Relative to the other hypotheses, 0 to 1.
        """

class CalibratedError:
    """
    Estimate of a systematic sensor error.
    """
    def __repr__(self) -> str: ...
    @property
    def anchor(self) -> int | None:
        """
        Id of the anchor whose error it is, or None.
        """
    @property
    def name(self) -> str: ...
    @property
    def sigma(self) -> float: ...
    @property
    def sigma_start(self) -> float:
        """
        Prior standard deviation.
        """
    @property
    def value(self) -> float: ...

class CalibrationConfig:
    """
    Prior standard deviations of the systematic errors of odometry, landmark sensor and ranges that a PoseEkf estimates. An error with sigma 0 is not a state.
    """
    def __init__(self) -> None: ...
    @property
    def anchor_offset_correlation_s(self) -> float:
        """
        Correlation time of the anchor offsets; 0: constant.
        """
    @anchor_offset_correlation_s.setter
    def anchor_offset_correlation_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def consider(self) -> bool:
        """
        Account for the errors without estimating them (Schmidt-Kalman filter).
        """
    @consider.setter
    def consider(self, arg0: bool) -> None: ...
    @property
    def sigma_anchor_offset_m(self) -> float:
        """
        Range offset of each anchor of the map.
        """
    @sigma_anchor_offset_m.setter
    def sigma_anchor_offset_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_anchor_scale(self) -> float:
        """
        Range scale error of each anchor, added to the scale in the map.
        """
    @sigma_anchor_scale.setter
    def sigma_anchor_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_delay_s(self) -> float:
        """
        Latency of landmark observations.
        """
    @sigma_delay_s.setter
    def sigma_delay_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_direction_rad(self) -> float:
        """
        Direction of travel relative to the heading.
        """
    @sigma_direction_rad.setter
    def sigma_direction_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_heading_offset_rad(self) -> float:
        """
        Offset of headings, beyond that of HeadingConfig.
        """
    @sigma_heading_offset_rad.setter
    def sigma_heading_offset_rad(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_heading_offset_rad_per_sqrt_s(self) -> float:
        """
        Random walk of that offset.
        """
    @sigma_heading_offset_rad_per_sqrt_s.setter
    def sigma_heading_offset_rad_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_range_delay_s(self) -> float:
        """
        Latency of all ranges.
        """
    @sigma_range_delay_s.setter
    def sigma_range_delay_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_range_offset_m(self) -> float:
        """
        Offset of ranges to landmarks.
        """
    @sigma_range_offset_m.setter
    def sigma_range_offset_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_range_scale(self) -> float: ...
    @sigma_range_scale.setter
    def sigma_range_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_scale(self) -> float:
        """
        Scale error of the odometry distance.
        """
    @sigma_scale.setter
    def sigma_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sensor_m(self) -> float:
        """
        Position of the sensor in the body frame, x and y.
        """
    @sigma_sensor_m.setter
    def sigma_sensor_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sensor_rad(self) -> float:
        """
        Heading of the sensor in the body frame.
        """
    @sigma_sensor_rad.setter
    def sigma_sensor_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_bias_radps(self) -> float:
        """
        Turn rate bias, as of a gyro.
        """
    @sigma_turn_bias_radps.setter
    def sigma_turn_bias_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_bias_radps_per_sqrt_s(self) -> float:
        """
        Random walk of that bias.
        """
    @sigma_turn_bias_radps_per_sqrt_s.setter
    def sigma_turn_bias_radps_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_turn_scale(self) -> float:
        """
        Scale error of the odometry turn.
        """
    @sigma_turn_scale.setter
    def sigma_turn_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class AdaptiveNoiseConfig:
    """
    Adaptation of measurement variances to their innovations, as a factor on the reported variance.
    """
    def __init__(self) -> None: ...
    @property
    def least(self) -> float:
        """
        Minimum factor.
        """
    @least.setter
    def least(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def messages(self) -> float:
        """
        Window length per kind of message; 0: no adaptation.
        """
    @messages.setter
    def messages(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def most(self) -> float:
        """
        Maximum factor.
        """
    @most.setter
    def most(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PoseEkfConfig:
    """
    Noise, gates and behaviour of a PoseEkf.
    """

    adaptive: AdaptiveNoiseConfig
    calibration: CalibrationConfig
    heading: HeadingConfig
    landmark: RangeBearingConfig
    limits: Limits
    odometry: OdometryConfig
    pose: PoseConfig
    position: PositionConfig
    range: RangeConfig
    def __init__(self) -> None: ...
    @property
    def correlation_s(self) -> float:
        """
        Correlation time of the errors of each source, of which it is learnt how much is correlated; 0: errors are independent.
        """
    @correlation_s.setter
    def correlation_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        Timeout of odometry [s]: how long the last motion is extrapolated.
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_dof(self) -> float:
        """
        Degrees of freedom of STUDENT_T noise.
        """
    @robust_dof.setter
    def robust_dof(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_late_share(self) -> float:
        """
        Fraction of ranges that read long under ONE_SIDED noise.
        """
    @robust_late_share.setter
    def robust_late_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
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

class LandmarkSensor:
    """
    Known landmarks and the pose T_body_sensor of the sensor that observes them.
    """
    def __init__(self, map: LandmarkMap | None = None, T_body_sensor: Pose2 = ...) -> None: ...
    @property
    def T_body_sensor(self) -> Pose2: ...

class World:
    """
    What does not change while a robot drives.

    The second argument of every estimator, which takes of it what it can use.

    Parameters
    ----------
    anchors : AnchorMap, optional
        To which ranges are measured.
    tags : list of Tag, optional
        On the body.
    landmarks : LandmarkSensor, optional
        Known landmarks, and the sensor that observes them.
    grid : OccupancyGrid, optional
        Map of walls, of an Mcl.
    matcher : ScanMatcher, optional
        Of scans on a map: gives the heading while a start is searched.

    Examples
    --------
    >>> from locfuse import *
    >>> world = World(AnchorMap([Anchor(1, [0, 0, 2])]), [Tag(0, [0, 0, 1.1])])
    >>> ekf = RecoveringEkf(RecoveringEkfConfig(), world)
    """
    def __init__(
        self,
        anchors: AnchorMap | None = None,
        tags: collections.abc.Sequence[Tag] = [],
        landmarks: LandmarkSensor | None = None,
        grid: OccupancyGrid | None = None,
        matcher: ScanMatcher | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def tags(self) -> list[Tag]: ...

class Association(enum.Enum):
    """
    Data association of landmark observations without an id.
    """

    GLOBAL = ...
    JOINT = ...
    NEAREST = ...

class PoseEkf:
    """
    Extended Kalman filter over (x, y, heading) in world.

    Odometry predicts; ranges, positions, poses and landmarks update (ekim2020, section 2.1).

    Parameters
    ----------
    config : PoseEkfConfig
    world : World
    start : PoseEstimate

    Raises
    ------
    ValueError
        If the config is out of range, or the start is not finite or not positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 2]), Anchor(2, [8, 0, 2]), Anchor(3, [4, 6, 2])])
    >>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.5, 0.5, 0.1]) ** 2)
    >>> ekf = PoseEkf(PoseEkfConfig(), World(anchors, [Tag(0, [0, 0, 1.1])]), start)
    >>> ekf.on(Increment(0, 100_000_000, Pose2(0.05, 0, 0))).verdict.name
    'FUSED'
    >>> ekf.on(Range(100_000_000, tag=0, anchor=2, range=5.4)).verdict.name
    'FUSED'
    """
    def __copy__(self) -> PoseEkf:
        """
        Independent copy.
        """
    def __deepcopy__(self, memo: typing.Any) -> PoseEkf:
        """
        Independent copy.
        """
    def __init__(self, config: PoseEkfConfig, world: World, start: PoseEstimate) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @typing.overload
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate propagated to the end of the latest odometry.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> PoseEstimate:
        """
        PoseEstimate propagated to `stamp` [ns], which must not precede the belief.
        """
    def fuse(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        linearization: Linearization,
        gate: Gate,
    ) -> Outcome:
        """
        Fuses a user-defined measurement of the pose at `stamp` [ns] with a Jacobian (m, 3). Linearize at `estimate(stamp).pose`.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Fuses one message; a message that is not fused leaves the estimator unchanged.
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
        Fuses the motion from `begin` to `stamp` [ns], then the ranges (n,) [m] to the anchors (n,) at `stamp`. Returns n + 1 outcomes.
        """
    @typing.overload
    def on_joint(self, epoch: collections.abc.Sequence[Range]) -> Outcome:
        """
        Fuses ranges of one stamp as one measurement: one linearization, one gate.
        """
    @typing.overload
    def on_joint(
        self, sightings: collections.abc.Sequence[RangeBearing], association: Association = ...
    ) -> list[Outcome]:
        """
        Fuses landmark observations of one stamp. Those without an id are associated before any is fused. Returns one Outcome each: GATED if no landmark matches, NOT_MODELLED if the result would not be finite.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def errors(self) -> list[CalibratedError]:
        """
        A CalibratedError for each error that is a state.
        """
    @property
    def interventions(self) -> int:
        """
        Number of times a variance was clamped to its bounds.
        """
    @property
    def motion_model(self) -> OdometryMotion: ...
    @property
    def range_model(self) -> RangeModel: ...

class AltitudeConfig:
    """
    Noise and mounting of the altimeter.
    """
    def __init__(self) -> None: ...
    @property
    def altimeter_up_m(self) -> float:
        """
        Height of the altimeter above the body's origin [m].
        """
    @altimeter_up_m.setter
    def altimeter_up_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good altitude passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_m(self) -> float:
        """
        Sigma of an altitude without a sigma of its own [m].
        """
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class AltitudeModel:
    """
    Altimeter height; docs/air.md.
    """
    def __init__(self, config: AltitudeConfig) -> None: ...
    def linearize(
        self, height: typing.SupportsFloat | typing.SupportsIndex, z: Altitude
    ) -> Linearization:
        """
        Linearization (1 x 1).
        """
    def predict(self, height: typing.SupportsFloat | typing.SupportsIndex) -> float: ...

class ConstantVelocityConfig:
    """
    Square roots of the spectral densities of white acceleration.
    """
    def __init__(self) -> None: ...
    @property
    def sigma_climb_per_sqrt_s(self) -> float:
        """
        m/s / sqrt(s)
        """
    @sigma_climb_per_sqrt_s.setter
    def sigma_climb_per_sqrt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
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
    def sigma_velocity_per_sqrt_s(self) -> float:
        """
        m/s / sqrt(s), each axis of the velocity.
        """
    @sigma_velocity_per_sqrt_s.setter
    def sigma_velocity_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class ConstantVelocityMotion:
    """
    Constant-velocity motion without odometry; docs/models/motion.md.
    """
    def __init__(self, config: ConstantVelocityConfig) -> None: ...
    def propagate(
        self,
        state: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        seconds: typing.SupportsFloat | typing.SupportsIndex,
    ) -> BodyPropagation:
        """
        State (7,) `seconds` later: x, y, heading, height, velocity x and y, climb rate.
        """

class InertialConfig:
    """
    Noise and mount of an inertial sensor; docs/air.md.
    """
    def __init__(self) -> None: ...
    @property
    def mount(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Roll, pitch and yaw of the sensor's axes in the body [rad], shape (3,).
        """
    @mount.setter
    def mount(
        self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]
    ) -> None: ...
    @property
    def sigma_bias_mps2(self) -> float:
        """
        Sigma of the accelerometer's bias at the start [m/s^2].
        """
    @sigma_bias_mps2.setter
    def sigma_bias_mps2(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_bias_mps2_per_sqrt_s(self) -> float:
        """
        Random walk of the accelerometer's bias [m/s^2 / sqrt(s)].
        """
    @sigma_bias_mps2_per_sqrt_s.setter
    def sigma_bias_mps2_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_bias_radps(self) -> float:
        """
        Sigma of the gyro's bias at the start [rad/s].
        """
    @sigma_bias_radps.setter
    def sigma_bias_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_bias_radps_per_sqrt_s(self) -> float:
        """
        Random walk of the gyro's bias [rad/s / sqrt(s)].
        """
    @sigma_bias_radps_per_sqrt_s.setter
    def sigma_bias_radps_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_scale(self) -> float:
        """
        Of the gyro's scale.
        """
    @sigma_scale.setter
    def sigma_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_per_sqrt_s(self) -> float:
        """
        White noise of the gyro [rad / sqrt(s)].
        """
    @sigma_turn_per_sqrt_s.setter
    def sigma_turn_per_sqrt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_velocity_per_sqrt_s(self) -> float:
        """
        White noise of the accelerometer [m/s / sqrt(s)].
        """
    @sigma_velocity_per_sqrt_s.setter
    def sigma_velocity_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class AirMotion(enum.Enum):
    """
    Motion model of an AirEkf.
    """

    CONSTANT_VELOCITY = ...
    INERTIAL = ...
    ODOMETRY = ...

class AirEkfConfig:
    """
    Motion, noise, gates and behaviour of an AirEkf.
    """

    altitude: AltitudeConfig
    constant_velocity: ConstantVelocityConfig
    inertial: InertialConfig
    landmark: RangeBearingConfig
    landmark_in_space: RangeBearingInSpace
    limits: Limits
    motion: AirMotion
    odometry: OdometryConfig
    pose: PoseConfig
    position: PositionConfig
    range: RangeConfig
    def __init__(self) -> None: ...
    @property
    def correlation_s(self) -> float:
        """
        As of PoseEkfConfig.
        """
    @correlation_s.setter
    def correlation_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        Timeout of odometry [s]: how long the last motion is extrapolated.
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_height_m(self) -> float: ...
    @max_height_m.setter
    def max_height_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def min_height_m(self) -> float: ...
    @min_height_m.setter
    def min_height_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_dof(self) -> float:
        """
        Degrees of freedom of STUDENT_T noise.
        """
    @robust_dof.setter
    def robust_dof(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_late_share(self) -> float:
        """
        Fraction of ranges that read long under ONE_SIDED noise.
        """
    @robust_late_share.setter
    def robust_late_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_height_per_sqrt_s(self) -> float:
        """
        Process noise of the height on top of the climb rate, m / sqrt(s).
        """
    @sigma_height_per_sqrt_s.setter
    def sigma_height_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_lost_heading_per_sqrt_s(self) -> float: ...
    @sigma_lost_heading_per_sqrt_s.setter
    def sigma_lost_heading_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_lost_height_per_sqrt_s(self) -> float: ...
    @sigma_lost_height_per_sqrt_s.setter
    def sigma_lost_height_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_lost_xy_per_sqrt_s(self) -> float: ...
    @sigma_lost_xy_per_sqrt_s.setter
    def sigma_lost_xy_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_start_climb_mps(self) -> float: ...
    @sigma_start_climb_mps.setter
    def sigma_start_climb_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_start_velocity_mps(self) -> float: ...
    @sigma_start_velocity_mps.setter
    def sigma_start_velocity_mps(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class Attitude:
    """
    How a body is turned in space.
    """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Of its error, a rotation about the axes of the world [rad^2], shape (3, 3).
        """
    @property
    def quaternion(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 1]"]:
        """
        (w, x, y, z) of the rotation from body to world, w >= 0, shape (4,).
        """

class AirEstimate:
    """
    Pose and height of a flying body at one stamp [ns], with the covariance (4, 4) of (x, y, heading, height).
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        pose: Pose2,
        height: typing.SupportsFloat | typing.SupportsIndex,
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[4, 4]"],
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def attitude(self) -> Attitude | None:
        """
        Attitude of an inertial body; None where it is taken as level.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]:
        """
        Shape (4, 4).
        """
    @property
    def height(self) -> float:
        """
        Above z = 0 of the world frame [m].
        """
    @property
    def pose(self) -> Pose2: ...
    @property
    def stamp(self) -> int: ...

class AirEkf:
    """
    Extended Kalman filter over (x, y, heading, height) of a flying body.

    The motion is odometry with a climb rate, an estimated constant velocity, or what an inertial sensor
    measures. With that the attitude is estimated, too; without it the body is taken as level.

    Parameters
    ----------
    config : AirEkfConfig
    world : World
    start : AirEstimate

    Raises
    ------
    ValueError
        If the config is out of range or the start not finite and positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 2]), Anchor(2, [8, 0, 0]), Anchor(3, [4, 6, 3])])
    >>> start = AirEstimate(0, Pose2(3, 2, 0), 1.0, np.diag([0.5, 0.5, 0.1, 0.5]) ** 2)
    >>> ekf = AirEkf(AirEkfConfig(), World(anchors, [Tag(0, [0, 0, 0])]), start)
    >>> ekf.on(Velocity(0, 0.5, 0.0), climb_rate=0.2).verdict.name
    'FUSED'
    >>> ekf.on(Range(1_000_000_000, tag=0, anchor=1, range=4.1)).verdict.name
    'FUSED'
    >>> ekf.on(Altitude(1_000_000_000, height=1.2, sigma=0.1)).verdict.name
    'FUSED'
    """
    def __copy__(self) -> AirEkf:
        """
        Independent copy.
        """
    def __deepcopy__(self, memo: typing.Any) -> AirEkf:
        """
        Independent copy.
        """
    def __init__(self, config: AirEkfConfig, world: World, start: AirEstimate) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    def attitude(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Rotation (3, 3) from body to world at the belief's stamp; of a level body by its heading.
        """
    @typing.overload
    def estimate(self) -> AirEstimate:
        """
        AirEstimate propagated to the end of the latest odometry.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> AirEstimate:
        """
        AirEstimate propagated to `stamp` [ns], which must not precede the belief.
        """
    @typing.overload
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Fuses one message; a message that is not fused leaves the estimator unchanged.
        """
    @typing.overload
    def on(
        self, message: Velocity, climb_rate: typing.SupportsFloat | typing.SupportsIndex
    ) -> Outcome: ...
    @typing.overload
    def on(
        self, message: Increment, climb_rate: typing.SupportsFloat | typing.SupportsIndex
    ) -> Outcome:
        """
        The same with a climb rate [m/s], which applies as long as the odometry message.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def interventions(self) -> int:
        """
        Number of times a variance was clamped to its bounds.
        """

class GyroTurn(enum.Enum):
    """
    How a turn is made of wheels and gyro.
    """

    AVERAGE = ...
    WEIGHTED = ...

class GyroVerdict(enum.Enum):
    """
    Outcome of a motion.
    """

    NO_GYRO = ...
    SLIPPED = ...
    TURNED = ...

class GyroOdometryConfig:
    """
    Settings of a GyroOdometry.
    """

    turn: GyroTurn
    def __init__(self) -> None: ...
    @property
    def odometry(self) -> OdometryConfig:
        """
        Noise of the wheels, an OdometryConfig.
        """
    @odometry.setter
    def odometry(self, arg0: OdometryConfig) -> None: ...
    @property
    def sigma_bias_radps(self) -> float:
        """
        Of its bias at the start [rad/s].
        """
    @sigma_bias_radps.setter
    def sigma_bias_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_bias_radps_per_sqrt_s(self) -> float:
        """
        Random walk of the bias [rad/s / sqrt(s)].
        """
    @sigma_bias_radps_per_sqrt_s.setter
    def sigma_bias_radps_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_scale(self) -> float:
        """
        Of the gyro's scale.
        """
    @sigma_scale.setter
    def sigma_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_per_sqrt_s(self) -> float:
        """
        White noise of the gyro [rad / sqrt(s)].
        """
    @sigma_turn_per_sqrt_s.setter
    def sigma_turn_per_sqrt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_scale(self) -> float:
        """
        Of the scale of the wheels' turn.
        """
    @sigma_turn_scale.setter
    def sigma_turn_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class GyroMotion:
    """
    A motion whose turn is by wheels and gyro.
    """
    @property
    def increment(self) -> Increment: ...
    @property
    def verdict(self) -> GyroVerdict: ...

class GyroOdometry:
    """
    Odometry whose turn is measured by wheels and a gyro together; docs/models/motion.md.

    Feed messages in order of arrival. The gyro's bias and the scale of the wheels' turn are learnt from
    their differences; where the two contradict each other wheels slip, and the turn is the gyro's. With
    an accelerometer the turn is that about the vertical, however the sensor is mounted.

    Parameters
    ----------
    config : GyroOdometryConfig

    Raises
    ------
    ValueError
        If a sigma is out of bounds, or a message is not valid.

    Examples
    --------
    >>> from locfuse.core import GyroOdometry, GyroOdometryConfig, Imu, Increment, Pose2
    >>> odometry = GyroOdometry(GyroOdometryConfig())
    >>> for k in range(10):
    ...     odometry.on(Imu(k * 10**7, [0.0, 0.0, 0.5], [0.0, 0.0, 9.81]))
    >>> motion = odometry.on(Increment(0, 10**8, Pose2(0.1, 0.0, 0.05)))
    >>> motion.verdict.name, round(motion.increment.motion.heading, 3)
    ('TURNED', 0.05)
    """
    def __init__(self, config: GyroOdometryConfig) -> None: ...
    @typing.overload
    def on(self, z: Imu) -> None:
        """
        Takes a sample; one that is not newer than the last is dropped.
        """
    @typing.overload
    def on(self, u: Velocity) -> GyroMotion | None:
        """
        Returns the motion since the velocity before; None for the first one and after a pause of a second.
        """
    @typing.overload
    def on(self, u: Increment) -> GyroMotion | None:
        """
        Returns the motion with its turn by both.
        """
    @property
    def bias(self) -> float:
        """
        Of the gyro about the vertical, as known now [rad/s].
        """
    @property
    def sigma_bias(self) -> float:
        """
        [rad/s].
        """

class ScanDrive:
    """
    Odometry of a laser's scans; the motion by wheels, if there are any, is where a fit begins.

    Feed messages in order of arrival. Without wheels, or while they are silent for more than a second,
    the body is expected to go on as it did in the last scans, give or take 0.5 m/s and 0.5 rad/s.

    Parameters
    ----------
    scans : ScanOdometryConfig, optional
    odometry : OdometryConfig, optional
        Noise of the wheels.

    Raises
    ------
    ValueError
        If a setting is out of bounds, or a message is not valid.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import LaserGeometry, LaserScan, Pose2
    >>> from locfuse.core import Increment, ScanDrive
    >>> angle = np.pi / 180 * (np.arange(360) + 0.5)
    >>> around = LaserGeometry(Pose2(), angle[0], np.pi / 180, range_min=0.1, range_max=10.0)
    >>> drive = ScanDrive()
    >>> for k, x in enumerate([0.0, 0.1]):  # in a room of 8 x 6 m; wheels report 12 cm
    ...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
    ...     drive.on(Increment((k - 1) * 10**9, k * 10**9, Pose2(0.12, 0.0, 0.0)))
    ...     motion = drive.on(LaserScan(k * 10**9, around, np.minimum(ahead, 3 / np.abs(np.sin(angle)))))
    >>> round(motion.motion.x, 2)
    0.1
    """
    def __init__(self, scans: ScanOdometryConfig = ..., odometry: OdometryConfig = ...) -> None: ...
    @typing.overload
    def on(self, u: Velocity) -> None:
        """
        Take the motion of the wheels; one that begins before the end of the last is dropped.
        """
    @typing.overload
    def on(self, u: Increment) -> None:
        """
        Take the motion of the wheels; one that begins before the end of the last is dropped.
        """
    @typing.overload
    def on(self, scan: LaserScan) -> Increment | None:
        """
        Return the motion since the last scan; None for the first, and for one that is late.
        """

class RigidFitStatus(enum.Enum):
    """
    Result of a rigid fit.
    """

    FITTED = ...
    MIRRORED = ...
    NOT_CONVERGED = ...
    NO_DIRECTION = ...

class RigidFit:
    """
    Pose of a rigid body from measured points.
    """
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Covariance of (x, y, heading), shape (3, 3).
        """
    @property
    def dof(self) -> int:
        """
        Degrees of freedom of `nis`: 2 n - 3.
        """
    @property
    def nis(self) -> float:
        """
        Chi-square of the points against a rigid body.
        """
    @property
    def pose(self) -> Pose2:
        """
        T_world_body; NaN if NO_DIRECTION.
        """
    @property
    def status(self) -> RigidFitStatus: ...

class PointMotionConfig:
    """
    White acceleration of a point.
    """
    def __init__(self) -> None: ...
    @property
    def sigma_velocity_per_sqrt_s(self) -> float:
        """
        m/s / sqrt(s), of each axis.
        """
    @sigma_velocity_per_sqrt_s.setter
    def sigma_velocity_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class VelocityConfig:
    """
    Velocity noise: that of the wheels, common to all points of the body, and that of each point.
    """
    def __init__(self) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good velocity passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_forward_mps(self) -> float: ...
    @sigma_forward_mps.setter
    def sigma_forward_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_lateral_mps(self) -> float: ...
    @sigma_lateral_mps.setter
    def sigma_lateral_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_point_mps(self) -> float:
        """
        Independent per point and axis; > 0.
        """
    @sigma_point_mps.setter
    def sigma_point_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_rate_radps(self) -> float: ...
    @sigma_turn_rate_radps.setter
    def sigma_turn_rate_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PointDistanceConfig:
    """
    Noise of a known distance.
    """
    def __init__(self) -> None: ...
    @property
    def gate(self) -> float:
        """
        Probability that a good distance passes its gate; 1: no gate.
        """
    @gate.setter
    def gate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_m(self) -> float: ...
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class VelocityModel:
    """
    Velocities of points on a body from wheel odometry; docs/models/poses.md.
    """
    @staticmethod
    def predict(
        heading: typing.SupportsFloat | typing.SupportsIndex,
        twist: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        point_in_body: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Velocity (2,) in world [m/s] of a point on a body with `twist` (forward [m/s], left [m/s], turn rate [rad/s]).
        """
    def __init__(self, config: VelocityConfig) -> None: ...
    def linearize(
        self,
        velocities: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[6, 1]"],
        heading: typing.SupportsFloat | typing.SupportsIndex,
        twist: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        points_in_body: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 2]"],
    ) -> Linearization:
        """
        Linearization (6 x 6) of three points (3, 2) with velocities (6,) in world.
        """

class PointDistanceModel:
    """
    Known distance between two points; docs/models/poses.md.
    """
    @staticmethod
    def predict(
        a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> float: ...
    def __init__(self, config: PointDistanceConfig) -> None: ...
    def linearize(
        self,
        a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        distance: typing.SupportsFloat | typing.SupportsIndex,
    ) -> Linearization | None:
        """
        Linearization (1 x 4) with respect to (a, b); None if the points coincide.
        """

class TagOrderVerdict(enum.Enum):
    """
    Whether fixes of three tags match their triangle.
    """

    AMBIGUOUS = ...
    FITS = ...
    NO_FIT = ...
    SWAPPED = ...

class TagOrder:
    """
    Assignment of ids to three tags from fixes of one epoch.
    """
    def __repr__(self) -> str: ...
    def __str__(self) -> str: ...
    @property
    def best(self) -> float:
        """
        NIS with `ids`.
        """
    @property
    def given(self) -> typing.Annotated[list[int], "FixedSize(3)"]:
        """
        The ids of the fixes.
        """
    @property
    def ids(self) -> typing.Annotated[list[int], "FixedSize(3)"]:
        """
        Ids that fit best, in the order of the fixes.
        """
    @property
    def limit(self) -> float:
        """
        Largest `nis` that passes.
        """
    @property
    def nis(self) -> float:
        """
        NIS with the given ids, 3 degrees of freedom.
        """
    @property
    def verdict(self) -> TagOrderVerdict: ...

class TagVerdict(enum.Enum):
    """
    Result of conditioning an RTLS fix.
    """

    FROZEN = ...
    JUMP = ...
    PASSED = ...
    RESTARTED = ...
    STALE = ...
    UNKNOWN_TAG = ...

class ConditionedFix:
    """
    RTLS fix after conditioning.
    """
    def __repr__(self) -> str: ...
    @property
    def distance(self) -> float:
        """
        Of JUMP, from the last that passed; of FROZEN, 0 [m]; else NaN.
        """
    @property
    def fix(self) -> PositionFix | None:
        """
        Bias removed, low-passed; None unless it passed.
        """
    @property
    def limit(self) -> float:
        """
        What the distance had to be at most (JUMP), or the tag moved more than (FROZEN) [m]; else NaN.
        """
    @property
    def verdict(self) -> TagVerdict: ...

class TagConditionerConfig:
    """
    Properties of the RTLS and limits of the machine.
    """
    def __init__(self) -> None: ...
    @property
    def bias_x_m(self) -> float:
        """
        Bias subtracted from every fix, in world [m].
        """
    @bias_x_m.setter
    def bias_x_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def bias_y_m(self) -> float: ...
    @bias_y_m.setter
    def bias_y_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def cutoff_hz(self) -> float:
        """
        Cutoff of the low-pass [Hz]; 0: none.
        """
    @cutoff_hz.setter
    def cutoff_hz(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def frozen_motion_m(self) -> float:
        """
        A fix that stays equal over this motion is FROZEN [m].
        """
    @frozen_motion_m.setter
    def frozen_motion_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        Timeout of a velocity [s].
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def jump_margin_m(self) -> float:
        """
        Margin beyond the distance at that speed [m].
        """
    @jump_margin_m.setter
    def jump_margin_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_speed_mps(self) -> float:
        """
        Maximum speed of a tag [m/s].
        """
    @max_speed_mps.setter
    def max_speed_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def restart_after(self) -> int:
        """
        Number of jumps in a row after which it restarts.
        """
    @restart_after.setter
    def restart_after(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class TagConditioner:
    """
    Conditions the fixes of an RTLS, per tag, before they reach a filter.

    Removes a constant bias, rejects jumps and frozen values, and low-passes the rest, whose lag at most
    is added to the covariance; docs/models/poses.md. Feed it in order of effective stamps.

    Parameters
    ----------
    config : TagConditionerConfig
    tags : list of Tag

    Raises
    ------
    ValueError
        If the config is out of range or the tags are not valid.
    """
    def __init__(
        self, config: TagConditionerConfig, tags: collections.abc.Sequence[Tag]
    ) -> None: ...
    def __repr__(self) -> str: ...
    @typing.overload
    def on(self, message: Velocity) -> None: ...
    @typing.overload
    def on(self, message: Increment) -> None:
        """
        Processes wheel odometry, from which the motion of each tag follows, or conditions a fix.
        """
    @typing.overload
    def on(self, message: PositionFix) -> ConditionedFix: ...

class TagTriangleEkfConfig:
    """
    Motion, noise and gates of a TagTriangleEkf.
    """

    limits: Limits
    motion: PointMotionConfig
    position: PositionConfig
    range: RangeConfig
    side: PointDistanceConfig
    velocity: VelocityConfig
    def __init__(self) -> None: ...
    @property
    def correlation_s(self) -> float:
        """
        As of PoseEkfConfig.
        """
    @correlation_s.setter
    def correlation_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def heading_is_known(self) -> bool:
        """
        Whether the heading that rotates wheel velocities is taken as exact, as in the paper; otherwise that of the tags is used, with its Jacobian.
        """
    @heading_is_known.setter
    def heading_is_known(self, arg0: bool) -> None: ...
    @property
    def holds_sides(self) -> bool:
        """
        Whether fixes and ranges are followed by the sides, once for all of a stamp, where there has been no odometry for a second.
        """
    @holds_sides.setter
    def holds_sides(self, arg0: bool) -> None: ...
    @property
    def sides_m(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None:
        """
        Measured sides (3,) [m] from tag 0 to 1, 1 to 2, 2 to 0, or None.
        """
    @sides_m.setter
    def sides_m(
        self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] | None
    ) -> None: ...
    @property
    def sigma_start_velocity_mps(self) -> float: ...
    @sigma_start_velocity_mps.setter
    def sigma_start_velocity_mps(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class TagTriangleEkf:
    """
    Extended Kalman filter over positions and velocities of three tags.

    The 12-state filter of celan2017, section III.D: fixes of the tags, their velocities from wheel
    odometry, the sides of their triangle; docs/models/poses.md. Slots are
    `tag0.position` to `tag2.position`, then `tag0.velocity` to `tag2.velocity`.

    Parameters
    ----------
    config : TagTriangleEkfConfig
    world : World
        With three tags, not collinear.
    start : PoseEstimate or list of PositionFix
        A pose, or one fix per tag with the same stamp.

    Raises
    ------
    ValueError
        If the config is out of range, the tags do not form a triangle, the start is not finite and
        positive definite, or fixes do not match the triangle; the text names the ids that would.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import *
    >>> tags = [Tag(1, [0.6, 0, 1]), Tag(2, [-0.3, 0.2, 1]), Tag(3, [-0.3, -0.2, 1])]
    >>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.2, 0.2, 0.1]) ** 2)
    >>> ekf = TagTriangleEkf(TagTriangleEkfConfig(), World(tags=tags), start)
    >>> ekf.on(Velocity(100_000_000, 0.3, 0.0)).verdict.name
    'FUSED'
    >>> ekf.on(PositionFix(1_000_000_000, [3.9, 2.0], 0.04 * np.eye(2), tag=1)).verdict.name
    'FUSED'
    """
    def __copy__(self) -> TagTriangleEkf:
        """
        Independent copy.
        """
    def __deepcopy__(self, memo: typing.Any) -> TagTriangleEkf:
        """
        Independent copy.
        """
    @typing.overload
    def __init__(self, config: TagTriangleEkfConfig, world: World, start: PoseEstimate) -> None: ...
    @typing.overload
    def __init__(
        self,
        config: TagTriangleEkfConfig,
        world: World,
        start: collections.abc.Sequence[PositionFix],
    ) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    def current(self) -> PoseEstimate:
        """
        PoseEstimate at the stamp of the belief.
        """
    @typing.overload
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate propagated to the end of the latest odometry.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> PoseEstimate:
        """
        PoseEstimate propagated to `stamp` [ns], which must not precede the belief.
        """
    def fit(self) -> RigidFit:
        """
        RigidFit of the body to the tags; its `nis` measures their rigidity.
        """
    def hold_sides(self) -> Outcome:
        """
        Fuses the three sides at the current belief; for use without odometry and without `holds_sides`.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Fuses one message; a message that is not fused leaves the estimator unchanged. After odometry the sides of the triangle are fused.
        """
    def pose(self) -> Pose2: ...
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def interventions(self) -> int:
        """
        Number of times a variance was clamped to its bounds.
        """
    @property
    def sides(self) -> Outcome:
        """
        Outcomes of the three sides that were fused last.
        """
    @property
    def tags(self) -> list[Tag]: ...

class StartStatus(enum.Enum):
    """
    Progress of the initialization.
    """

    AMBIGUOUS = ...
    READY = ...
    WAITING = ...

class StartMethod(enum.Enum):
    """
    Search of an initialization.
    """

    GAUSSIAN_SUM = ...
    SRLS_HEADINGS = ...

class StartState:
    """
    State of an Initializer.
    """
    def __repr__(self) -> str: ...
    @property
    def headings(self) -> HeadingSearch | None:
        """
        HeadingSearch of the last scan with SRLS_HEADINGS, else None.
        """
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        Pose hypotheses, likeliest first.
        """
    @property
    def reason(self) -> str:
        """
        Why it is not ready; empty if ready.
        """
    @property
    def status(self) -> StartStatus: ...

class InitializerConfig:
    """
    Settings of an Initializer: readiness thresholds and outlier model.
    """

    method: StartMethod
    def __init__(self) -> None: ...
    @property
    def epoch_s(self) -> float: ...
    @epoch_s.setter
    def epoch_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def estimator(self) -> PoseEkfConfig:
        """
        PoseEkfConfig of the hypotheses, and of the filter to continue with.
        """
    @estimator.setter
    def estimator(self, arg0: PoseEkfConfig) -> None: ...
    @property
    def headings(self) -> int: ...
    @headings.setter
    def headings(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def probability_ready(self) -> float: ...
    @probability_ready.setter
    def probability_ready(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_heading_ready_rad(self) -> float: ...
    @sigma_heading_ready_rad.setter
    def sigma_heading_ready_rad(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_map_m(self) -> float: ...
    @sigma_map_m.setter
    def sigma_map_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_map_rad(self) -> float: ...
    @sigma_map_rad.setter
    def sigma_map_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_xy_ready_m(self) -> float: ...
    @sigma_xy_ready_m.setter
    def sigma_xy_ready_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def spacing_heading_rad(self) -> float: ...
    @spacing_heading_rad.setter
    def spacing_heading_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def spacing_m(self) -> float: ...
    @spacing_m.setter
    def spacing_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def standing_ranges(self) -> int: ...
    @standing_ranges.setter
    def standing_ranges(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def tag_conditioner(self) -> TagConditionerConfig | None:
        """
        TagConditionerConfig of the fixes of tags before they are used, or None.
        """
    @tag_conditioner.setter
    def tag_conditioner(self, arg0: TagConditionerConfig | None) -> None: ...
    @property
    def watch_poses(self) -> bool:
        """
        Whether poses are judged by a PoseWatch, and not used.
        """
    @watch_poses.setter
    def watch_poses(self, arg0: bool) -> None: ...
    @property
    def wrong_share(self) -> float: ...
    @wrong_share.setter
    def wrong_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def wrong_span_m(self) -> float: ...
    @wrong_span_m.setter
    def wrong_span_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Initializer:
    """
    Estimates the initial pose without a prior.

    Gaussian sum: one PoseEkf per position that the first ranges allow and per heading, weighted by the
    likelihood of the messages that follow (docs/start.md; ekim2020, section 2.2).

    Parameters
    ----------
    config : InitializerConfig
    world : World
        Without a matcher the heading follows from motion.

    Raises
    ------
    ValueError
        If a config is out of range.

    Examples
    --------
    >>> from locfuse import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 1]), Anchor(2, [8, 0, 1]), Anchor(3, [4, 6, 1])])
    >>> start = Initializer(InitializerConfig(), World(anchors, [Tag(0, [0, 0, 1])]))
    >>> start.state().status.name
    'WAITING'
    """
    def __init__(self, config: InitializerConfig, world: World) -> None: ...
    def __repr__(self) -> str: ...
    def estimator(self) -> PoseEkf:
        """
        The PoseEkf to continue with.

        Raises
        ------
        ValueError
            If the state is not READY.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> None:
        """
        Processes one message.
        """
    def state(self) -> StartState: ...

class KnownLandmark:
    """
    Landmark known to a LandmarkEkf before the first message. Without a covariance (2, 2) [m^2] its position (2,) [m] is exact.
    """
    def __init__(
        self,
        id: typing.SupportsInt | typing.SupportsIndex,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 2]"] | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"] | None:
        """
        Shape (2, 2) [m^2], or None.
        """
    @property
    def id(self) -> int: ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Shape (2,), in world [m].
        """

class LandmarkEstimate:
    """
    Estimate of one landmark by a LandmarkEkf.
    """
    def __repr__(self) -> str: ...
    @property
    def confirmed(self) -> bool:
        """
        Whether it is used to update the pose.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]:
        """
        Shape (2, 2) [m^2]; zero if exact.
        """
    @property
    def id(self) -> int:
        """
        Negative if no observation carried an id.
        """
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Shape (2,), in world [m].
        """
    @property
    def sightings(self) -> int: ...

class LandmarkEkfConfig:
    """
    Noise, gates and behaviour of a LandmarkEkf.
    """

    landmark: RangeBearingConfig
    limits: Limits
    odometry: OdometryConfig
    position: PositionConfig
    def __init__(self) -> None: ...
    @property
    def confirm_within_s(self) -> float:
        """
        A tentative landmark is dropped this long after its first observation [s].
        """
    @confirm_within_s.setter
    def confirm_within_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def correlation_s(self) -> float:
        """
        As of PoseEkfConfig.
        """
    @correlation_s.setter
    def correlation_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_new(self) -> float:
        """
        An observation outside this wider gate of every landmark starts a new one.
        """
    @gate_new.setter
    def gate_new(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        Timeout of odometry [s]: how long the last motion is extrapolated.
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def known(self) -> list[KnownLandmark]:
        """
        List of KnownLandmark that it begins with.
        """
    @known.setter
    def known(self, arg0: collections.abc.Sequence[KnownLandmark]) -> None: ...
    @property
    def max_landmarks(self) -> int: ...
    @max_landmarks.setter
    def max_landmarks(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def min_sightings(self) -> int:
        """
        Number of observations that confirms a tentative landmark.
        """
    @min_sightings.setter
    def min_sightings(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
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

class LandmarkEkf:
    """
    Extended Kalman filter over the pose and the observed landmarks (SLAM).

    An observation that matches no landmark adds a new one to the state.

    Parameters
    ----------
    config : LandmarkEkfConfig
    world : World
        Of which it takes where the landmark sensor sits.
    start : PoseEstimate

    Raises
    ------
    ValueError
        If the config is out of range, the start is not finite or not positive definite, or a landmark
        id is duplicate.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> start = PoseEstimate(0, Pose2(0, 0, 0), np.diag([0.01, 0.01, 0.01]) ** 2)
    >>> ekf = LandmarkEkf(LandmarkEkfConfig(), World(), start)
    >>> ekf.on(RangeBearing(0, landmark=7, range=2.0, bearing=0.0)).verdict.name
    'FUSED'
    >>> tree = ekf.landmarks()[0]
    >>> tree.id, tree.position.round(3).tolist()
    (7, [2.0, 0.0])
    """
    def __copy__(self) -> LandmarkEkf:
        """
        Independent copy.
        """
    def __deepcopy__(self, memo: typing.Any) -> LandmarkEkf:
        """
        Independent copy.
        """
    def __init__(self, config: LandmarkEkfConfig, world: World, start: PoseEstimate) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    def current(self) -> PoseEstimate:
        """
        PoseEstimate at the stamp of the belief.
        """
    @typing.overload
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate propagated to the end of the latest odometry.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> PoseEstimate:
        """
        PoseEstimate propagated to `stamp` [ns], which must not precede the belief.
        """
    def landmarks(self) -> list[LandmarkEstimate]:
        """
        All landmarks, in the order of their creation.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Fuses one message; a message that is not fused leaves the estimator unchanged.
        """
    def on_joint(
        self, sightings: collections.abc.Sequence[RangeBearing], association: Association = ...
    ) -> list[Outcome]:
        """
        Fuses landmark observations of one stamp. One that matches no landmark starts a new one, or is gated if that is uncertain. Returns one Outcome each, NOT_MODELLED if the result would not be finite.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def interventions(self) -> int:
        """
        Number of times a variance was clamped to its bounds.
        """

class HealthState(enum.Enum):
    """
    Trust in an estimate.
    """

    AMBIGUOUS = ...
    DEAD_RECKONING = ...
    DEGRADED = ...
    INITIALIZING = ...
    LOST = ...
    OK = ...

class HealthReason(enum.Enum):
    """
    Reason for a state other than OK.
    """

    LASER_IS_COVERED = ...
    MEASUREMENTS = ...
    NOISE_IS_LARGER = ...
    NONE = ...
    NO_ESTIMATE = ...
    POSITION_IS_VAGUE = ...
    SCANS_DO_NOT_FIT = ...
    SEVERAL_PLACES = ...
    SILENCE = ...
    SOURCE_IS_SILENT = ...
    SOURCE_IS_WRONG = ...

class NamedSource:
    """
    A measurement source.
    """
    @property
    def kind(self) -> Source: ...
    @property
    def name(self) -> int | None:
        """
        Id of the anchor, tag or landmark, or None.
        """

class SourceStatus:
    """
    Statistics of the messages of one source.
    """
    @property
    def accepted(self) -> float:
        """
        Fraction of about the last 32 messages that was fused.
        """
    @property
    def faulty(self) -> float:
        """
        Probability that the source is faulty, given that the pose is right.
        """
    @property
    def fused(self) -> int | None:
        """
        Stamp of the last message fused [ns], or None.
        """
    @property
    def interval(self) -> float:
        """
        Mean interval between messages [s].
        """
    @property
    def last_received(self) -> int:
        """
        Stamp of the last message received [ns].
        """
    @property
    def nis(self) -> float:
        """
        Mean NIS per degree of freedom of inliers.
        """
    @property
    def residual(self) -> float:
        """
        First row of the last innovation.
        """
    @property
    def sigma(self) -> float:
        """
        Standard deviation of that innovation.
        """
    @property
    def source(self) -> NamedSource: ...
    @property
    def test_ratio(self) -> float:
        """
        Last NIS divided by the gate limit; above 1 the message was gated.
        """

class HealthReport:
    """
    Health of an estimate: state, probabilities and protection levels.
    """
    def __repr__(self) -> str: ...
    @property
    def inflation(self) -> float:
        """
        Factor on the covariance from innovations larger than modelled.
        """
    @property
    def protection(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Protection levels of x [m], y [m] and heading [rad], (3,): |error| exceeds them at most with probability `risk`; infinite if no bound is known.
        """
    @property
    def reason(self) -> HealthReason: ...
    @property
    def source(self) -> NamedSource | None:
        """
        Source that the reason refers to, or None.
        """
    @property
    def stamp(self) -> int:
        """
        [ns].
        """
    @property
    def state(self) -> HealthState: ...
    @property
    def within(self) -> float:
        """
        Probability that the position error is below the limit.
        """
    @property
    def wrong(self) -> float:
        """
        Probability that the pose is wrong.
        """

class HealthConfig:
    """
    Priors and thresholds of a Health.
    """
    def __init__(self) -> None: ...
    @property
    def aiding_lost_s(self) -> float:
        """
        Time without a fused measurement until DEAD_RECKONING [s].
        """
    @aiding_lost_s.setter
    def aiding_lost_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def chance_share(self) -> float:
        """
        Fraction of measurements that match a wrong pose by chance.
        """
    @chance_share.setter
    def chance_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def doubt_s(self) -> float:
        """
        Duration above `probability_lost` before the state becomes LOST [s].
        """
    @doubt_s.setter
    def doubt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def exclude_above(self) -> float:
        """
        Ranges of a source with a higher fault probability are not fused.
        """
    @exclude_above.setter
    def exclude_above(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def faulty_s(self) -> float:
        """
        Mean duration of a fault [s].
        """
    @faulty_s.setter
    def faulty_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def faulty_share(self) -> float:
        """
        Fraction of time in which a source is faulty.
        """
    @faulty_share.setter
    def faulty_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def faulty_share_unnamed(self) -> float:
        """
        The same for a sensor of landmarks without ids.
        """
    @faulty_share_unnamed.setter
    def faulty_share_unnamed(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def invalid_s(self) -> float:
        """
        Time without a fused measurement until LOST [s].
        """
    @invalid_s.setter
    def invalid_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def limit_m(self) -> float:
        """
        Position error limit of `within` [m].
        """
    @limit_m.setter
    def limit_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def mean_s_between_losses(self) -> float:
        """
        Mean time between losses of the pose [s].
        """
    @mean_s_between_losses.setter
    def mean_s_between_losses(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def probability_found(self) -> float:
        """
        Probability of a wrong pose below which LOST is cleared.
        """
    @probability_found.setter
    def probability_found(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def probability_lost(self) -> float:
        """
        Probability of a wrong pose above which the state becomes LOST.
        """
    @probability_lost.setter
    def probability_lost(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def risk(self) -> float:
        """
        Probability that an error exceeds its protection level.
        """
    @risk.setter
    def risk(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def wrong_share(self) -> float:
        """
        Fraction of independent outliers.
        """
    @wrong_share.setter
    def wrong_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def wrong_span_m(self) -> float:
        """
        Outliers are uniform over this span [m].
        """
    @wrong_span_m.setter
    def wrong_span_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Health:
    """
    Monitors the trust in an estimate from the outcomes of its measurements.

    Hidden Markov model with one bit for the pose (right or wrong) and one per source (docs/health.md).
    A RecoveringEkf contains one; feed a separate one with the outcomes of any other estimator.

    Parameters
    ----------
    config : HealthConfig

    Raises
    ------
    ValueError
        If a config is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 0]), Anchor(2, [8, 0, 0]), Anchor(3, [4, 6, 0])])
    >>> start = PoseEstimate(0, Pose2(3, 2, 0), 0.01 * np.eye(3))
    >>> ekf = PoseEkf(PoseEkfConfig(), World(anchors, [Tag(0, [0, 0, 0])]), start)
    >>> health = Health(HealthConfig())
    >>> gate = Gate(PoseEkfConfig().range.gate)
    >>> for k in range(30):  # ranges that contradict the pose
    ...     z = Range(k * 100_000_000, 0, 1 + k % 3, 0.1)
    ...     health.record(z, ekf.on(z), gate)
    >>> health.is_lost
    True
    """
    def __init__(self, config: HealthConfig) -> None: ...
    def advance(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        Advances time to `stamp` [ns]; trust decays.
        """
    def record(
        self,
        message: Range | PositionFix | PoseObservation | RangeBearing | Altitude | Heading,
        outcome: Outcome,
        gate: Gate,
    ) -> None:
        """
        Records a measurement and its Outcome under `gate`.
        """
    def report(self, estimate: PoseEstimate) -> HealthReport:
        """
        HealthReport of the PoseEstimate that the recorded measurements belong to.
        """
    def start(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        wrong: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None:
        """
        Restarts at `stamp` [ns] with probability `wrong` of a wrong pose; source statistics are cleared.
        """
    @property
    def is_lost(self) -> bool: ...
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source.
        """
    @property
    def wrong(self) -> float:
        """
        Probability that the pose is wrong.
        """

class WatchReason(enum.Enum):
    """
    Reason why watched poses are not OK.
    """

    CONTRADICTED = ...
    FAR_OFF = ...
    JUMPED = ...
    NONE = ...
    NO_ESTIMATE = ...
    NO_POSE = ...
    SIGMAS_TOO_SMALL = ...
    SILENT = ...
    UNVERIFIED = ...

class WatchReport:
    """
    How far watched poses may be trusted.
    """
    def __init__(self) -> None:
        """
        INITIALIZING: there is no estimate yet.
        """
    def __repr__(self) -> str: ...
    @property
    def error(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        The last pose, carried on by odometry, less the estimate: x [m], y [m], heading [rad], (3,); NaN without both.
        """
    @property
    def judged(self) -> int | None:
        """
        Stamp of the last pose judged [ns], or None.
        """
    @property
    def protection(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Protection levels of x [m], y [m] and heading [rad], (3,): |error| exceeds them at most with probability `risk`; infinite if no bound is known.
        """
    @property
    def reason(self) -> WatchReason:
        """
        WatchReason.
        """
    @property
    def stamp(self) -> int:
        """
        [ns].
        """
    @property
    def state(self) -> HealthState:
        """
        HealthState.
        """
    @property
    def within(self) -> float:
        """
        Probability that position and heading errors are below their limits.
        """
    @property
    def wrong(self) -> float:
        """
        1 - within.
        """

class PoseWatchConfig:
    """
    Limits and models of a PoseWatch.
    """
    def __init__(self) -> None: ...
    @property
    def health(self) -> HealthConfig:
        """
        HealthConfig: limits and probabilities.
        """
    @health.setter
    def health(self, arg0: HealthConfig) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        Odometry timeout [s].
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def limits(self) -> Limits:
        """
        Limits.
        """
    @limits.setter
    def limits(self, arg0: Limits) -> None: ...
    @property
    def odometry(self) -> OdometryConfig:
        """
        OdometryConfig.
        """
    @odometry.setter
    def odometry(self, arg0: OdometryConfig) -> None: ...
    @property
    def pose(self) -> PoseConfig:
        """
        PoseConfig: sigmas of the poses.
        """
    @pose.setter
    def pose(self, arg0: PoseConfig) -> None: ...

class PoseWatch:
    """
    Judges the poses of another localizer by an estimate without them.

    Derivation: docs/watch.md.

    Raises
    ------
    ValueError
        If a setting is out of range.
    """

    max_heading_error: typing.ClassVar[float] = 0.5
    def __init__(self, config: PoseWatchConfig) -> None: ...
    @typing.overload
    def on(self, u: Velocity) -> None:
        """
        Takes odometry that the estimator has taken.
        """
    @typing.overload
    def on(self, u: Increment) -> None: ...
    @typing.overload
    def on(self, z: PoseObservation, estimate: PoseEstimate, health: HealthReport) -> Outcome:
        """
        Takes a pose, with the PoseEstimate at its stamp and the HealthReport of that. Returns an Outcome: IGNORED, WATCHED, with the numbers of its innovation.
        """
    def report(self, estimate: PoseEstimate, health: HealthReport) -> WatchReport:
        """
        WatchReport at the stamp of a PoseEstimate.
        """

class RecoveringEkfConfig:
    """
    Filter, initialization and health of a RecoveringEkf.
    """

    health: HealthConfig
    def __init__(self) -> None: ...
    @property
    def restart(self) -> bool:
        """
        Whether to relocalize while lost.
        """
    @restart.setter
    def restart(self, arg0: bool) -> None: ...
    @property
    def sigma_start_height(self) -> float:
        """
        Its sigma [m].
        """
    @sigma_start_height.setter
    def sigma_start_height(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def start(self) -> InitializerConfig:
        """
        InitializerConfig of the search, with the PoseEkfConfig of the filter.
        """
    @start.setter
    def start(self, arg0: InitializerConfig) -> None: ...
    @property
    def start_height(self) -> float:
        """
        Height at which an AirEkf begins [m].
        """
    @start_height.setter
    def start_height(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def tracker(self) -> LandmarkEkfConfig | TagTriangleEkfConfig | AirEkfConfig | None:
        """
        LandmarkEkfConfig, TagTriangleEkfConfig or AirEkfConfig of another filter, or None.
        """
    @tracker.setter
    def tracker(
        self, arg0: LandmarkEkfConfig | TagTriangleEkfConfig | AirEkfConfig | None
    ) -> None: ...

class RecoveringEkf:
    """
    Filter that initializes itself, detects when it is lost, and relocalizes
    (docs/health.md): a PoseEkf, or what `RecoveringEkfConfig.tracker` asks for.

    During initialization and while lost, landmark observations of one stamp, ranges, fixes and poses
    start hypotheses until a single one remains.

    Parameters
    ----------
    config : RecoveringEkfConfig
    world : World
        With a matcher, scans give the heading during a search.

    Raises
    ------
    ValueError
        If a config is out of range.

    Examples
    --------
    >>> from locfuse import *
    >>> posts = LandmarkMap([Landmark(0, [3, 0]), Landmark(1, [0, 4]), Landmark(2, [-2, 1])])
    >>> ekf = RecoveringEkf(RecoveringEkfConfig(), World(landmarks=LandmarkSensor(posts)))
    >>> ekf.is_lost
    True
    >>> _ = ekf.on_joint([RangeBearing(0, None, 3.0, 0.0), RangeBearing(0, None, 4.0, 1.5708),
    ...                   RangeBearing(0, None, 2.2361, 2.6779)])
    >>> ekf.is_lost, abs(round(ekf.state().hypotheses[0].estimate.pose.x, 2))
    (False, 0.0)
    """
    def __init__(self, config: RecoveringEkfConfig, world: World) -> None: ...
    def __repr__(self) -> str: ...
    def current(self) -> PoseEstimate:
        """
        PoseEstimate at the stamp of the belief. Raises RuntimeError until it has started.
        """
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate propagated to the end of the latest odometry. Raises RuntimeError until it has started.
        """
    def estimator(self) -> PoseEkf | None:
        """
        Copy of the PoseEkf, or None before the first start and with another tracker. While lost, the filter at the previous pose.
        """
    def health(self) -> HealthReport:
        """
        HealthReport of the estimate.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Processes one message. Its outcome is IGNORED until tracking starts.
        """
    def on_joint(
        self, sightings: collections.abc.Sequence[RangeBearing], association: Association = ...
    ) -> list[Outcome]:
        """
        Processes landmark observations of one stamp. Returns one Outcome each.
        """
    def start_at(self, start: PoseEstimate) -> None:
        """
        Tracks from a PoseEstimate.

        Raises
        ------
        ValueError
            As a PoseEkf does.
        """
    def start_from(self, found: Initializer) -> None:
        """
        Tracks from the pose that an Initializer has found.

        Raises
        ------
        ValueError
            Unless it is READY.
        """
    def start_with(self, ekf: PoseEkf) -> None:
        """
        Tracks with a PoseEkf that is already initialized.
        """
    def state(self) -> StartState:
        """
        READY while tracking; otherwise the progress of the search with its hypotheses.
        """
    def tracker(self) -> PoseEkf | LandmarkEkf | TagTriangleEkf | AirEkf | None:
        """
        Copy of the filter of any kind, or None before the first start.
        """
    def watched(self) -> WatchReport | None:
        """
        WatchReport of the poses that it watches, or None unless it watches poses.
        """
    @property
    def alarms(self) -> int:
        """
        Number of times the estimate was declared lost.
        """
    @property
    def config(self) -> RecoveringEkfConfig: ...
    @property
    def is_lost(self) -> bool:
        """
        Whether there is no trustworthy estimate.
        """
    @property
    def restarts(self) -> int:
        """
        Number of relocalizations.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source.
        """
    @property
    def world(self) -> World: ...

class LikelihoodFieldConfig:
    """
    Likelihood field of beam end points; docs/models/particles.md.
    """
    def __init__(self) -> None: ...
    @property
    def clutter_per_m(self) -> float: ...
    @clutter_per_m.setter
    def clutter_per_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_range_m(self) -> float: ...
    @max_range_m.setter
    def max_range_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def random_share(self) -> float: ...
    @random_share.setter
    def random_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_hit_m(self) -> float: ...
    @sigma_hit_m.setter
    def sigma_hit_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def unknown_per_m(self) -> float: ...
    @unknown_per_m.setter
    def unknown_per_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class BeamModelConfig:
    """
    Beam model: weights of a mixture over the range; docs/models/scans.md.
    """
    @staticmethod
    def gaussian_and_no_return() -> BeamModelConfig:
        """
        Mixture of a Gaussian and beams without return (zhang).
        """
    def __init__(self) -> None: ...
    @property
    def hit(self) -> float: ...
    @hit.setter
    def hit(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_range_m(self) -> float: ...
    @max_range_m.setter
    def max_range_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def maximum(self) -> float: ...
    @maximum.setter
    def maximum(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def random(self) -> float: ...
    @random.setter
    def random(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def shorter(self) -> float: ...
    @shorter.setter
    def shorter(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def shorter_per_m(self) -> float: ...
    @shorter_per_m.setter
    def shorter_per_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_hit_m(self) -> float: ...
    @sigma_hit_m.setter
    def sigma_hit_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class ScanLikelihood(enum.Enum):
    """
    Model of a scan's likelihood.
    """

    BEAMS = ...
    FIELD = ...

class ScanProposal(enum.Enum):
    """
    What particles are drawn from before a scan weighs them.
    """

    LINE_EKF = ...
    LINE_EKF_PAPER = ...
    ODOMETRY = ...
    SCAN_MATCH = ...

class MclConfig:
    """
    Noise and behaviour of an Mcl.
    """

    beam_model: BeamModelConfig
    field: LikelihoodFieldConfig
    health: HealthConfig
    landmark: RangeBearingConfig
    likelihood: ScanLikelihood
    limits: Limits
    odometry: OdometryConfig
    pose: PoseConfig
    position: PositionConfig
    proposal: ScanProposal
    range: RangeConfig
    def __init__(self) -> None: ...
    @property
    def beams(self) -> int: ...
    @beams.setter
    def beams(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def bin_headings(self) -> int: ...
    @bin_headings.setter
    def bin_headings(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def bin_m(self) -> float: ...
    @bin_m.setter
    def bin_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def effective_share(self) -> float: ...
    @effective_share.setter
    def effective_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float: ...
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def independent_beams(self) -> float: ...
    @independent_beams.setter
    def independent_beams(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def independent_beams_searching(self) -> float: ...
    @independent_beams_searching.setter
    def independent_beams_searching(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def kidnapping_probability(self) -> float: ...
    @kidnapping_probability.setter
    def kidnapping_probability(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def kld_error(self) -> float: ...
    @kld_error.setter
    def kld_error(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def kld_quantile(self) -> float: ...
    @kld_quantile.setter
    def kld_quantile(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_particles(self) -> int: ...
    @max_particles.setter
    def max_particles(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def min_explained(self) -> float: ...
    @min_explained.setter
    def min_explained(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def min_particles(self) -> int: ...
    @min_particles.setter
    def min_particles(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def most_drop(self) -> float: ...
    @most_drop.setter
    def most_drop(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def most_gain(self) -> float: ...
    @most_gain.setter
    def most_gain(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def outlier_share(self) -> float: ...
    @outlier_share.setter
    def outlier_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def probability_ready(self) -> float: ...
    @probability_ready.setter
    def probability_ready(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def resample_below(self) -> float: ...
    @resample_below.setter
    def resample_below(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def scout_draws(self) -> int: ...
    @scout_draws.setter
    def scout_draws(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def scouts(self) -> int: ...
    @scouts.setter
    def scouts(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def seed(self) -> int: ...
    @seed.setter
    def seed(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def sigma_heading_ready_rad(self) -> float: ...
    @sigma_heading_ready_rad.setter
    def sigma_heading_ready_rad(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
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
    @property
    def sigma_map_m(self) -> float: ...
    @sigma_map_m.setter
    def sigma_map_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_map_rad(self) -> float: ...
    @sigma_map_rad.setter
    def sigma_map_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_widest_m(self) -> float: ...
    @sigma_widest_m.setter
    def sigma_widest_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_xy_ready_m(self) -> float: ...
    @sigma_xy_ready_m.setter
    def sigma_xy_ready_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def spacing_heading_rad(self) -> float: ...
    @spacing_heading_rad.setter
    def spacing_heading_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def spacing_m(self) -> float: ...
    @spacing_m.setter
    def spacing_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def threads(self) -> int: ...
    @threads.setter
    def threads(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def watch_poses(self) -> bool:
        """
        Whether poses are judged by a PoseWatch, and do not weigh particles.
        """
    @watch_poses.setter
    def watch_poses(self, arg0: bool) -> None: ...

class Mcl:
    """
    Monte Carlo localization on a grid map.

    Scans weight particles by the likelihood field or the beam model; ranges, positions, poses and
    landmarks can weight them, too (docs/models/particles.md). Initially they cover all free cells.

    Parameters
    ----------
    config : MclConfig
    world : World
        With a grid.
    start : int
        Stamp [ns].

    Raises
    ------
    ValueError
        If the config is out of range, or the grid is missing or has no free or no occupied cell.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import LaserGeometry, LaserScan, Mcl, MclConfig, OccupancyGrid, Pose2, World
    >>> cells = np.full((60, 80), 0, dtype=np.int8)  # a room of 4 x 3 m with a box in a corner
    >>> cells[[0, -1], :] = cells[:, [0, -1]] = cells[:20, :30] = 100
    >>> mcl = Mcl(MclConfig(), World(grid=OccupancyGrid(cells, resolution=0.05)))
    >>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
    >>> mcl.on(LaserScan(0, around, [0.9, 0.9, 2.9, 0.9])).verdict.name
    'FUSED'
    >>> mcl.ready
    False
    """
    def __copy__(self) -> Mcl:
        """
        Independent copy.
        """
    def __deepcopy__(self, memo: typing.Any) -> Mcl: ...
    def __init__(
        self, config: MclConfig, world: World, start: typing.SupportsInt | typing.SupportsIndex = 0
    ) -> None: ...
    def __repr__(self) -> str: ...
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate of the likeliest cluster, propagated to the end of the latest odometry.
        """
    def health(self) -> HealthReport:
        """
        HealthReport of the estimate; docs/health.md.
        """
    def inject(
        self, pose: PoseEstimate, share: typing.SupportsFloat | typing.SupportsIndex = 1.0
    ) -> None:
        """
        Replaces a fraction of the particles, evenly spread, by draws from a PoseEstimate of another localizer, whose stamp must not precede the last message.

        Raises
        ------
        ValueError
            If the covariance is not positive definite, the stamp is too early, or not 0 < share <= 1.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Processes one message.
        """
    def overall_estimate(self) -> PoseEstimate:
        """
        PoseEstimate with the covariance of all particles about their mean, over all clusters.
        """
    def start_anywhere(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        Reinitializes the particles uniformly over free space.
        """
    def start_at(self, hypotheses: collections.abc.Sequence[PoseHypothesis]) -> None:
        """
        Reinitializes the particles around a list of PoseHypothesis, such as those of an Initializer.

        Raises
        ------
        ValueError
            On an empty list or numbers that are not finite.
        """
    def start_with(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        particles: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> None:
        """
        Reinitializes with particles, float64 (n, 4) as in `particles`; the weights need not sum to 1.

        Raises
        ------
        ValueError
            On another shape, on numbers that are not finite, on weights that are negative or all 0.
        """
    def watched(self) -> WatchReport | None:
        """
        WatchReport of the poses that it watches, or None unless it watches poses.
        """
    @property
    def explained(self) -> float:
        """
        Fraction of the last scan's returns that end at a wall.
        """
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        Clusters of particles as a list of PoseHypothesis, likeliest first.
        """
    @property
    def particles(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        float64 (n, 4): x, y [m], heading [rad] in world, weight.
        """
    @property
    def ready(self) -> bool:
        """
        Whether one cluster is almost certain.
        """
    @property
    def sigma_hit(self) -> float:
        """
        Distance of end points from walls, estimated from scans (standard deviation) [m].
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source that weights particles.
        """
    @property
    def used_share(self) -> float:
        """
        Fraction of the last measurement's information that was used.
        """

class InjectionReason(enum.Enum):
    """
    Reason to distrust scans.
    """

    ELSEWHERE = ...
    NONE = ...
    UNCERTAIN = ...

class SwitchingMclConfig:
    """
    Thresholds at which UWB takes over from scans.
    """
    def __init__(self) -> None: ...
    @property
    def doubt_s(self) -> float:
        """
        Minimum duration of distrust before UWB takes over [s].
        """
    @doubt_s.setter
    def doubt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def elsewhere_m(self) -> float:
        """
        Distance from the UWB pose, beyond three sigmas, above which scans are distrusted [m].
        """
    @elsewhere_m.setter
    def elsewhere_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def elsewhere_rad(self) -> float:
        """
        The same for the heading [rad].
        """
    @elsewhere_rad.setter
    def elsewhere_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def share(self) -> float:
        """
        Fraction of the particles that is replaced.
        """
    @share.setter
    def share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sure_m(self) -> float:
        """
        Particle spread below which scans are trusted again [m].
        """
    @sigma_sure_m.setter
    def sigma_sure_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sure_rad(self) -> float: ...
    @sigma_sure_rad.setter
    def sigma_sure_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_unsure_m(self) -> float:
        """
        Particle spread along the worst direction above which scans are distrusted [m].
        """
    @sigma_unsure_m.setter
    def sigma_unsure_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_unsure_rad(self) -> float:
        """
        The same for the heading [rad].
        """
    @sigma_unsure_rad.setter
    def sigma_unsure_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_age_s(self) -> float:
        """
        Maximum time since the last fused range or fix [s].
        """
    @uwb_age_s.setter
    def uwb_age_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_nis(self) -> float:
        """
        Maximum mean NIS per row of the last ranges or fixes.
        """
    @uwb_nis.setter
    def uwb_nis(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_sigma_m(self) -> float:
        """
        Maximum position sigma of a usable UWB pose [m].
        """
    @uwb_sigma_m.setter
    def uwb_sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_sigma_rad(self) -> float:
        """
        Maximum heading sigma of a usable UWB pose [rad].
        """
    @uwb_sigma_rad.setter
    def uwb_sigma_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Injection:
    """
    Event at which UWB took over from scans.
    """
    def __repr__(self) -> str: ...
    @property
    def after(self) -> PoseEstimate:
        """
        PoseEstimate after, from UWB.
        """
    @property
    def before(self) -> PoseEstimate:
        """
        PoseEstimate before, with the covariance of all particles.
        """
    @property
    def reason(self) -> InjectionReason: ...
    @property
    def stamp(self) -> int: ...

class SwitchingMcl:
    """
    Mcl that UWB relocalizes (celan2017, sections III.C and V.B).

    Scans alone determine the pose while they are trusted; otherwise the pose from UWB and odometry
    becomes the particles' belief (docs/models/particles.md). Ranges and fixes go to a
    RecoveringEkf that runs in parallel, initializes itself and detects when it is lost.

    Parameters
    ----------
    config : SwitchingMclConfig
    mcl : Mcl
        Copied, as is `uwb`.
    uwb : RecoveringEkf

    Raises
    ------
    ValueError
        If the config is out of range, or UWB could take over endlessly: `sigma_sure_*` must be below
        `sigma_unsure_*`, and a usable UWB pose must satisfy `sigma_sure_*`.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> cells = np.full((60, 80), 0, dtype=np.int8)
    >>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
    >>> grid = OccupancyGrid(cells, resolution=0.05)  # a room of 4 x 3 m
    >>> mcl = Mcl(MclConfig(), World(grid=grid))  # anywhere in it
    >>> uwb = RecoveringEkf(RecoveringEkfConfig(), World())
    >>> uwb.start_at(PoseEstimate(0, Pose2(1.0, 1.0, 0.0), np.diag([0.1, 0.1, 0.1]) ** 2))
    >>> switching = SwitchingMcl(SwitchingMclConfig(), mcl, uwb)
    >>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
    >>> for second in range(4):
    ...     _ = switching.on(Velocity(second * 10**9, 0.0, 0.0))
    ...     _ = switching.on(PositionFix(second * 10**9, [1.0, 1.0], 0.01 * np.eye(2)))
    ...     _ = switching.on(LaserScan(second * 10**9, around, [2.95, 1.95, 0.95, 0.95]))
    >>> [(i.reason.name, i.stamp // 10**9) for i in switching.injections]
    [('UNCERTAIN', 2)]
    """
    def __copy__(self) -> SwitchingMcl:
        """
        Independent copy.
        """
    def __deepcopy__(self, memo: typing.Any) -> SwitchingMcl: ...
    def __init__(self, config: SwitchingMclConfig, mcl: Mcl, uwb: RecoveringEkf) -> None: ...
    def __repr__(self) -> str: ...
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate of the likeliest cluster, propagated to the end of the latest odometry.
        """
    def health(self) -> HealthReport:
        """
        HealthReport of the estimate; docs/health.md.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Processes one message. Ranges and fixes go to the UWB filter, all others weight particles.
        """
    def watched(self) -> WatchReport | None:
        """
        WatchReport of the poses that it watches, or None unless it watches poses.
        """
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        Clusters of particles as a list of PoseHypothesis, likeliest first.
        """
    @property
    def injections(self) -> list[Injection]:
        """
        List of Injection, one per takeover by UWB.
        """
    @property
    def mcl(self) -> Mcl:
        """
        Copy of the Mcl.
        """
    @property
    def particles(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        float64 (n, 4): x, y [m], heading [rad] in world, weight.
        """
    @property
    def ready(self) -> bool:
        """
        Whether one cluster is almost certain.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source that weights particles.
        """
    @property
    def uwb(self) -> RecoveringEkf:
        """
        Copy of the UWB filter.
        """
    @property
    def uwb_nis(self) -> float:
        """
        Mean NIS per row of the last ranges or fixes: 1 if the UWB filter is consistent.
        """

class ClockJump(enum.Enum):
    """
    Reaction to a backward jump of the message clock.
    """

    CONTINUE = ...
    REFUSE = ...
    RESET = ...

class MessageLog:
    """
    Recorded messages, added column by column.

    Every `add_...` takes arrays of equal length; `arrival_ns`, where given, is when each message
    reaches the estimator, otherwise it arrives when it takes effect. A row that is not valid raises
    ValueError, names the row, and nothing is added; ids and stamps that are not integers raise
    TypeError. A log that another thread adds to, sorts or replays raises RuntimeError; several threads
    may replay it at once.
    """
    def __init__(self) -> None: ...
    def __len__(self) -> int: ...
    def add_altitudes(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        height: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Heights (n,) [m] of an altimeter above z = 0 of the world.
        """
    def add_headings(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        heading: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        is_course: typing.Annotated[numpy.typing.ArrayLike, numpy.bool] | None = None,
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Headings (n,) [rad] of the body in world, or courses of its antenna.
        """
    def add_increments(
        self,
        begin_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        motion: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
        variance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        origin: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
        again: typing.Annotated[numpy.typing.ArrayLike, numpy.bool] | None = None,
    ) -> None:
        """
        Motions (n, 3) from begin_ns to stamp_ns: dx, dy [m], dheading [rad] in the body frame at begin_ns; their variances (n, 3), or those of a row of NaN, default to those of the model. `origin` and `again` as of MadeOdometry.
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
        Poses (n, 3): x, y [m], heading [rad], with their sigmas. Both -1 or both 0: unknown; 1000 and more: not measured.
        """
    def add_positions(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
        tag: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] | None = None,
    ) -> None:
        """
        Positions (n, 2) [m] in world with one sigma (n,) [m] each, of the antenna or of the tags with ids (n,); a negative id is the antenna. Sigma -1 or 0: unknown; 1000 and more: not measured.
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
    def add_samples(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        angular_rate: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        specific_force: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Of an inertial sensor: (n,), (n, 3) [rad/s] and (n, 3) [m/s^2].
        """
    def add_scans(
        self,
        scans: collections.abc.Sequence[LaserScan],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None: ...
    def add_sightings(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        landmark: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        range: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        bearing: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma_range: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        sigma_bearing: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
        elevation: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        sigma_elevation: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
    ) -> None:
        """
        Landmark observations: id (-1: unknown), range [m], bearing and, from a body that flies, elevation [rad] (NaN: not measured), with their sigmas.
        """
    def add_velocities(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        forward: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        turn_rate: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
        left: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
    ) -> None: ...
    def sort(self) -> None:
        """
        Sorts by arrival; the sort is stable.
        """

class MadeMotion:
    """
    Motion that an OdometryTimeline made.
    """
    @property
    def again(self) -> bool:
        """
        Whether it is in place of an earlier one of that origin.
        """
    @property
    def increment(self) -> Increment: ...
    @property
    def origin(self) -> int:
        """
        Number of the message that ended it, in order of arrival.
        """
    @property
    def slipped(self) -> bool:
        """
        Whether gyro and wheels contradict.
        """

class MadeOdometry:
    """
    Motions made of a log, as columns.
    """
    def __len__(self) -> int: ...
    @property
    def again(self) -> numpy.typing.NDArray[numpy.bool]:
        """
        Whether a row is in place of an earlier one of that origin, (n,).
        """
    @property
    def arrival_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        When they were made, (n,).
        """
    @property
    def begin_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        (n,).
        """
    @property
    def motion(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        dx, dy [m], dheading [rad], (n, 3).
        """
    @property
    def origin(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Place in the log of the message that ended each, (n,).
        """
    @property
    def slipped(self) -> numpy.typing.NDArray[numpy.bool]:
        """
        Whether gyro and wheels contradict, (n,).
        """
    @property
    def stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Where they end, (n,).
        """
    @property
    def variance(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Of the motion, (n, 3); NaN where the model's noise holds.
        """

class OdometryTimeline:
    """
    Odometry of wheels with a gyro, of a laser's scans, or of both, from messages as they arrive.

    They count in order of stamps: after a late message the motions from it on are made again.

    Parameters
    ----------
    gyro : GyroOdometryConfig, optional
        A turn is by the gyro, too.
    scans : ScanOdometryConfig, optional
        Scans make the odometry; wheels only show where each fit begins.
    odometry : OdometryConfig
        Noise of the wheels beside scans.
    history : int
        Maximum delay of a message [ns].
    clock_jump : ClockJump
        Reaction to a backward jump of the clock; after CONTINUE the odometry starts anew.
    max_messages : int
        Maximum number of messages kept for reordering, at least 512.

    Raises
    ------
    ValueError
        If there is neither a gyro nor scans, or an option is out of range.

    Examples
    --------
    >>> from locfuse import Pose2
    >>> from locfuse.core import GyroOdometryConfig, Imu, Increment, OdometryTimeline
    >>> timeline = OdometryTimeline(gyro=GyroOdometryConfig())
    >>> timeline.on(Imu(0, [0.0, 0.0, 0.2]))
    []
    >>> [made.again for made in timeline.on(Increment(0, 10**8, Pose2(0.1, 0.0, 0.02)))]
    [False]
    >>> [made.again for made in timeline.on(Imu(5 * 10**7, [0.0, 0.0, 0.3]))]  # it comes late
    [True]
    """
    def __copy__(self) -> OdometryTimeline: ...
    def __init__(
        self,
        gyro: GyroOdometryConfig | None = None,
        scans: ScanOdometryConfig | None = None,
        odometry: OdometryConfig = ...,
        history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
        clock_jump: ClockJump = ...,
        max_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
    ) -> None: ...
    def of_log(self, log: MessageLog) -> MadeOdometry:
        """
        Takes a sorted log; returns the MadeOdometry of it.
        """
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> list[MadeMotion]:
        """
        Takes a message; returns the MadeMotion that it ends, if it does, and those made again.

        Raises
        ------
        ValueError
            If the message is not valid; it is discarded.
        """
    @property
    def outcome(self) -> Outcome:
        """
        Outcome of the last message: FUSED, IGNORED if it waits or is of no use, STALE if it was too late.
        """

class LiveMcl:
    """
    Mcl fed with live messages and scans as they arrive.

    They wait until odometry has come that far, at most 0.25 s or as late as scans have been; what is
    later still is fused at its stamp, to the same bits as if it had been in time.

    Parameters
    ----------
    mcl : Mcl or SwitchingMcl
        Copied.
    history : int
        Maximum delay of a message [ns]; older ones are STALE.
    clock_jump : ClockJump
        Reaction to a backward jump of the message clock.
    max_messages : int
        Maximum number of messages kept for reordering, at least 512.

    Raises
    ------
    ValueError
        If an option is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import *
    >>> cells = np.zeros((40, 40), dtype=np.int8)
    >>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
    >>> live = LiveMcl(Mcl(MclConfig(), World(grid=OccupancyGrid(cells, resolution=0.05))))
    >>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
    >>> live.on(Velocity(0, 0.0, 0.0)), live.on(LaserScan(5 * 10**7, around, [0.9, 0.9, 0.9, 0.9]))
    ([], [])
    >>> len(live.on(Velocity(10**8, 0.0, 0.0)))  # the scan had waited for that
    1
    """
    @typing.overload
    def __init__(
        self,
        mcl: Mcl,
        history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
        clock_jump: ClockJump = ...,
        max_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
    ) -> None: ...
    @typing.overload
    def __init__(
        self,
        mcl: SwitchingMcl,
        history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
        clock_jump: ClockJump = ...,
        max_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate of the likeliest cluster, propagated to the end of the latest odometry.
        """
    def finish(self) -> list[PoseEstimate]:
        """
        Uses all messages that wait, and returns as `on` does.
        """
    def go_on_from(self, before: LiveMcl) -> list[PoseEstimate]:
        """
        Takes the messages that wait in another, whose pose this one has; returns as `on` does.
        """
    def health(self) -> HealthReport:
        """
        HealthReport of the estimate; docs/health.md.
        """
    @typing.overload
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> list[PoseEstimate]:
        """
        Takes a message or a scan; returns a PoseEstimate for each scan whose turn it is now.

        Raises
        ------
        ValueError
            If the message is not valid; it is discarded.
        """
    @typing.overload
    def on(self, motions: collections.abc.Sequence[MadeMotion]) -> list[PoseEstimate]:
        """
        Takes the motions that one message changed, of an OdometryTimeline; returns as above.
        """
    def watched(self) -> WatchReport | None:
        """
        WatchReport of the poses that it watches, or None unless it watches poses.
        """
    @property
    def dropped_messages(self) -> int:
        """
        Messages inside the history that were dropped because there were too many.
        """
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        Clusters of particles as a list of PoseHypothesis, likeliest first.
        """
    @property
    def injections(self) -> list[Injection]:
        """
        List of Injection, one per takeover by UWB.
        """
    @property
    def jumps(self) -> int:
        """
        Number of backward clock jumps handled by RESET or CONTINUE.
        """
    @property
    def particles(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        float64 (n, 4): x, y [m], heading [rad] in world, weight.
        """
    @property
    def ready(self) -> bool:
        """
        Whether one cluster is almost certain.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source that weights particles.
        """

class Live:
    """
    RecoveringEkf fed with live messages in order of arrival.

    It searches until a single hypothesis remains; from then on late messages are fused at their stamp.
    A log fed in order of arrival gives the estimates of `find_start` and `replay` bit for bit, if no
    message was later than `patience` during the search.

    Parameters
    ----------
    estimator : RecoveringEkf
        If it has started, tracking begins at once.
    history : int
        Maximum delay of a message while tracking [ns].
    clock_jump : ClockJump
        Reaction to a backward jump of the message clock.
    max_messages : int
        Maximum number of messages kept for reordering, at least 512.
    patience : int
        Maximum delay of a message while searching [ns].

    Raises
    ------
    ValueError
        If an option is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> live = Live(RecoveringEkf(RecoveringEkfConfig(), World()))
    >>> live.start_at(PoseEstimate(0, Pose2(1, 2, 0), 0.01 * np.eye(3)))
    >>> live.on(PositionFix(0, [1.05, 2.0], 0.01 * np.eye(2))).verdict.name
    'FUSED'
    >>> live.current().stamp
    0
    """
    def __init__(
        self,
        estimator: RecoveringEkf,
        history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
        clock_jump: ClockJump = ...,
        max_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
        patience: typing.SupportsInt | typing.SupportsIndex = 250000000,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def current(self) -> PoseEstimate:
        """
        PoseEstimate at the stamp of the last message. Raises RuntimeError while searching.
        """
    def current_in_space(self) -> AirEstimate | None:
        """
        AirEstimate at the stamp of the last message, or None of a filter in the plane. Raises RuntimeError while searching.
        """
    def enable(self, source: Source, enabled: bool) -> None:
        """
        Enables or disables a Source; messages of a disabled source are IGNORED.
        """
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate propagated to the end of the latest odometry. Raises RuntimeError while searching.
        """
    def estimate_in_space(self) -> AirEstimate | None:
        """
        The same propagated to the end of the latest odometry.
        """
    def health(self) -> HealthReport:
        """
        HealthReport of the estimate.
        """
    @typing.overload
    def on(self, motions: collections.abc.Sequence[MadeMotion]) -> Outcome:
        """
        Processes the motions that one message changed, of an OdometryTimeline; returns the Outcome of the first. STALE where one that is made again is no longer kept.
        """
    @typing.overload
    def on(
        self,
        message: Velocity
        | Increment
        | Range
        | PositionFix
        | PoseObservation
        | RangeBearing
        | Altitude
        | LaserScan
        | Imu
        | Heading,
    ) -> Outcome:
        """
        Processes a message and returns its Outcome.

        IGNORED while searching, from a disabled source and of a scan, which only the search uses; STALE if
        too late.

        Raises
        ------
        ValueError
            If the message is not valid; it is discarded.
        """
    def relocalize(self) -> None:
        """
        Discards the pose and searches again.
        """
    def reset(self) -> None:
        """
        Restores the state after construction.
        """
    def search(self) -> StartState:
        """
        Progress of the search with its hypotheses.
        """
    def start_at(self, start: PoseEstimate) -> None:
        """
        Discards the current state and tracks from a PoseEstimate.
        """
    def watched(self) -> WatchReport | None:
        """
        WatchReport of the poses that it watches, or None unless it watches poses.
        """
    @property
    def dropped_messages(self) -> int:
        """
        Messages inside the history that were dropped because there were too many.
        """
    @property
    def errors(self) -> list[CalibratedError]:
        """
        A CalibratedError for each error that is a state of a PoseEkf.
        """
    @property
    def is_tracking(self) -> bool: ...
    @property
    def jumps(self) -> int:
        """
        Number of backward clock jumps handled by RESET or CONTINUE.
        """
    @property
    def landmarks(self) -> list[LandmarkEstimate]:
        """
        The map of a LandmarkEkf: one LandmarkEstimate per landmark.
        """
    @property
    def restarts(self) -> int:
        """
        Number of relocalizations after being lost.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source.
        """

class RunLog:
    """
    Result of a replay, as columns.
    """
    def __repr__(self) -> str: ...
    def noise_factor(self, source: Source) -> float:
        """
        Factor on the variances of a Source at the end of the log; 1 unless adaptive.
        """
    @property
    def alarms(self) -> int:
        """
        Number of times the estimate was declared lost.
        """
    @property
    def covariances(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n, 3, 3).
        """
    @property
    def covariances_in_space(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Of (x, y, heading, height), (n, 4, 4); else empty.
        """
    @property
    def dof(self) -> numpy.typing.NDArray[numpy.int64]: ...
    @property
    def dropped_messages(self) -> int:
        """
        Messages inside the history that were dropped because there were too many.
        """
    @property
    def errors(self) -> list[CalibratedError]:
        """
        A CalibratedError for each error that is a state, at the end of the log.
        """
    @property
    def health_reason(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthReason, (k,).
        """
    @property
    def health_source(self) -> list[NamedSource | None]:
        """
        Source that the reason refers to, or None; k items.
        """
    @property
    def health_stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of the health reports, (k,).
        """
    @property
    def health_state(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthState, (k,).
        """
    @property
    def heights(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Heights of the estimates of an AirEkf [m], (n,); else empty.
        """
    @property
    def interventions(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Number of variances clamped to their bounds, per message.
        """
    @property
    def jumps(self) -> int:
        """
        Number of backward clock jumps; the estimates are those after the last.
        """
    @property
    def landmarks(self) -> list[LandmarkEstimate]:
        """
        The map of a LandmarkEkf, a LandmarkEstimate each, at the end of the log.
        """
    @property
    def last(self) -> PoseEstimate:
        """
        The estimate at the end of the log.
        """
    @property
    def limit(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Largest `nis` that the gate passes, or distance that conditioning allows [m].
        """
    @property
    def log_likelihood(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def nis(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def orientation_covariances(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Of their errors, rotations about the axes of the world [rad^2], (n, 3, 3); else empty.
        """
    @property
    def orientations(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Unit quaternions (w, x, y, z) from body to world of an inertial AirEkf, (n, 4); else empty.
        """
    @property
    def poses(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        x, y, heading, (n, 3).
        """
    @property
    def protection(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Protection levels of x, y [m] and heading [rad], (k, 3).
        """
    @property
    def reason(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Reason, why it was not fused.
        """
    @property
    def residual(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def restarts(self) -> int:
        """
        Number of relocalizations.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        One SourceStatus per source, at the end of the log.
        """
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
    @property
    def watched(self) -> list[WatchReport]:
        """
        A WatchReport with each health report where poses are watched; else empty.
        """
    @property
    def within(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the position error is below the limit, (k,).
        """
    @property
    def wrong(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the pose is wrong, (k,).
        """

class StartStep:
    """
    Change of state during initialization.
    """
    @property
    def stamp(self) -> int:
        """
        [ns].
        """
    @property
    def state(self) -> StartState: ...

class StartRun:
    """
    Course of an initialization.
    """
    @property
    def steps(self) -> list[StartStep]:
        """
        One step per change of status or of the number of hypotheses.
        """
    @property
    def used_until(self) -> int:
        """
        Messages that take effect up to this stamp [ns] were used.
        """

class LocalizeReport:
    """
    Pose after the turn of a scan, as a robot has it.
    """
    @property
    def arrival(self) -> int | None:
        """
        Of the message that gave the scan its turn [ns]; None if the log ended first.
        """
    @property
    def estimate(self) -> PoseEstimate:
        """
        PoseEstimate.
        """
    @property
    def ready(self) -> bool:
        """
        Whether one cluster was almost certain.
        """

class LocalizeRun:
    """
    Result of a localization on a map, as columns.
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
    def explained(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Fraction of the scan's returns that end at a wall, (n,).
        """
    @property
    def health_reason(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthReason, (k,).
        """
    @property
    def health_source(self) -> list[NamedSource | None]:
        """
        Source that the reason refers to, or None; k items.
        """
    @property
    def health_stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of the health reports, (k,).
        """
    @property
    def health_state(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthState, (k,).
        """
    @property
    def limit(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Largest `nis` that the gate passes, or distance that conditioning allows [m].
        """
    @property
    def log_likelihood(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def nis(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def particles(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Number of particles, (n,).
        """
    @property
    def poses(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        x, y, heading, (n, 3).
        """
    @property
    def probability(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability of the likeliest hypothesis, (n,).
        """
    @property
    def protection(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Protection levels of x, y [m] and heading [rad], (k, 3).
        """
    @property
    def ready(self) -> numpy.typing.NDArray[numpy.bool]:
        """
        (n,).
        """
    @property
    def reason(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Reason, why it was not fused.
        """
    @property
    def reports(self) -> list[LocalizeReport]:
        """
        A LocalizeReport for each scan that was not STALE, in order of turns.
        """
    @property
    def residual(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def scan_reason(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Reason, one per scan.
        """
    @property
    def scan_verdict(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Verdict, one per scan.
        """
    @property
    def sigma(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Standard deviation of all particles along the worst direction [m], (n,).
        """
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
    @property
    def watched(self) -> list[WatchReport]:
        """
        A WatchReport for each estimate where poses are watched; else empty.
        """
    @property
    def within(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the position error is below the limit, (k,).
        """
    @property
    def wrong(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the pose is wrong, (k,).
        """

class UncertainPlace:
    """
    A place that is found together with the poses; the world has the guess to start from.
    """
    def __init__(
        self,
        id: typing.SupportsInt | typing.SupportsIndex,
        mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        sigma_m: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        guess_sigma_m: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None:
        """
        Create the place of an anchor, a landmark or a tag.

        Parameters
        ----------
        id : int
            Of the anchor, landmark or tag, as in the world.
        mean : array_like, shape (3,)
            What is known of it before anything is measured: in world [m], of a tag in body.
        sigma_m : array_like, shape (3,)
            Standard deviation of that, per axis; 0: the world is right. Of landmarks and tags the third is
            not used.
        guess_sigma_m : float
            How far off the world's place may be, for the first guess of the poses.
        """
    @property
    def guess_sigma_m(self) -> float: ...
    @property
    def id(self) -> int: ...
    @property
    def mean(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]: ...
    @property
    def sigma_m(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]: ...

class Smoothed:
    """
    What all messages of a log together say.
    """
    def __repr__(self) -> str: ...
    def in_place_of(self, run: RunLog) -> RunLog:
        """
        RunLog of a filter with these estimates and outcomes instead of its own.
        """
    @property
    def anchors(self) -> list[Anchor]:
        """
        Those of the world, where they were found.
        """
    @property
    def converged(self) -> bool: ...
    @property
    def cost(self) -> float:
        """
        Half the sum of squared residuals in sigmas.
        """
    @property
    def covariances(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n, 3, 3).
        """
    @property
    def dof(self) -> numpy.typing.NDArray[numpy.int64]: ...
    @property
    def errors(self) -> list[CalibratedError]:
        """
        A CalibratedError per offset, per scale.
        """
    @property
    def initial_cost(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def landmarks(self) -> list[Landmark]:
        """
        The same of landmarks.
        """
    @property
    def limit(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Largest `nis` that the gate passes, or distance that conditioning allows [m].
        """
    @property
    def log_likelihood(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def nis(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def places_covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Of (x, y, z) of each anchor, (x, y) of each landmark and (forward, left) of each tag [m^2].
        """
    @property
    def poses(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        x, y, heading, (n, 3).
        """
    @property
    def reason(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Reason, why it was not fused.
        """
    @property
    def residual(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of the estimates, (n,).
        """
    @property
    def tags(self) -> list[Tag]:
        """
        The same of tags.
        """
    @property
    def termination(self) -> str:
        """
        What the solver said last.
        """
    @property
    def verdict(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into Verdict, one per message in order of arrival.
        """

class SurveyStatus:
    """
    How well the place of a surveyed anchor is known.

    Members:

      PLACED : one place fits

      TWO_PLACES : its mirror image fits as well

      NOT_PLACED : its ranges leave a whole curve, or most are rejected
    """

    NOT_PLACED = ...
    PLACED = ...
    TWO_PLACES = ...
    __members__: typing.ClassVar[dict[str, SurveyStatus]]
    @typing.overload
    def __eq__(self, other: SurveyStatus) -> bool: ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool: ...
    def __getstate__(self) -> int: ...
    def __hash__(self) -> int: ...
    def __index__(self) -> int: ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    def __int__(self) -> int: ...
    @typing.overload
    def __ne__(self, other: SurveyStatus) -> bool: ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool: ...
    def __repr__(self) -> str: ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    def __str__(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def value(self) -> int: ...

class KnownHeight:
    """
    The height of an anchor, where it is known.
    """
    def __init__(
        self,
        anchor: typing.SupportsInt | typing.SupportsIndex,
        height_m: typing.SupportsFloat | typing.SupportsIndex,
        sigma_m: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None:
        """
        Height in world [m]; a sigma of 0: it is exact.
        """
    @property
    def anchor(self) -> int: ...
    @property
    def height_m(self) -> float: ...
    @property
    def sigma_m(self) -> float: ...

class SurveyedAnchor:
    """
    An anchor that ranges name.
    """
    @property
    def anchor(self) -> Anchor:
        """
        In the frame of the start; its place means nothing if it is NOT_PLACED.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Of its place, 3x3 [m^2].
        """
    @property
    def other(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None:
        """
        Of TWO_PLACES the other one.
        """
    @property
    def ranges(self) -> int:
        """
        To it, from the start on.
        """
    @property
    def rejected(self) -> int:
        """
        Of those, that are judged wrong.
        """
    @property
    def status(self) -> SurveyStatus: ...

class Survey:
    """
    Where anchors and landmarks are.
    """
    def __repr__(self) -> str: ...
    @property
    def anchors(self) -> list[SurveyedAnchor]:
        """
        A SurveyedAnchor each, by id.
        """
    @property
    def smoothed(self) -> Smoothed:
        """
        The drive, among what is placed.
        """

class PoseRelation:
    """
    How one pose of a graph lies to another.

    Parameters
    ----------
    from_pose, to_pose : int
        Numbers of the poses.
    motion : Pose2
        T_from_to.
    information : array, shape (3, 3)
        Inverse covariance of (x, y, heading) of `motion`, in the axes of `from_pose` [1/m^2, 1/rad^2];
        zero along what is not known.
    may_be_wrong : bool
        Whether it is rejected where it contradicts others.
    """
    def __init__(
        self,
        from_pose: typing.SupportsInt | typing.SupportsIndex,
        to_pose: typing.SupportsInt | typing.SupportsIndex,
        motion: Pose2,
        information: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"],
        may_be_wrong: bool = False,
    ) -> None: ...
    @property
    def from_pose(self) -> int: ...
    @property
    def information(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]: ...
    @property
    def may_be_wrong(self) -> bool: ...
    @property
    def motion(self) -> Pose2: ...
    @property
    def to_pose(self) -> int: ...

class SolvedPoseGraph:
    """
    The likeliest poses of a graph.
    """
    @property
    def converged(self) -> bool: ...
    @property
    def cost(self) -> float:
        """
        Half the sum of squared errors in sigmas of the relations kept.
        """
    @property
    def iterations(self) -> int: ...
    @property
    def kept(self) -> list[bool]:
        """
        Of each relation whether it is not rejected.
        """
    @property
    def poses(self) -> list[Pose2]:
        """
        List of Pose2; the first one stays.
        """
    @property
    def termination(self) -> str:
        """
        What the solver said last.
        """

class ScanLoop:
    """
    A place that was seen again.
    """
    @property
    def agreement(self) -> float:
        """
        Fraction of the ends around both that do not contradict each other.
        """
    @property
    def explained(self) -> float:
        """
        Fraction of the returns that lie on what was seen before.
        """
    @property
    def from_ns(self) -> int:
        """
        Stamp of the earlier scan, if it is not on an old map.
        """
    @property
    def is_on_map(self) -> bool:
        """
        Whether the old map was seen; `motion` is then T_world_to.
        """
    @property
    def kept(self) -> bool:
        """
        Whether it agrees with all others.
        """
    @property
    def motion(self) -> Pose2:
        """
        T_from_to.
        """
    @property
    def to_ns(self) -> int: ...

class ScanMapping:
    """
    A map, and the drive that it was made of.
    """
    @property
    def covariances(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n, 3, 3).
        """
    @property
    def grid(self) -> OccupancyGrid:
        """
        OccupancyGrid.
        """
    @property
    def keys(self) -> int:
        """
        Of those, that the map is drawn of.
        """
    @property
    def loops(self) -> list[ScanLoop]:
        """
        List of ScanLoop.
        """
    @property
    def poses(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        x, y, heading, (n, 3).
        """
    @property
    def scans(self) -> int:
        """
        Number of scans that were used.
        """
    @property
    def stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of the estimates, (n,).
        """
    @property
    def unmatched(self) -> int:
        """
        Of those, that fitted nothing before: there the wheels led.
        """
    @property
    def weak(self) -> int:
        """
        Of all scans, that left a direction open, as along a corridor, where no wheels led.
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
    Quantile of the chi-squared distribution with `dof` degrees of freedom at `probability`.

    Raises
    ------
    ValueError
        Unless dof >= 1 and 0 <= probability <= 1.
    """

def closest_beam(
    scan: LaserScan,
    first: typing.SupportsInt | typing.SupportsIndex,
    last: typing.SupportsInt | typing.SupportsIndex,
    radius: typing.SupportsFloat | typing.SupportsIndex,
) -> BeamLandmark:
    """
    Centre of a cylinder from its closest beam (wells eq. 8-11).

    Parameters
    ----------
    scan : LaserScan
    first, last : int
        Beams of the cylinder; `first` > `last` wraps around the end of the scan.
    radius : float
        Added to the minimum range [m].

    Returns
    -------
    BeamLandmark

    Raises
    ------
    ValueError
        If the scan is not valid, a beam is not in it, or `radius` is not a finite number >= 0.
    """

def compiler() -> str:
    """
    Compiler that built the core, such as 'GCC 12.2.0'.
    """

def cramer_rao(
    anchors: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    sigma: typing.SupportsFloat
    | typing.SupportsIndex
    | typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = 0.1,
    height: typing.SupportsFloat | typing.SupportsIndex | None = None,
) -> numpy.typing.NDArray[numpy.float64]:
    """
    Cramer-Rao bound of a position from ranges at each point.

    Parameters
    ----------
    anchors : array, shape (m, 2) or (m, 3)
        Positions of the anchors [m].
    points : array, shape (k, 2) or (k, 3)
        Possible positions of the tag [m].
    sigma : float or array, shape (m,)
        Standard deviation of the ranges [m].
    height : float, optional
        Known height of the tag [m].

    Returns
    -------
    array, shape (k, d, d)
        Minimum covariance of any unbiased estimator [m^2]; infinite on the diagonal where the ranges
        do not determine a direction.

    Examples
    --------
    >>> import numpy as np, locfuse.core
    >>> anchors = np.array([[10.0, 0.0], [0.0, 10.0]])
    >>> locfuse.core.cramer_rao(anchors, [[0.0, 0.0]], 0.1).round(6).tolist()
    [[[0.01, 0.0], [0.0, 0.01]]]
    """

def draw_grid(
    scans: collections.abc.Sequence[tuple[LaserScan, Pose2]],
    resolution_m: typing.SupportsFloat | typing.SupportsIndex = 0.05,
    onto: OccupancyGrid | None = None,
) -> OccupancyGrid:
    """
    Draw the map that scans at known poses show (docs/map.md).

    Parameters
    ----------
    scans : list of (LaserScan, Pose2)
        Scans and their poses T_world_body.
    resolution_m : float
        Metres per cell; not used with `onto`.
    onto : OccupancyGrid, optional
        A map that stays where no beam reaches.

    Raises
    ------
    ValueError
        If a scan, pose or the resolution is not valid, there is nothing to draw, or too much.
    """

def find_start(
    initializer: Initializer, log: MessageLog, scans: collections.abc.Sequence[LaserScan]
) -> StartRun:
    """
    Feeds a sorted log and scans to an Initializer until it is READY or both end.
    """

def kernels() -> str:
    """
    Vector kernels in use: 'avx2', with fused multiply-add, or 'portable'. Results differ only by rounding.
    """

def local(
    to: Pose2, origin: Pose2
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
    """
    Error state (3,) from `origin` to `to` [m, m, rad], heading wrapped.
    """

def localize(
    mcl: LiveMcl,
    log: MessageLog,
    scans: collections.abc.Sequence[LaserScan],
    scan_arrivals: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] = [],
    progress: collections.abc.Callable[[int, collections.abc.Callable[[], LocalizeRun]], None]
    | None = None,
) -> LocalizeRun:
    """
    Feeds a log and scans to an Mcl in order of arrival, as they would come live.

    Parameters
    ----------
    mcl : LiveMcl
    log : MessageLog
    scans : list of LaserScan
    scan_arrivals : list of int
        When each scan arrives [ns]; if empty at its stamp.
    progress : callable, optional
        Called after each scan with the number of messages and scans processed and a function that
        returns a copy of the run during the call; it may read `mcl`. Items not processed yet have the
        verdict IGNORED.

    Raises
    ------
    ValueError
        If there are other than 0 or as many arrivals as scans.
    """

def locate(
    anchors: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ranges: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    sigma: typing.SupportsFloat
    | typing.SupportsIndex
    | typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = 0.1,
    *,
    height: typing.SupportsFloat | typing.SupportsIndex | None = None,
    loss: str = "none",
    loss_scale: typing.SupportsFloat | typing.SupportsIndex | None = None,
    prior: tuple[
        typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    ]
    | None = None,
    box: tuple[
        typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    ]
    | None = None,
    weights: str = "equal",
    ml: str = "newton",
    wrong_side_probability: typing.SupportsFloat | typing.SupportsIndex = 1e-06,
    false_alarm_probability: typing.SupportsFloat | typing.SupportsIndex = 0.001,
    max_iterations: typing.SupportsInt | typing.SupportsIndex = 50,
) -> PositionSolution:
    """
    Position from ranges by SR-LS and maximum likelihood, with all hypotheses.

    Parameters
    ----------
    anchors : array, shape (m, 2) or (m, 3)
        Positions of the anchors [m]; (m, 3) with `height`.
    ranges : array, shape (m,)
        One per anchor [m].
    sigma : float or array, shape (m,)
        Standard deviation of the ranges [m].
    height : float, optional
        Known height of the tag [m]; the position is then estimated in the plane.
    loss : {'none', 'huber', 'cauchy', 'one_sided'}
        Loss of the residuals; 'one_sided' suits ranges that read long (NLOS).
    loss_scale : float, optional
        Residual at which the loss departs from the square [sigmas]; by default 95 % efficient.
    prior : (mean, sigma), optional
        Prior mean and sigma per axis [m]; an infinite sigma for none.
    box : (low, high), optional
        Corners of a box that contains the position [m].
    weights : {'equal', 'variance'}
        SR-LS or SR-WLS.
    ml : {'newton', 'ceres', 'both'}
        Whose minimum and covariance of maximum likelihood are returned: our Newton steps' or Ceres'.
        'both' returns ours, and in `ml_comparison` how far from it Ceres ends.
    max_iterations : int
        Maximum number of steps that Ceres takes.

    Returns
    -------
    PositionSolution
        Derivation: docs/models/ranges.md.

    Raises
    ------
    ValueError
        On numbers that are not finite, ranges or sigmas that are not positive, wrong shapes.

    Examples
    --------
    >>> import numpy as np, locfuse.core
    >>> anchors = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    >>> ranges = np.hypot(*(anchors - [3.0, 4.0]).T)
    >>> solution = locfuse.locate(anchors, ranges, sigma=0.1)
    >>> solution.status.name, solution.position.round(6).tolist(), solution.comparison.agree
    ('UNIQUE', [3.0, 4.0], True)
    >>> on_a_line = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]])
    >>> ranges = np.hypot(*(on_a_line - [3.0, 4.0]).T)
    >>> [h.position.round(6).tolist() for h in locfuse.locate(on_a_line, ranges).hypotheses]
    [[3.0, 4.0], [3.0, -4.0]]
    """

def locate_batch(
    anchors: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ranges: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    sigma: typing.SupportsFloat
    | typing.SupportsIndex
    | typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = 0.1,
    *,
    height: typing.SupportsFloat | typing.SupportsIndex | None = None,
    solver: str = "newton",
    loss: str = "none",
    loss_scale: typing.SupportsFloat | typing.SupportsIndex | None = None,
    wrong_side_probability: typing.SupportsFloat | typing.SupportsIndex = 1e-06,
    false_alarm_probability: typing.SupportsFloat | typing.SupportsIndex = 0.001,
) -> PositionBatch:
    """
    Positions of many epochs of ranges.

    Parameters
    ----------
    anchors : array, shape (m, 2) or (m, 3), or (n, m, 2 or 3)
        Positions of the anchors [m], of all epochs or one set per epoch.
    ranges : array, shape (n, m)
        One row per epoch [m]; NaN for an anchor without a range.
    sigma : float or array, shape (m,)
        Standard deviation of the ranges [m].
    height : float, optional
        Known height of the tag [m].
    solver : {'newton', 'ceres', 'srls', 'srwls'}
        Maximum likelihood by our Newton steps or by Ceres, both from SR-LS, or SR-LS or SR-WLS alone.
    loss, loss_scale
        As in `locate`.

    Returns
    -------
    PositionBatch
        Rows of epochs without a position are NaN; `status` says why.

    Raises
    ------
    ValueError
        As `locate`, but an epoch with a range that is not positive has the status BAD_RANGE.

    Examples
    --------
    >>> import numpy as np, locfuse.core
    >>> anchors = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    >>> truth = np.array([[3.0, 4.0], [6.0, 1.0]])
    >>> ranges = np.linalg.norm(truth[:, None] - anchors, axis=2)
    >>> locfuse.locate_batch(anchors, ranges).position.round(6).tolist()
    [[3.0, 4.0], [6.0, 1.0]]
    """

def map_scans(
    scans: ScanOdometryConfig,
    odometry: OdometryConfig,
    log: MessageLog,
    start: PoseEstimate,
    resolution_m: typing.SupportsFloat | typing.SupportsIndex = 0.05,
    onto: OccupancyGrid | None = None,
    progress: collections.abc.Callable[[float], None] | None = None,
) -> ScanMapping:
    """
    Make a map of the scans of a log and, if it has any, its odometry (docs/map.md).

    Parameters
    ----------
    scans : ScanOdometryConfig
    odometry : OdometryConfig
        Noise of the wheels.
    log : MessageLog
    start : PoseEstimate
        Of the first scan, in the frame of the map.
    resolution_m : float
        Metres per cell.
    onto : OccupancyGrid, optional
        A map that is continued, in its resolution and axes; the start's covariance says how well it is
        known there.
    progress : callable, optional
        Called with the fraction that is done.

    Raises
    ------
    ValueError
        If a setting is out of bounds, or no scan has a return.
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

    Blank lines and lines that start with ``#`` are skipped. Spaces and tabs around a field are ignored.
    Quotes have no special meaning.

    Parameters
    ----------
    text : bytes
        UTF-8; lines end in ``\\n`` or ``\\r\\n``.
    kinds : str
        One letter per column: ``f`` finite float64; ``g`` the same, where an empty field is NaN;
        ``s`` decimal seconds converted exactly to int64 nanoseconds (fractions of a nanosecond are
        rounded half away from zero); ``t`` text of at most 255 bytes.
    delimiter : str
        ``,``, ``;``, ``|``, tab, or a space for any run of spaces and tabs.
    first_line : int
        Number of the first line to parse, from 1; lines before it (a header) are skipped.
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
        line and the column, both from 1. Also if the names, each padded to the longest of its column,
        would take more than 64 MB plus 16 times the size of the text.

    Examples
    --------
    >>> stamp_ns, name = parse_table(b"stamp_s,tag\\n1.25,left\\n", "st", ",", 2, "example")
    >>> int(stamp_ns[0]), str(name[0])
    (1250000000, 'left')
    """

@typing.overload
def predict(belief: GaussianBelief, step: Propagation, slot: Slot) -> None:
    """
    Predicts the pose in `slot`: P becomes F P F' + Q, cross-covariances included.
    """

@typing.overload
def predict(
    belief: GaussianBelief, step: BodyPropagation, slots: collections.abc.Sequence[Slot]
) -> None:
    """
    Predicts the leading variables of `slots` with a user-defined motion.

    The motion may depend on all of them; P becomes F P F' + Q, cross-covariances included.

    Raises
    ------
    ValueError
        If the slots do not match the step.
    NumericalError
        If a result is not finite or a variance not positive; the belief is unchanged.
    """

def recognize_landmarks(
    scan: LaserScan, predicted: Pose2, landmarks: LandmarkMap
) -> list[BeamLandmark]:
    """
    Beams that a predicted pose assigns to landmarks (gadau2022 Fig. 3).

    Parameters
    ----------
    scan : LaserScan
    predicted : Pose2
        T_world_body.
    landmarks : LandmarkMap

    Returns
    -------
    list of BeamLandmark
        One per landmark in order of id, with the measured range to the surface.

    Raises
    ------
    ValueError
        If scan or pose is not valid.
    """

@typing.overload
def replay(
    start: PoseEkf,
    log: MessageLog,
    history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
    record: bool = True,
    progress: collections.abc.Callable[[int, collections.abc.Callable[[], RunLog]], None]
    | None = None,
    used_until: typing.SupportsInt | typing.SupportsIndex | None = None,
    clock_jump: ClockJump = ...,
    max_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
    switches: collections.abc.Sequence[
        tuple[typing.SupportsInt | typing.SupportsIndex, Source, bool]
    ] = [],
) -> RunLog: ...
@typing.overload
def replay(
    start: RecoveringEkf,
    log: MessageLog,
    history: typing.SupportsInt | typing.SupportsIndex = 2000000000,
    record: bool = True,
    progress: collections.abc.Callable[[int, collections.abc.Callable[[], RunLog]], None]
    | None = None,
    used_until: typing.SupportsInt | typing.SupportsIndex | None = None,
    clock_jump: ClockJump = ...,
    max_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
    switches: collections.abc.Sequence[
        tuple[typing.SupportsInt | typing.SupportsIndex, Source, bool]
    ] = [],
) -> RunLog:
    """
    Feeds a sorted log to a copy of an estimator; late messages are fused at their stamp.

    Parameters
    ----------
    start : PoseEkf or RecoveringEkf
        A RecoveringEkf must have started.
    log : MessageLog
    history : int
        Maximum delay of a message [ns]; older ones are STALE.
    record : bool
        Whether to keep outcomes and estimates, or only the last estimate.
    progress : callable, optional
        Called from time to time with the number of messages processed and a function that returns a
        copy of the run during the call: outcomes, which late messages may still change, and estimates.
    used_until : int, optional
        Messages that take effect up to this stamp [ns] were used for the initialization and are
        IGNORED.
    clock_jump : ClockJump
        Reaction to a backward jump of the message clock.
    max_messages : int
        Maximum number of messages kept for reordering, at least 512; `dropped_messages` counts the dropped.
    switches : list of (int, Source, bool)
        Disables (False) or enables (True) a source from this arrival [ns].
    """

def rigid_fit(
    body: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    world: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
) -> RigidFit:
    """
    Pose that maps points of a body to their measured positions.

    Least squares weighted with the covariance; docs/models/poses.md.

    Parameters
    ----------
    body : array, shape (n, 2)
        Metres, in body; at least two that differ.
    world : array, shape (n, 2)
        Metres, in world.
    covariance : array, shape (2 n, 2 n) or (n, 2, 2)
        Covariance of `world` [m^2]: joint over (x0, y0, x1, y1, ...), or per point if independent.

    Returns
    -------
    RigidFit

    Raises
    ------
    ValueError
        On fewer than two points, points that coincide in body, numbers that are not finite or a
        covariance that is not positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import rigid_fit
    >>> fit = rigid_fit([[1, 0], [-1, 0]], [[2, 4], [2, 2]], 0.01 * np.eye(4))
    >>> round(fit.pose.x, 6), round(fit.pose.y, 6), round(fit.pose.heading, 6)
    (2.0, 3.0, 1.570796)
    """

def smooth(
    config: PoseEkfConfig,
    world: World,
    start: PoseEstimate,
    log: MessageLog,
    used_until: typing.SupportsInt | typing.SupportsIndex | None = None,
    keyframe_s: typing.SupportsFloat | typing.SupportsIndex = 0.2,
    max_iterations: typing.SupportsInt | typing.SupportsIndex = 100,
    anchors: collections.abc.Sequence[UncertainPlace] = [],
    landmarks: collections.abc.Sequence[UncertainPlace] = [],
    tags: collections.abc.Sequence[UncertainPlace] = [],
) -> Smoothed:
    """
    Find all poses of a log at once, by all of its messages (docs/smoothing.md).

    Parameters
    ----------
    config : PoseEkfConfig
        Models, gates and noise.
    world : World
    start : PoseEstimate
    log : MessageLog
    used_until : int, optional
        Messages that take effect up to this stamp were used for the start and stay IGNORED [ns].
    keyframe_s : float
        Without measurements there is a pose at least so often [s].
    max_iterations : int
        Of the solver, each time it is called.
    anchors, landmarks, tags : list of UncertainPlace
        Of the world's those whose places are found, too.

    Returns
    -------
    Smoothed
        Poses at the stamps of measurements, and between.

    Raises
    ------
    ValueError
        If the config is out of range, or nothing was measured after the start.
    NumericalError
        If the solver fails.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import *
    >>> log = MessageLog()
    >>> log.add_velocities([0], [1.0], [0.0])
    >>> log.add_positions([2 * 10**9], [[2.2, 0.0]], [0.1])
    >>> start = PoseEstimate(0, Pose2(0, 0, 0), 0.01 * np.eye(3))
    >>> batch = smooth(PoseEkfConfig(), World(), start, log)
    >>> bool(batch.poses[0, 0] > 0.0 and batch.poses[-1, 0] > 2.0)
    True
    """

def solve_pose_graph(
    guess: collections.abc.Sequence[Pose2],
    relations: collections.abc.Sequence[PoseRelation],
    wrong_probability: typing.SupportsFloat | typing.SupportsIndex = 0.001,
    max_iterations: typing.SupportsInt | typing.SupportsIndex = 100,
) -> SolvedPoseGraph:
    """
    Find the likeliest poses of a graph, and which relations are wrong (docs/map.md).

    Parameters
    ----------
    guess : list of Pose2
        Where to begin; the first pose stays.
    relations : list of PoseRelation
        Those that cannot be wrong, as odometry, connect all poses.
    wrong_probability : float
        Of rejecting a right one.
    max_iterations : int
        Of the solver, each time it is called.

    Raises
    ------
    ValueError
        If a pose or relation is not valid, or a pose is not connected.
    NumericalError
        If the solver fails.

    Examples
    --------
    A square of 1 m, whose last side says 10 cm too much, and a loop that closes it:

    >>> import numpy as np
    >>> from locfuse.core import Pose2, PoseRelation, solve_pose_graph
    >>> ahead, sure = Pose2(1.0, 0.0, np.pi / 2), 100.0 * np.eye(3)
    >>> sides = [PoseRelation(i, i + 1, ahead, sure) for i in range(3)]
    >>> sides += [PoseRelation(3, 4, Pose2(1.1, 0.0, np.pi / 2), sure)]
    >>> loop = PoseRelation(4, 0, Pose2(), sure, may_be_wrong=True)
    >>> guess = [Pose2(), Pose2(1, 0, 1.6), Pose2(1, 1, 3.1), Pose2(0, 1, -1.6), Pose2(0, 0, 0)]
    >>> solved = solve_pose_graph(guess, [*sides, loop])
    >>> all(solved.kept), bool(np.hypot(solved.poses[4].x, solved.poses[4].y) < 0.05)
    (True, True)
    """

def survey(
    config: PoseEkfConfig,
    world: World,
    start: PoseEstimate,
    log: MessageLog,
    heights: collections.abc.Sequence[KnownHeight] = [],
    tags: collections.abc.Sequence[UncertainPlace] = [],
    progress: collections.abc.Callable[[float], None] | None = None,
) -> Survey:
    """
    Find where anchors and landmarks are from one drive among them (docs/survey.md).

    Parameters
    ----------
    config : PoseEkfConfig
        Models, gates and noise; its calibration says how large offsets and scales of anchors may be.
    world : World
        Tags; of the anchors that it has offset and scale are used, not the places.
    start : PoseEstimate
        The frame of the result.
    log : MessageLog
        Ranges and odometry; sightings by name, positions and poses as far as there are.
    heights : list of KnownHeight
        Anchors without one are found in space, above the tags.
    tags : list of UncertainPlace
        Of the world's those whose places on the body are found, too.
    progress : callable, optional
        Called with the share that is done, 0 to 1.

    Returns
    -------
    Survey

    Raises
    ------
    ValueError
        If the config is out of range, or no range and no sighting names anything.
    NumericalError
        If the solver fails.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse.core import *
    >>> log, angle = MessageLog(), np.linspace(0.0, 6.0, 61)
    >>> stamp = (angle * 1e9).astype(np.int64)
    >>> at = np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])  # a circle from the origin
    >>> log.add_velocities(stamp, np.ones(61), np.ones(61))
    >>> log.add_ranges(stamp, np.zeros(61, np.int32), np.zeros(61, np.int32),
    ...                np.hypot(*(at - [4.0, 3.0]).T), np.full(61, 0.1))
    >>> start = PoseEstimate(0, Pose2(0, 0, 0), 1e-6 * np.eye(3))
    >>> world = World(tags=[Tag(0, [0.0, 0.0, 0.0])])
    >>> found = survey(PoseEkfConfig(), world, start, log, [KnownHeight(0, 0.0)])
    >>> found.anchors[0].status.name, np.round(found.anchors[0].anchor.position, 1).tolist()
    ('PLACED', [4.0, 3.0, 0.0])
    """

def tag_order(
    tags: collections.abc.Sequence[Tag],
    fixes: collections.abc.Sequence[PositionFix],
    probability: typing.SupportsFloat | typing.SupportsIndex = 0.999,
) -> TagOrder:
    """
    Check the ids of three tag fixes of one epoch against their triangle.

    Every order of the ids is tried.

    Parameters
    ----------
    tags : list of Tag
        Three.
    fixes : list of PositionFix
        One per tag, all with the same stamp.
    probability : float
        Probability that the correct order passes.

    Returns
    -------
    TagOrder
        `str()` of it names the ids that would fit.

    Raises
    ------
    ValueError
        Unless there are three tags and one fix of each with one stamp.
    """

def update(
    belief: GaussianBelief,
    linearization: Linearization,
    slots: collections.abc.Sequence[Slot],
    gate: Gate,
    noise: NoiseShape = ...,
) -> Outcome:
    """
    Fuses a measurement into the belief, or gates it.

    Parameters
    ----------
    belief : GaussianBelief
        Updated completely or not at all.
    linearization : Linearization
        From a model of the library or user-defined.
    slots : list of Slot
        Variables of the Jacobian's columns, in order.
    gate : Gate
    noise : NoiseShape, optional
        Gaussian by default.

    Raises
    ------
    ValueError
        If the slots do not match the Jacobian, or one-sided noise has several rows.
    NumericalError
        If the innovation covariance is not positive definite or a result not finite.
    """

def wrap_angle(angle: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Angle wrapped to [-pi, pi) [rad].
    """

__version__: str = "0.1.0"
