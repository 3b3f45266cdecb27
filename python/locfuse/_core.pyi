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
    "Dilution",
    "DistanceField",
    "Doubt",
    "Gate",
    "GaussianBelief",
    "HeadingSearch",
    "HeadingSearchReason",
    "Health",
    "HealthClue",
    "HealthConfig",
    "HealthReport",
    "HealthState",
    "Increment",
    "Initializer",
    "InitializerConfig",
    "Injection",
    "KnownLandmark",
    "Landmark",
    "LandmarkEkf",
    "LandmarkEkfConfig",
    "LandmarkEstimate",
    "LandmarkMap",
    "LandmarkSight",
    "LaserGeometry",
    "LaserScan",
    "LikelihoodFieldConfig",
    "Limits",
    "Linearization",
    "Live",
    "LocalMap",
    "LocalMapConfig",
    "LocalizeRun",
    "Mcl",
    "MclConfig",
    "MessageLog",
    "Multilateration",
    "NamedSource",
    "NoiseKind",
    "NoiseShape",
    "NumericalError",
    "OccupancyGrid",
    "OdometryConfig",
    "OdometryMotion",
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
    "RecoveringEkf",
    "RecoveringEkfConfig",
    "RigidFit",
    "RigidFitStatus",
    "RunLog",
    "ScanHypothesis",
    "ScanLikelihood",
    "ScanMatch",
    "ScanMatchReason",
    "ScanMatcher",
    "ScanMatcherConfig",
    "ScanMotion",
    "ScanOdometry",
    "ScanOdometryConfig",
    "ScanSearch",
    "ScanSearchReason",
    "ScanSearchStatus",
    "Slot",
    "SlotKind",
    "SolverComparison",
    "Source",
    "SourceStatus",
    "StartRun",
    "StartState",
    "StartStatus",
    "StartStep",
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
    "Velocity",
    "VelocityConfig",
    "VelocityModel",
    "Verdict",
    "arc",
    "chi_squared_quantile",
    "closest_beam",
    "compiler",
    "cramer_rao",
    "find_start",
    "kernels",
    "local",
    "localize",
    "locate",
    "locate_batch",
    "parse_table",
    "predict",
    "recognize_landmarks",
    "replay",
    "rigid_fit",
    "tag_order",
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

class Source(enum.Enum):
    """
    What a message comes from.
    """

    LANDMARK_SIGHTINGS = ...
    ODOMETRY = ...
    POSES = ...
    POSITIONS = ...
    RANGES = ...
    SCANS = ...

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
    Position (2,) [m] in world with its covariance (2, 2) [m^2], of the tag named, without one of the antenna.
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
    Height [m] of an altimeter on the body over z = 0 of the world. With a PositionFix of the same stamp it is a fix in space.
    """
    def __init__(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        height: typing.SupportsFloat | typing.SupportsIndex,
        sigma: typing.SupportsFloat | typing.SupportsIndex,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def height(self) -> float: ...
    @property
    def sigma(self) -> float: ...
    @property
    def stamp(self) -> int: ...

class RangeBearing:
    """
    A landmark seen from a sensor on the body: `range` [m] to its centre, `bearing` [rad] counter-clockwise from the sensor's x, or one of the two. Without `landmark` it is of whichever fits; without `covariance` (2, 2) of (range, bearing) the model's own is used. Only an AirEkf takes an `elevation` [rad], up, of the line of sight along which the range is measured.
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
    How a 2D laser sits on the body and sees: beam i leaves at angle_min + i * angle_increment [rad] from the laser's x axis; `pose_in_body` is T_body_laser; ranges [m].
    """
    def __init__(
        self,
        pose_in_body: Pose2,
        angle_min: typing.SupportsFloat | typing.SupportsIndex,
        angle_increment: typing.SupportsFloat | typing.SupportsIndex,
        range_min: typing.SupportsFloat | typing.SupportsIndex,
        range_max: typing.SupportsFloat | typing.SupportsIndex,
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

class LaserScan:
    """
    One turn of a 2D laser: `ranges` (beams,) [m], NaN without return. Those outside [range_min, range_max) are no returns either: many lasers report range_max where nothing came back. `intensities` (beams,) in the laser's own unit; empty if it tells none.
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
        In the laser's own unit (beams,) or (0,), a read-only view.
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
    What no robot and no sensor exceeds: a message beyond is IMPLAUSIBLE.
    """
    def __init__(self) -> None: ...
    @property
    def distance_m(self) -> float:
        """
        Of positions from the world's origin [m].
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

class Landmark:
    """
    Something fixed that a sensor recognizes: its centre at `position` (2,) in world, its `radius` and, for an AirEkf, its `height` [m].
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
    The landmarks, by id; immutable.

    Raises
    ------
    ValueError
        On a duplicate id, a number that is not finite or a radius that is negative.
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
    Square cells that are free, occupied or unknown; immutable.

    Parameters
    ----------
    cells : integer array, shape (height, width)
        0 free, 100 occupied, -1 unknown; row 0 has the lowest y.
    resolution : float
        Metres per cell.
    origin : Pose2
        Lower left corner of the grid in world.

    Raises
    ------
    ValueError
        On other cells, an empty grid, or numbers that are not finite.
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
    Nearest occupied cell of every cell of a map, and around it.

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
        Distances (n,) [m] looked up for points (n, 2) in world: from the centre of the cell that holds the point to the centre of the nearest occupied cell.
        """
    def nearest_distance(
        self, points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Distances (n,) [m] from points (n, 2) to the nearest occupied centre, exact anywhere.
        """

class RayCaster:
    """
    How far beams go on a map until they enter an occupied cell, exactly.

    A beam that starts in an occupied cell has gone 0. Free cells and the outside of the map let beams
    pass, so one may start outside.

    Parameters
    ----------
    grid : OccupancyGrid
    unknown_stops : bool
        Whether unknown cells stop beams as occupied ones do; else they let them pass.

    Raises
    ------
    ValueError
        If there is no map.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import OccupancyGrid, Pose2, RayCaster
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
            Where they start in world [m].
        headings : float64 array, shape (n,)
            Their directions in world [rad].
        max_range : float
            Beams end there [m].

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
            Beams.
        max_range : float
            Beams end there [m].

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
    Why there is a heading, or none.
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
        Of the body in world [rad], a multiple of ten degrees; None unless found.
        """
    @property
    def reason(self) -> HeadingSearchReason: ...
    @property
    def sums(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Sums (36,) [m] of nearest distances, the body turned by 0, 10, ..., 350 degrees.
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
    Where a scan fits the map next to a guess.
    """
    def __repr__(self) -> str: ...
    @property
    def converged(self) -> bool:
        """
        Without it, only `reason` and `iterations` say something.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"] | None:
        """
        Of (x, y, heading), shape (3, 3), with the prior; None if a direction is known from neither.
        """
    @property
    def explained(self) -> float:
        """
        Share of the returns that end at a wall.
        """
    @property
    def information(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        What the scan alone says of (x, y, heading), shape (3, 3).
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
        Of their distances to the wall lines [m].
        """
    @property
    def weak_direction(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None:
        """
        Change (3,) of (x, y, heading) that the scan would not see, or None.
        """

class ScanHypothesis:
    """
    A pose at which a scan fits.
    """
    @property
    def cost(self) -> float:
        """
        Minus log of likelihood and prior; 0 is a perfect fit.
        """
    @property
    def match(self) -> ScanMatch: ...
    @property
    def probability(self) -> float:
        """
        Among the hypotheses found.
        """

class ScanSearchStatus(enum.Enum):
    """
    Whether a search knows the pose.
    """

    AMBIGUOUS = ...
    NONE = ...
    READY = ...

class ScanSearchReason(enum.Enum):
    """
    Why.
    """

    HEADING_UNOBSERVED = ...
    NO_RETURNS = ...
    OUTSIDE_MAP = ...
    POOR_FIT = ...
    SEVERAL_FIT = ...
    UNIQUE = ...

class ScanSearch:
    """
    Every pose of a window at which a scan fits.
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
        Noise of one beam.
    outlier_share : float
        Returns from things that are not on the map.
    no_return_share : float
        Beams that should come back and do not.
    wrong_probability : float
        What the other hypotheses may keep when a search is ready.
    min_explained : float
        Share of the returns that a pose must explain.
    max_hypotheses : int
        That a search returns.
    max_iterations : int
        Of one refinement.
    exact_neighbours : bool
        Nearest cell of each end point instead of that of the cell it is in.
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
    Finds a body on a map from single laser scans.

    Raises
    ------
    ValueError
        If there is no map or it has no occupied cell; by the methods if a scan or a number is not
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
        The search of ekim2020, Table 1, about a position (2,) [m]: 36 headings, nearest cells by PCL's kd-tree.
        """
    def heading_search_by_lookup(
        self,
        scan: LaserScan,
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> HeadingSearch:
        """
        The same with distances looked up, right within half a cell's diagonal.
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
        Fit the scan to the map next to a guess.

        Parameters
        ----------
        scan : LaserScan
        guess : Pose2
            T_world_body, within 20 cm and 5 degrees.
        covariance : array, shape (3, 3), optional
            Of (x, y, heading); with it the guess is a prior, too.

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
            Of the body in world [m].
        covariance : array, shape (2, 2)
            Of the position [m^2]; the search covers three sigma.

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
        Noise of one beam.
    max_distance_m : float
        From the end of a beam to what it is matched with.
    trimmed_share : float
        Of the matches, the worst, left out if they are off three sigma.
    min_explained : float
        Share of the returns; below it the fit is searched anew.
    max_iterations : int
        Of one fit.
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
    Ends of the beams of a few scans, to fit another scan to.

    Parameters
    ----------
    scans : list of (LaserScan, Pose2)
        And where each was taken, T_map_body. One for scan to scan.
    config : LocalMapConfig, optional

    Raises
    ------
    ValueError
        If a setting is out of bounds; if a scan, pose or covariance is not valid.

    Examples
    --------
    A room of 8 x 6 m, seen from its middle and from 0.2 m further on:

    >>> import numpy as np
    >>> from locfuse import LaserGeometry, LaserScan, LocalMap, Pose2
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
        Fit a scan next to a guess.

        Parameters
        ----------
        scan : LaserScan
        guess : Pose2
            T_map_body, within 20 cm and 5 degrees.
        covariance : array, shape (3, 3), optional
            Of (x, y, heading) [m, rad]; with it the guess is a prior, too, and if it may be further off,
            or the fit explains too little, a search over three sigma of the position and all headings
            gives another start.

        Returns
        -------
        ScanMatch
            TOO_FEW_MATCHES on an empty map.

        Raises
        ------
        ValueError
            If scan, guess or covariance are not valid.
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
        Key scans that make the local map; 1 is scan to scan.
    window_m : float
        How far from the newest of them the others may be.
    key_distance_m, key_turn_rad : float
        From the newest key scan, after which a scan becomes the next; 0 makes every one a key scan.
    least_sigma_m, least_sigma_rad : float
        That odometry is known to at best, whatever it says of itself: it is not told in the very
        moment of the scan, and a robot that seems to stand may be on its way.
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
    What a scan says of the motion.
    """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Of T_key_body, (x, y, heading) [m, rad], shape (3, 3); without a match what odometry alone says.
        """
    @property
    def increment(self) -> Increment:
        """
        Since the scan before: a message for a PoseEkf. Of no duration for the first.
        """
    @property
    def key(self) -> int:
        """
        Stamp of that key scan [ns].
        """
    @property
    def match(self) -> ScanMatch:
        """
        Against the local map, in the body frame of the newest key scan (T_key_body).
        """
    @property
    def pose(self) -> Pose2:
        """
        T_start_body: increments from the first scan on.
        """

class ScanOdometry:
    """
    Motion of a body from its laser, without a map.

    Each scan is fitted to the key scans driven through last, next to what odometry says.

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
    >>> for k, x in enumerate([0.0, 0.1, 0.2]):  # in a room of 8 x 6 m; the wheels say 12 cm each time
    ...     ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
    ...     scan = LaserScan(k * 10**9, around, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))
    ...     told = odometry.on(scan, Pose2(0.12, 0.0, 0.0), np.diag([0.03, 0.01, 0.02]) ** 2)
    >>> round(told.pose.x, 2)
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
        Take the next scan.

        Parameters
        ----------
        scan : LaserScan
        motion : Pose2
            Since the scan before, as odometry tells it; nothing becomes of that of the first scan.
        covariance : array, shape (3, 3)
            Of that motion: (x, y, heading) in the body frame where it begins [m, rad].

        Returns
        -------
        ScanMotion
            Where the scan does not fit, the motion is odometry's.

        Raises
        ------
        ValueError
            If scan, motion or covariance are not valid or the stamp is not later than the one before;
            nothing has changed then.
        """
    @property
    def config(self) -> ScanOdometryConfig: ...

class CylinderDetectorConfig:
    """
    Settings of a CylinderDetector.

    Parameters
    ----------
    sigma_range_m, sigma_bearing_rad : float
        Noise of one beam: of its length; of its direction (its width, quantization).
    radius_m : float
        Of all cylinders; 0: each has its own, found by the fit.
    radius_min_m, radius_max_m : float
        Of a cylinder whose radius is found.
    least_beams : int
        On a cylinder.
    jump_gaps : float
        A depth step between two beams is an edge from six sigma and so many gaps between beams on.
    misfit_probability : float
        That the arc of a cylinder passes the chi-square gate.
    least_evidence : float
        By how much the chi-square of a straight wall must be larger. What is too small to tell is a
        cylinder if it stands alone and `radius_m` says its width; with 0 of any width in bounds.
    least_corner_evidence : float
        By how much that of a right-angled corner must be larger. Thin cylinders look like the corners of
        boxes as small as they; -20 takes them all, for places without boxes.
    leg_radius_m, leg_distance_m : float
        A cylinder up to that radius, that near to anything as thin, is a leg; 0: nobody walks here.
    least_intensity : float
        One beam must be that bright; 0: of any brightness.
    """
    def __init__(
        self,
        *,
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
    An upright cylinder in the plane of a laser.
    """
    def __repr__(self) -> str: ...
    @property
    def beams(self) -> int:
        """
        How many the fit used.
        """
    @property
    def bearing(self) -> float:
        """
        Of the centre, in the laser's frame [rad].
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Of (range, bearing, radius) [m, rad, m], shape (3, 3); zero in row and column of a radius that was given.
        """
    @property
    def first(self) -> int:
        """
        Beam of its arc where the bearing is least; above `last` across the cut.
        """
    @property
    def last(self) -> int:
        """
        Beam of its arc where the bearing is largest.
        """
    @property
    def misfit(self) -> float:
        """
        Chi-square by degree of freedom.
        """
    @property
    def radius(self) -> float:
        """
        Metres.
        """
    @property
    def range(self) -> float:
        """
        Of the centre, from the laser [m].
        """

class CylinderDetector:
    """
    Finds cylinders in single scans.

    Raises
    ------
    ValueError
        If a setting is out of bounds.

    Examples
    --------
    A cylinder of radius 0.5 m, 2 m ahead, and nothing around it:

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
        Find the cylinders of a scan.

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
            If the scan is not valid, or has no intensities where `least_intensity` asks for them.
        """
    @property
    def config(self) -> CylinderDetectorConfig: ...

class BeamLandmark:
    """
    What the beam that stands for a landmark says: `beam`, `range` [m], `bearing` in the laser's frame [rad]; -1, -1 and 0 where no beam does.
    """
    @property
    def beam(self) -> int: ...
    @property
    def bearing(self) -> float: ...
    @property
    def range(self) -> float: ...

class AckermannConfig:
    """
    A vehicle that steers its front wheels.

    Parameters
    ----------
    wheel_base_m : float
        From the rear to the front axle.
    encoder_left_m : float
        Of the rear wheel that is counted, from the middle of its axle, negative to the right.
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
    Turns wheel speed and steering angle into velocities.

    Those of the middle of the rear axle, which is the body's origin; docs/models/ackermann.md. A
    steering angle is that of a wheel in the middle of the front axle [rad], to the left positive; a
    wheel's speed is negative backwards [m/s]. Every method raises ValueError for a value that is not
    finite, and where the wheel does not tell the speed: steered by 90 degrees and more, or about a
    point that is not beyond the wheel.

    Raises
    ------
    ValueError
        If the wheel base is not positive, a sigma is negative, or a value is not finite.

    Examples
    --------
    >>> import math
    >>> from locfuse import AckermannConfig, AckermannVehicle
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
        Of (forward, turn rate), by the sigmas, shape (2, 2).
        """
    def jacobian(
        self,
        wheel_speed: typing.SupportsFloat | typing.SupportsIndex,
        steering: typing.SupportsFloat | typing.SupportsIndex,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]:
        """
        Of (forward, turn rate) with respect to (wheel speed, steering), shape (2, 2).
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

class BodyPropagation:
    """
    What a motion model says about one step of several variables.

    Parameters
    ----------
    moved : float64 array, shape (n,)
        f(x) of the variables that move.
    jacobian : float64 array, shape (n, m)
        d f / d(all m variables that it depends on); those that move come first.
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
    >>> import locfuse as lf
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
    @typing.overload
    def linearize(self, T_world_body: Pose2, z: Range) -> Linearization | None:
        """
        Linearization (1 x 3); None if anchor or tag is unknown, or the tag sits on the anchor.
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
        Linearization (1 x 2) with respect to the tag itself (2,) in world.
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
        The same from a height of the body over z = 0 [m].
        """

class RangeBearingConfig:
    """
    Noise of sightings that bring no covariance of their own.
    """
    def __init__(self) -> None: ...
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
        share of the range, on top of sigma_range_m
        """
    @sigma_range_relative.setter
    def sigma_range_relative(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class RangeBearingInSpace:
    """
    What range and bearing take besides on a body that flies.
    """
    def __init__(self) -> None: ...
    @property
    def sensor_up_m(self) -> float:
        """
        Height of the sensor over the body's origin.
        """
    @sensor_up_m.setter
    def sensor_up_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_elevation_rad(self) -> float:
        """
        Where a sighting brings none.
        """
    @sigma_elevation_rad.setter
    def sigma_elevation_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class RangeBearingModel:
    """
    Range and bearing from a sensor on the body to a landmark at (2,) in world; docs/models/range_bearing.md.
    """
    @typing.overload
    def __init__(self, config: RangeBearingConfig, sensor_in_body: Pose2 = ...) -> None: ...
    @typing.overload
    def __init__(
        self, config: RangeBearingConfig, sensor_in_body: Pose2, in_space: RangeBearingInSpace
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
        Linearization (1 or 2 x 3); None if the landmark sits on the sensor.
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
    @property
    def least_sigma_m(self) -> float:
        """
        Of any fix: less is not believed.
        """
    @least_sigma_m.setter
    def least_sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_m(self) -> float:
        """
        Of a fix without a covariance; 0: it is not modelled.
        """
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PositionModel:
    """
    Position of an antenna on the body, or of one of its tags; docs/models/position.md.
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
        Linearization (2 x 2) with respect to the point itself (2,) in world.
        """
    @typing.overload
    def predict(
        self, T_world_body: Pose2
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Of the antenna (2,) [m].
        """
    @typing.overload
    def predict(
        self, T_world_body: Pose2, tag: typing.SupportsInt | typing.SupportsIndex
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"] | None:
        """
        Of a tag (2,) [m]; None if it is unknown.
        """

class PoseConfig:
    """
    Sigmas of poses whose localizer tells none, 0 for none; and the least.
    """
    def __init__(self) -> None: ...
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
    def sigma_heading_rad(self) -> float: ...
    @sigma_heading_rad.setter
    def sigma_heading_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_m(self) -> float: ...
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PoseModel:
    """
    Pose from another localizer; docs/models/pose.md.
    """
    @typing.overload
    def __init__(self) -> None: ...
    @typing.overload
    def __init__(self, config: PoseConfig) -> None: ...
    def linearize(self, T_world_body: Pose2, z: PoseObservation) -> Linearization | None:
        """
        Linearization (3 x 3, fewer rows where an axis is not measured); None if nothing is.
        """
    def predict(self, T_world_body: Pose2) -> Pose2: ...

class PositionStatus(enum.IntEnum):
    """
    What range-only positioning can say.
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
    Position at one moment, as `Multilateration.solve` returns it.
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
        Best fit [m]; None if nothing can be said. Look at `status` first.
        """
    @property
    def status(self) -> PositionStatus: ...

class RangePosition3:
    """
    Position at one moment, as `Multilateration.solve` returns it.
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
        Best fit [m]; None if nothing can be said. Look at `status` first.
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
        First order, shape (d, d) [m^2]; infinite if a direction is open.
        """
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Shape (d,) [m].
        """
    @property
    def weak_direction(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Unit vector along which it is least certain.
        """
    @property
    def weak_sigma(self) -> float:
        """
        Sigma along it [m].
        """

class SolverComparison:
    """
    SR-LS beside maximum likelihood on the same ranges.
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
        0 if nothing can be compared.
        """
    @property
    def limit(self) -> float:
        """
        Largest statistic of good ranges.
        """
    @property
    def squared_range_covariance(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        SR-LS's own first-order covariance [m^2].
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
        Squared, in units of its predicted covariance.
        """

class RangeCulprit:
    """
    The range whose removal explains a bad fit best.
    """
    @property
    def explains(self) -> bool:
        """
        The other ranges fit.
        """
    @property
    def index(self) -> int:
        """
        Of the range.
        """
    @property
    def statistic(self) -> float:
        """
        By how much its removal lowers the cost: chi-square of 1 dof.
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
    All that one set of ranges says.
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
        Largest cost of good ranges.
        """
    @property
    def fits(self) -> bool: ...
    @property
    def hypotheses(self) -> list[PositionHypothesis]:
        """
        Everything that fits, by cost.
        """
    @property
    def iterations(self) -> int: ...
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
    Range-only positioning over one set of anchors, prepared once: parameters as in `locate`.
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
        Position from one range per anchor [m]; NaN where not heard.
        """

class Verdict(enum.IntEnum):
    """
    What became of a message.
    """

    FUSED = ...
    GATED = ...
    IGNORED = ...
    IMPLAUSIBLE = ...
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
    def interventions(self) -> int:
        """
        Variances that were put back into their bounds on the way.
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

class NoiseKind(enum.Enum):
    """
    What noise looks like beyond its sigma.
    """

    CAUCHY = ...
    GAUSSIAN = ...
    ONE_SIDED = ...
    STUDENT_T = ...

class NoiseShape:
    """
    Noise as a mixture of Gaussians that are wider than R.

    Parameters
    ----------
    kind : NoiseKind
    dof : float, optional
        Degrees of freedom of STUDENT_T, at least 1.
    late_share : float, optional
        Of the measurements that are too long, by ONE_SIDED; between 0 and 1.

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
        Share, mean and variance of each Gaussian where R is 1, (n, 3); none if Gaussian.
        """

class SlotKind(enum.Enum):
    """
    What a slot of a belief holds.
    """

    POINT2 = ...
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
        From now on no measurement moves this variable: what is not known of it is accounted for, and never learnt (Schmidt).
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
    def sigma_heading(self) -> float:
        """
        [rad].
        """
    @property
    def sigma_position(self) -> float:
        """
        The larger half axis of the position's 1-sigma ellipse [m].
        """
    @property
    def stamp(self) -> int: ...

class PoseHypothesis:
    """
    A pose that fits, one of several.
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
        Beside the others, 0 to 1.
        """

class CalibratedError:
    """
    An error of a robot's sensors, as far as it is known.
    """
    def __repr__(self) -> str: ...
    @property
    def anchor(self) -> int | None:
        """
        Whose error it is, if it is one's.
        """
    @property
    def name(self) -> str: ...
    @property
    def sigma(self) -> float: ...
    @property
    def sigma_start(self) -> float:
        """
        How far off it might have been.
        """
    @property
    def value(self) -> float: ...

class CalibrationConfig:
    """
    Errors of odometry, of the sensor of landmarks and of ranges that a PoseEkf learns: how far off each may be at the start, as a standard deviation. 0: it is right, and no state.
    """
    def __init__(self) -> None: ...
    @property
    def anchor_offset_correlation_s(self) -> float:
        """
        For which those stay alike; 0: for good.
        """
    @anchor_offset_correlation_s.setter
    def anchor_offset_correlation_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def consider(self) -> bool:
        """
        They are accounted for, and none is learnt (Schmidt).
        """
    @consider.setter
    def consider(self, arg0: bool) -> None: ...
    @property
    def sigma_anchor_offset_m(self) -> float:
        """
        Of ranges, for each anchor of the map.
        """
    @sigma_anchor_offset_m.setter
    def sigma_anchor_offset_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_anchor_scale(self) -> float:
        """
        Likewise, added to the anchor's.
        """
    @sigma_anchor_scale.setter
    def sigma_anchor_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_delay_s(self) -> float:
        """
        Of sightings behind their stamps.
        """
    @sigma_delay_s.setter
    def sigma_delay_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_direction_rad(self) -> float:
        """
        Of travel, seen from the heading.
        """
    @sigma_direction_rad.setter
    def sigma_direction_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_range_delay_s(self) -> float:
        """
        Of all ranges behind their stamps.
        """
    @sigma_range_delay_s.setter
    def sigma_range_delay_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_range_offset_m(self) -> float:
        """
        Of ranges to landmarks.
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
        Of the way that odometry tells.
        """
    @sigma_scale.setter
    def sigma_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sensor_m(self) -> float:
        """
        Of the sensor's place in body, x and y.
        """
    @sigma_sensor_m.setter
    def sigma_sensor_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sensor_rad(self) -> float:
        """
        Of the sensor's heading in body.
        """
    @sigma_sensor_rad.setter
    def sigma_sensor_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_bias_radps(self) -> float:
        """
        Of a gyro.
        """
    @sigma_turn_bias_radps.setter
    def sigma_turn_bias_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_bias_radps_per_sqrt_s(self) -> float:
        """
        By which that bias wanders.
        """
    @sigma_turn_bias_radps_per_sqrt_s.setter
    def sigma_turn_bias_radps_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...
    @property
    def sigma_turn_scale(self) -> float:
        """
        Of the turn that odometry tells.
        """
    @sigma_turn_scale.setter
    def sigma_turn_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class AdaptiveNoiseConfig:
    """
    How variances of measurements follow their innovations; factors of what is told.
    """
    def __init__(self) -> None: ...
    @property
    def least(self) -> float: ...
    @least.setter
    def least(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def messages(self) -> float:
        """
        That are remembered, of each kind; 0: variances stay as told.
        """
    @messages.setter
    def messages(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def most(self) -> float: ...
    @most.setter
    def most(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PoseEkfConfig:
    """
    Noise, gates and behaviour of a PoseEkf.
    """

    adaptive: AdaptiveNoiseConfig
    calibration: CalibrationConfig
    landmark: RangeBearingConfig
    limits: Limits
    odometry: OdometryConfig
    pose: PoseConfig
    position: PositionConfig
    range: RangeConfig
    robust_pose: NoiseKind
    robust_position: NoiseKind
    def __init__(self) -> None: ...
    @property
    def gate_landmark(self) -> float: ...
    @gate_landmark.setter
    def gate_landmark(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
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
    def robust_dof(self) -> float:
        """
        Degrees of freedom where that is STUDENT_T.
        """
    @robust_dof.setter
    def robust_dof(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_late_share(self) -> float:
        """
        Of the ranges that are too long, where it is ONE_SIDED.
        """
    @robust_late_share.setter
    def robust_late_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_range(self) -> NoiseKind:
        """
        What noise of ranges looks like.
        """
    @robust_range.setter
    def robust_range(self, arg0: NoiseKind) -> None: ...
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

class LandmarkSight:
    """
    The landmarks that are known, and where on the body the sensor sits that sees them.
    """
    def __init__(self, map: LandmarkMap, sensor_in_body: Pose2 = ...) -> None: ...
    @property
    def sensor_in_body(self) -> Pose2: ...

class Association(enum.Enum):
    """
    Which landmark a sighting without a name is of.
    """

    GLOBAL = ...
    JOINT = ...
    NEAREST = ...

class PoseEkf:
    """
    Extended Kalman filter over (x, y, heading) in world.

    Odometry predicts; ranges, positions, poses and landmarks correct (ekim2020, section 2.1).

    Parameters
    ----------
    config : PoseEkfConfig
    anchors : AnchorMap
    tags : list of Tag
    start : PoseEstimate
    landmarks : LandmarkSight, optional

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
        landmarks: LandmarkSight | None = None,
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
    def on(self, message: PoseObservation) -> Outcome: ...
    @typing.overload
    def on(self, message: RangeBearing) -> Outcome:
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
        Fuses sightings of one stamp; those without a name are put together with landmarks before any is fused. Returns an outcome for each: one that fits none is gated, one whose numbers leave no finite result NOT_MODELLED.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def errors(self) -> list[CalibratedError]:
        """
        What it has learnt of the errors that are states.
        """
    @property
    def interventions(self) -> int:
        """
        How often a variance left its bounds and was put back.
        """
    @property
    def motion_model(self) -> OdometryMotion: ...
    @property
    def range_model(self) -> RangeModel: ...

class AltitudeConfig:
    """
    Where the altimeter sits.
    """
    def __init__(self) -> None: ...
    @property
    def altimeter_up_m(self) -> float:
        """
        Over the body's origin.
        """
    @altimeter_up_m.setter
    def altimeter_up_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class AltitudeModel:
    """
    Height of an altimeter; docs/air.md.
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
    Square roots of spectral densities of white acceleration.
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
        m/s / sqrt(s), of each of the velocity's axes
        """
    @sigma_velocity_per_sqrt_s.setter
    def sigma_velocity_per_sqrt_s(
        self, arg0: typing.SupportsFloat | typing.SupportsIndex
    ) -> None: ...

class ConstantVelocityMotion:
    """
    A body that nobody measures the motion of; docs/models/constant_velocity.md.
    """
    def __init__(self, config: ConstantVelocityConfig) -> None: ...
    def propagate(
        self,
        state: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        seconds: typing.SupportsFloat | typing.SupportsIndex,
    ) -> BodyPropagation:
        """
        (x, y, heading, height, velocity x and y, climb rate), (7,), `seconds` later.
        """

class AirMotion(enum.Enum):
    """
    What carries an AirEkf from one measurement to the next.
    """

    CONSTANT_VELOCITY = ...
    ODOMETRY = ...

class AirEkfConfig:
    """
    Motion, noise, gates and behaviour of an AirEkf.
    """

    altitude: AltitudeConfig
    constant_velocity: ConstantVelocityConfig
    landmark: RangeBearingConfig
    landmark_in_space: RangeBearingInSpace
    limits: Limits
    motion: AirMotion
    odometry: OdometryConfig
    pose: PoseConfig
    position: PositionConfig
    range: RangeConfig
    robust_pose: NoiseKind
    robust_position: NoiseKind
    def __init__(self) -> None: ...
    @property
    def gate_altitude(self) -> float: ...
    @gate_altitude.setter
    def gate_altitude(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_landmark(self) -> float: ...
    @gate_landmark.setter
    def gate_landmark(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
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
    def robust_dof(self) -> float:
        """
        Degrees of freedom where that is STUDENT_T.
        """
    @robust_dof.setter
    def robust_dof(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_late_share(self) -> float:
        """
        Of the ranges that are too long, where it is ONE_SIDED.
        """
    @robust_late_share.setter
    def robust_late_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def robust_range(self) -> NoiseKind:
        """
        What noise of ranges looks like.
        """
    @robust_range.setter
    def robust_range(self, arg0: NoiseKind) -> None: ...
    @property
    def sigma_height_per_sqrt_s(self) -> float:
        """
        Beside a climb rate that was told; m / sqrt(s).
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

class AirEstimate:
    """
    Where a body that flies is at one instant [ns], with the covariance of (x, y, heading, height).
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
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]:
        """
        Shape (4, 4).
        """
    @property
    def height(self) -> float:
        """
        Over z = 0 of the world [m].
        """
    @property
    def pose(self) -> Pose2: ...
    @property
    def stamp(self) -> int: ...

class AirEkf:
    """
    Extended Kalman filter over (x, y, heading, height) of a body that flies.

    It stays level. Odometry with a climb rate carries it, or a constant velocity that it estimates.

    Parameters
    ----------
    config : AirEkfConfig
    anchors : AnchorMap
    tags : list of Tag
    start : AirEstimate
    landmarks : LandmarkSight, optional

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
    >>> ekf = AirEkf(AirEkfConfig(), anchors, [Tag(0, [0, 0, 0])], start)
    >>> ekf.on(Velocity(0, 0.5, 0.0), climb_rate=0.2).verdict.name
    'FUSED'
    >>> ekf.on(Range(1_000_000_000, tag=0, anchor=1, range=4.1)).verdict.name
    'FUSED'
    >>> ekf.on(Altitude(1_000_000_000, height=1.2, sigma=0.1)).verdict.name
    'FUSED'
    """
    def __copy__(self) -> AirEkf:
        """
        A snapshot.
        """
    def __deepcopy__(self, memo: typing.Any) -> AirEkf:
        """
        A snapshot.
        """
    def __init__(
        self,
        config: AirEkfConfig,
        anchors: AnchorMap,
        tags: collections.abc.Sequence[Tag],
        start: AirEstimate,
        landmarks: LandmarkSight | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @typing.overload
    def estimate(self) -> AirEstimate:
        """
        Where it is now: carried to the end of what odometry has told.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> AirEstimate:
        """
        Where it is at `stamp` [ns], not before the belief.
        """
    @typing.overload
    def on(
        self, message: Velocity, climb_rate: typing.SupportsFloat | typing.SupportsIndex = 0.0
    ) -> Outcome: ...
    @typing.overload
    def on(
        self, message: Increment, climb_rate: typing.SupportsFloat | typing.SupportsIndex = 0.0
    ) -> Outcome: ...
    @typing.overload
    def on(self, message: Range) -> Outcome: ...
    @typing.overload
    def on(self, message: PositionFix) -> Outcome: ...
    @typing.overload
    def on(self, message: Altitude) -> Outcome: ...
    @typing.overload
    def on(self, message: PoseObservation) -> Outcome: ...
    @typing.overload
    def on(self, message: RangeBearing) -> Outcome:
        """
        Fuses one message. One that is not fused changes no bit of the estimator. `climb_rate` [m/s] goes with odometry, for as long as that is held.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def interventions(self) -> int:
        """
        How often a variance left its bounds and was put back.
        """

class StartStatus(enum.Enum):
    """
    How far a start has come.
    """

    AMBIGUOUS = ...
    READY = ...
    WAITING = ...

class StartState:
    """
    Where a start stands.
    """
    def __repr__(self) -> str: ...
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        The poses that fit, the likeliest first.
        """
    @property
    def reason(self) -> str:
        """
        Why it is not ready; empty if it is.
        """
    @property
    def status(self) -> StartStatus: ...

class InitializerConfig:
    """
    When a start is ready, and what it takes for wrong.
    """
    def __init__(self) -> None: ...
    @property
    def epoch_s(self) -> float: ...
    @epoch_s.setter
    def epoch_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
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
    def wrong_share(self) -> float: ...
    @wrong_share.setter
    def wrong_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def wrong_span_m(self) -> float: ...
    @wrong_span_m.setter
    def wrong_span_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Initializer:
    """
    Finds the pose of a robot that was switched on anywhere.

    A Gaussian sum: one PoseEkf for every position that the first ranges allow and every heading,
    weighed by how well each predicts what comes next (docs/start.md; ekim2020, section 2.2).

    Parameters
    ----------
    config : InitializerConfig
    estimator : PoseEkfConfig
    anchors : AnchorMap
    tags : list of Tag
    matcher : ScanMatcher, optional
        With it, scans on the map tell the heading; without, motion has to.

    Raises
    ------
    ValueError
        If a config is out of range.

    Examples
    --------
    >>> from locfuse import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 1]), Anchor(2, [8, 0, 1]), Anchor(3, [4, 6, 1])])
    >>> start = Initializer(InitializerConfig(), PoseEkfConfig(), anchors, [Tag(0, [0, 0, 1])])
    >>> start.state().status.name
    'WAITING'
    """
    def __init__(
        self,
        config: InitializerConfig,
        estimator: PoseEkfConfig,
        anchors: AnchorMap,
        tags: collections.abc.Sequence[Tag],
        matcher: ScanMatcher | None = None,
        landmarks: LandmarkSight | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def estimator(self) -> PoseEkf:
        """
        The PoseEkf to go on with.

        Raises
        ------
        ValueError
            Unless the state is ready.
        """
    @typing.overload
    def on(self, message: Velocity) -> None: ...
    @typing.overload
    def on(self, message: Increment) -> None: ...
    @typing.overload
    def on(self, message: Range) -> None: ...
    @typing.overload
    def on(self, message: PositionFix) -> None: ...
    @typing.overload
    def on(self, message: PoseObservation) -> None: ...
    @typing.overload
    def on(self, message: RangeBearing) -> None: ...
    @typing.overload
    def on(self, message: LaserScan) -> None:
        """
        Takes one message.
        """
    def state(self) -> StartState: ...

class KnownLandmark:
    """
    A landmark that a LandmarkEkf knows before the first message. Without a covariance (2, 2) its position [m] is exact.
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
    What a LandmarkEkf says of a landmark.
    """
    def __repr__(self) -> str: ...
    @property
    def confirmed(self) -> bool:
        """
        Whether it corrects the pose.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 2]"]:
        """
        Shape (2, 2) [m^2]; zero if it is exact.
        """
    @property
    def id(self) -> int:
        """
        Negative if no sighting named it.
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
        A tentative landmark is dropped this long after its first sighting.
        """
    @confirm_within_s.setter
    def confirm_within_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_landmark(self) -> float:
        """
        Probability that a sighting passes its landmark's gate.
        """
    @gate_landmark.setter
    def gate_landmark(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_new(self) -> float:
        """
        Only a sighting outside this wider gate of every landmark is of a new one.
        """
    @gate_new.setter
    def gate_new(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_position(self) -> float: ...
    @gate_position.setter
    def gate_position(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        How long the last motion is believed without new odometry.
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_landmarks(self) -> int: ...
    @max_landmarks.setter
    def max_landmarks(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def min_sightings(self) -> int:
        """
        That make a tentative landmark a confirmed one.
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
    Extended Kalman filter over the pose and the landmarks it sees.

    It maps while it localizes: a sighting that no landmark explains puts a new one into the state.

    Parameters
    ----------
    config : LandmarkEkfConfig
    start : PoseEstimate
    sensor_in_body : Pose2, optional
        Where the sensor sits that sees landmarks.
    known : list of KnownLandmark, optional

    Raises
    ------
    ValueError
        If the config is out of range, the start not finite and positive definite, or a landmark is
        given twice.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> start = PoseEstimate(0, Pose2(0, 0, 0), np.diag([0.01, 0.01, 0.01]) ** 2)
    >>> ekf = LandmarkEkf(LandmarkEkfConfig(), start)
    >>> ekf.on(RangeBearing(0, landmark=7, range=2.0, bearing=0.0)).verdict.name
    'FUSED'
    >>> tree = ekf.landmarks()[0]
    >>> tree.id, tree.position.round(3).tolist()
    (7, [2.0, 0.0])
    """
    def __copy__(self) -> LandmarkEkf:
        """
        A snapshot.
        """
    def __deepcopy__(self, memo: typing.Any) -> LandmarkEkf:
        """
        A snapshot.
        """
    def __init__(
        self,
        config: LandmarkEkfConfig,
        start: PoseEstimate,
        sensor_in_body: Pose2 = ...,
        known: collections.abc.Sequence[KnownLandmark] = [],
    ) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @typing.overload
    def estimate(self) -> PoseEstimate:
        """
        The pose now: carried to the end of what odometry has told.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> PoseEstimate:
        """
        The pose at `stamp` [ns], which must not lie before the belief.
        """
    def landmarks(self) -> list[LandmarkEstimate]:
        """
        All landmarks, in the order in which they came in.
        """
    @typing.overload
    def on(self, message: Velocity) -> Outcome: ...
    @typing.overload
    def on(self, message: Increment) -> Outcome: ...
    @typing.overload
    def on(self, message: PositionFix) -> Outcome: ...
    @typing.overload
    def on(self, message: RangeBearing) -> Outcome:
        """
        Fuses one message. One that is not fused changes no bit of the estimator.
        """
    def on_joint(
        self, sightings: collections.abc.Sequence[RangeBearing], association: Association = ...
    ) -> list[Outcome]:
        """
        Fuses sightings of one stamp. Those that no landmark explains are of new ones, or gated if that is not sure. Returns an outcome for each; one whose numbers leave no finite result is NOT_MODELLED.
        """
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def interventions(self) -> int:
        """
        How often a variance left its bounds and was put back.
        """

class HealthState(enum.Enum):
    """
    How far an estimate may be trusted.
    """

    AMBIGUOUS = ...
    DEAD_RECKONING = ...
    DEGRADED = ...
    INITIALIZING = ...
    LOST = ...
    OK = ...

class HealthClue(enum.Enum):
    """
    Why a state is not OK.
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
    Where measurements come from.
    """
    @property
    def kind(self) -> Source: ...
    @property
    def name(self) -> int | None:
        """
        Of the anchor, the tag or the landmark; None without one.
        """

class SourceStatus:
    """
    What became of one source's messages.
    """
    @property
    def accepted(self) -> float:
        """
        Share of the last 32 or so that was fused.
        """
    @property
    def faulty(self) -> float:
        """
        Probability that it is wrong as a whole, if the pose is right.
        """
    @property
    def fused(self) -> int | None:
        """
        Last [ns], or None.
        """
    @property
    def heard(self) -> int:
        """
        Last [ns].
        """
    @property
    def interval(self) -> float:
        """
        Between messages, mean [s].
        """
    @property
    def nis(self) -> float:
        """
        Mean NIS per degree of freedom of what was no outlier.
        """
    @property
    def residual(self) -> float:
        """
        Last innovation's first row.
        """
    @property
    def sigma(self) -> float:
        """
        Of that innovation.
        """
    @property
    def source(self) -> NamedSource: ...
    @property
    def test_ratio(self) -> float:
        """
        Last NIS over the gate's limit: above 1 it was gated.
        """

class HealthReport:
    """
    How far an estimate may be trusted, in numbers.
    """
    def __repr__(self) -> str: ...
    @property
    def clue(self) -> HealthClue: ...
    @property
    def inflation(self) -> float:
        """
        Of the covariance, by innovations larger than believed.
        """
    @property
    def protection(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        |error| in x [m], y [m] and heading [rad] exceeds these with the stated risk at most, (3,); infinite where that cannot be said.
        """
    @property
    def source(self) -> NamedSource | None:
        """
        That the clue names, or None.
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
        Probability that the robot is somewhere else.
        """

class HealthConfig:
    """
    What a Health believes of robots and sources.
    """
    def __init__(self) -> None: ...
    @property
    def aiding_lost_s(self) -> float:
        """
        Without anything fused: dead reckoning [s].
        """
    @aiding_lost_s.setter
    def aiding_lost_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def chance_share(self) -> float:
        """
        Of measurements that fit a pose that is wrong.
        """
    @chance_share.setter
    def chance_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def doubt_s(self) -> float:
        """
        For which it must have been that likely wrong, to be lost [s].
        """
    @doubt_s.setter
    def doubt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def exclude_above(self) -> float:
        """
        A range's source more likely wrong than this is not fused.
        """
    @exclude_above.setter
    def exclude_above(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def faulty_s(self) -> float:
        """
        How long it is, on average [s].
        """
    @faulty_s.setter
    def faulty_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def faulty_share(self) -> float:
        """
        Of the time that a source is wrong as a whole.
        """
    @faulty_share.setter
    def faulty_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def faulty_share_unnamed(self) -> float:
        """
        Likewise of a sensor of landmarks without names.
        """
    @faulty_share_unnamed.setter
    def faulty_share_unnamed(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def invalid_s(self) -> float:
        """
        Likewise: lost [s].
        """
    @invalid_s.setter
    def invalid_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def limit_m(self) -> float:
        """
        Position error that `within` asks about [m].
        """
    @limit_m.setter
    def limit_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def mean_s_between_losses(self) -> float:
        """
        How rarely a robot loses its place [s].
        """
    @mean_s_between_losses.setter
    def mean_s_between_losses(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def probability_found(self) -> float:
        """
        Of being wrong, below which it is not any more.
        """
    @probability_found.setter
    def probability_found(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def probability_lost(self) -> float:
        """
        Of being wrong, from which on it is lost.
        """
    @probability_lost.setter
    def probability_lost(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def risk(self) -> float:
        """
        That an error exceeds its protection level.
        """
    @risk.setter
    def risk(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def wrong_share(self) -> float:
        """
        Of measurements that say nothing, each by itself.
        """
    @wrong_share.setter
    def wrong_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def wrong_span_m(self) -> float:
        """
        What is wrong is wrong by anything up to this [m].
        """
    @wrong_span_m.setter
    def wrong_span_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Health:
    """
    Says how far an estimate may be trusted, from what becomes of measurements.

    One bit says whether the pose is right, one bit for every source whether it is: a hidden Markov
    model (docs/health.md). A RecoveringEkf has one inside; any other estimator may be listened to.

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
    >>> from locfuse import *
    >>> anchors = AnchorMap([Anchor(1, [0, 0, 0]), Anchor(2, [8, 0, 0]), Anchor(3, [4, 6, 0])])
    >>> start = PoseEstimate(0, Pose2(3, 2, 0), 0.01 * np.eye(3))
    >>> ekf = PoseEkf(PoseEkfConfig(), anchors, [Tag(0, [0, 0, 0])], start)
    >>> health = Health(HealthConfig())
    >>> gate = Gate(PoseEkfConfig().gate_range)
    >>> for k in range(30):  # ranges that fit nowhere near
    ...     z = Range(k * 100_000_000, 0, 1 + k % 3, 0.1)
    ...     health.hear(z, ekf.on(z), gate)
    >>> health.is_lost
    True
    """
    def __init__(self, config: HealthConfig) -> None: ...
    def advance(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        Time passes: trust runs out.
        """
    def hear(
        self,
        message: Range | PositionFix | PoseObservation | RangeBearing,
        outcome: Outcome,
        gate: Gate,
    ) -> None:
        """
        Takes what became of a measurement that `gate` judged.
        """
    def report(self, estimate: PoseEstimate) -> HealthReport:
        """
        How far a PoseEstimate, which the measurements heard belong to, may be trusted.
        """
    def start(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        wrong: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    ) -> None:
        """
        The pose is wrong with that probability at `stamp` [ns], and nothing is known of the sources.
        """
    @property
    def is_lost(self) -> bool: ...
    @property
    def sources(self) -> list[SourceStatus]:
        """
        A SourceStatus for each.
        """
    @property
    def wrong(self) -> float:
        """
        Probability that the pose is wrong.
        """

class RecoveringEkfConfig:
    """
    Filter, start and health of a RecoveringEkf.
    """

    estimator: PoseEkfConfig
    health: HealthConfig
    start: InitializerConfig
    def __init__(self) -> None: ...
    @property
    def restart(self) -> bool:
        """
        Whether it looks for another place while it is lost.
        """
    @restart.setter
    def restart(self, arg0: bool) -> None: ...

class RecoveringEkf:
    """
    A PoseEkf that starts by itself, notices when it is lost, and
    starts anew (docs/health.md).

    Until it has started, and beside it while it is lost, landmarks seen together, ranges, fixes and
    poses start hypotheses until one wins.

    Parameters
    ----------
    config : RecoveringEkfConfig
    anchors : AnchorMap, optional
    tags : list of Tag, optional
    matcher : ScanMatcher, optional
        With it, scans on the map tell the heading while it is lost.
    landmarks : LandmarkSight, optional

    Raises
    ------
    ValueError
        If a config is out of range.

    Examples
    --------
    >>> from locfuse import *
    >>> posts = LandmarkMap([Landmark(0, [3, 0]), Landmark(1, [0, 4]), Landmark(2, [-2, 1])])
    >>> ekf = RecoveringEkf(RecoveringEkfConfig(), landmarks=LandmarkSight(posts))
    >>> ekf.is_lost
    True
    >>> _ = ekf.on_joint([RangeBearing(0, None, 3.0, 0.0), RangeBearing(0, None, 4.0, 1.5708),
    ...                   RangeBearing(0, None, 2.2361, 2.6779)])
    >>> ekf.is_lost, abs(round(ekf.state().hypotheses[0].estimate.pose.x, 2))
    (False, 0.0)
    """
    def __init__(
        self,
        config: RecoveringEkfConfig,
        anchors: AnchorMap | None = None,
        tags: collections.abc.Sequence[Tag] = [],
        matcher: ScanMatcher | None = None,
        landmarks: LandmarkSight | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def estimator(self) -> PoseEkf | None:
        """
        A snapshot of the PoseEkf, or None until it has started. While lost, of the place it had.
        """
    def health(self) -> HealthReport:
        """
        A HealthReport: how far its estimate may be trusted.
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
    def on(self, message: PoseObservation) -> Outcome: ...
    @typing.overload
    def on(self, message: RangeBearing) -> Outcome: ...
    @typing.overload
    def on(self, message: LaserScan) -> Outcome:
        """
        Takes one message. Its outcome is IGNORED until it has started.
        """
    def on_joint(
        self, sightings: collections.abc.Sequence[RangeBearing], association: Association = ...
    ) -> list[Outcome]:
        """
        Takes sightings of one stamp. Returns an outcome for each.
        """
    def start_at(self, start: PoseEstimate) -> None:
        """
        Tracks from a PoseEstimate on.

        Raises
        ------
        ValueError
            As a PoseEkf does.
        """
    def start_with(self, ekf: PoseEkf) -> None:
        """
        Tracks on with a PoseEkf that somebody else has started.
        """
    def state(self) -> StartState:
        """
        READY while it tracks; otherwise how far the start has come, with its hypotheses.
        """
    @property
    def alarms(self) -> int:
        """
        How often it noticed that it was lost.
        """
    @property
    def is_lost(self) -> bool:
        """
        Whether there is no estimate to be trusted.
        """
    @property
    def restarts(self) -> int:
        """
        How often it then found another place.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        A SourceStatus for each.
        """

class LikelihoodFieldConfig:
    """
    Where beams end; docs/models/mcl.md.
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
    How far beams go: weights of a mixture; docs/models/beam_model.md.
    """
    @staticmethod
    def zhang() -> BeamModelConfig:
        """
        The mixture of zhang: a Gaussian, and beams without return.
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
    What a scan's likelihood is made of.
    """

    BEAMS = ...
    FIELD = ...

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
    def refine_up_to(self) -> int: ...
    @refine_up_to.setter
    def refine_up_to(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
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

class Mcl:
    """
    Monte Carlo localization on a grid map.

    Scans weigh particles by the likelihood field or the beam model; ranges, positions, poses and
    landmarks may weigh them, too (docs/models/mcl.md). At first the particles are all over the free cells.

    Parameters
    ----------
    config : MclConfig
    grid : OccupancyGrid
    start : int
        Stamp [ns].
    anchors : AnchorMap, optional
    tags : list of Tag, optional
        For ranges.
    landmarks : LandmarkSight, optional

    Raises
    ------
    ValueError
        If the config is out of range or the map has no free or no occupied cell.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import LaserGeometry, LaserScan, Mcl, MclConfig, OccupancyGrid, Pose2
    >>> cells = np.full((60, 80), 0, dtype=np.int8)  # a room of 4 x 3 m with a box in a corner
    >>> cells[[0, -1], :] = cells[:, [0, -1]] = cells[:20, :30] = 100
    >>> mcl = Mcl(MclConfig(), OccupancyGrid(cells, resolution=0.05))
    >>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
    >>> mcl.on(LaserScan(0, around, [0.9, 0.9, 2.9, 0.9])).verdict.name
    'FUSED'
    >>> mcl.ready
    False
    """
    def __copy__(self) -> Mcl:
        """
        A snapshot.
        """
    def __deepcopy__(self, memo: typing.Any) -> Mcl: ...
    def __init__(
        self,
        config: MclConfig,
        grid: OccupancyGrid,
        start: typing.SupportsInt | typing.SupportsIndex = 0,
        anchors: AnchorMap | None = None,
        tags: collections.abc.Sequence[Tag] = [],
        landmarks: LandmarkSight | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def estimate(self) -> PoseEstimate:
        """
        The likeliest cluster, carried to the end of what odometry has told.
        """
    def health(self) -> HealthReport:
        """
        How far its estimate may be trusted; docs/health.md.
        """
    def inject(
        self, pose: PoseEstimate, share: typing.SupportsFloat | typing.SupportsIndex = 1.0
    ) -> None:
        """
        Replaces a share of the particles, evenly, by draws from a PoseEstimate that somebody else is sure of, at a stamp that is not before the last message; odometry goes on.

        Raises
        ------
        ValueError
            If the covariance is not positive definite, the stamp too early, or not 0 < share <= 1.
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
    def on(self, message: PoseObservation) -> Outcome: ...
    @typing.overload
    def on(self, message: RangeBearing) -> Outcome: ...
    @typing.overload
    def on(self, message: LaserScan) -> Outcome:
        """
        Takes one message.
        """
    def spread(self) -> PoseEstimate:
        """
        The same with the covariance of all particles about their mean, whatever cluster they are in.
        """
    def start_anywhere(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        Starts anew, anywhere in free space.
        """
    def start_at(self, hypotheses: collections.abc.Sequence[PoseHypothesis]) -> None:
        """
        Starts anew near poses, a list of PoseHypothesis; those of an Initializer will do.

        Raises
        ------
        ValueError
            On a list without poses, or one that is not finite.
        """
    def start_with(
        self,
        stamp: typing.SupportsInt | typing.SupportsIndex,
        particles: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> None:
        """
        Starts anew with particles, float64 (n, 4) as in `particles`; the weights need not sum to 1.

        Raises
        ------
        ValueError
            On another shape, on numbers that are not finite, on weights that are negative or all 0.
        """
    @property
    def explained(self) -> float:
        """
        Share of the last scan's returns that end at a wall.
        """
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        Clusters of particles, a list of PoseHypothesis, the likeliest first.
        """
    @property
    def particles(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        float64 (n, 4): x, y [m], heading [rad] in world, weight.
        """
    @property
    def ready(self) -> bool:
        """
        Whether one cluster is all but certain.
        """
    @property
    def sigma_hit(self) -> float:
        """
        How far end points lie beside walls, as scans tell [m].
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        A SourceStatus for each.
        """
    @property
    def used_share(self) -> float:
        """
        Share of the last measurement's information that was used.
        """

class Doubt(enum.Enum):
    """
    Why scans are in doubt.
    """

    ELSEWHERE = ...
    NONE = ...
    UNCERTAIN = ...

class SwitchingMclConfig:
    """
    When UWB takes over from scans.
    """
    def __init__(self) -> None: ...
    @property
    def doubt_s(self) -> float:
        """
        That doubt must last [s].
        """
    @doubt_s.setter
    def doubt_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def elsewhere_m(self) -> float:
        """
        Off UWB by more than this and three sigmas: in doubt [m].
        """
    @elsewhere_m.setter
    def elsewhere_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def elsewhere_rad(self) -> float:
        """
        Likewise turned [rad].
        """
    @elsewhere_rad.setter
    def elsewhere_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def share(self) -> float:
        """
        Of the particles that are replaced.
        """
    @share.setter
    def share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_sure_m(self) -> float:
        """
        Below it no longer [m].
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
        Of the particles, in their worst direction: in doubt [m].
        """
    @sigma_unsure_m.setter
    def sigma_unsure_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_unsure_rad(self) -> float:
        """
        Likewise of the heading.
        """
    @sigma_unsure_rad.setter
    def sigma_unsure_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_age_s(self) -> float:
        """
        Since the last range or fix that was fused, likewise [s].
        """
    @uwb_age_s.setter
    def uwb_age_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_nis(self) -> float:
        """
        NIS of the last ranges or fixes per row, on average, at most, likewise.
        """
    @uwb_nis.setter
    def uwb_nis(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_sigma_m(self) -> float:
        """
        Of the pose by UWB, at most, to be of use [m].
        """
    @uwb_sigma_m.setter
    def uwb_sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def uwb_sigma_rad(self) -> float:
        """
        Likewise [rad].
        """
    @uwb_sigma_rad.setter
    def uwb_sigma_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Injection:
    """
    UWB took over from scans.
    """
    def __repr__(self) -> str: ...
    @property
    def after(self) -> PoseEstimate:
        """
        By UWB.
        """
    @property
    def before(self) -> PoseEstimate:
        """
        With the covariance of all particles.
        """
    @property
    def doubt(self) -> Doubt: ...
    @property
    def stamp(self) -> int: ...

class SwitchingMcl:
    """
    An Mcl that UWB rescues (celan2017, sections III.C and V.B).

    Scans alone tell of the pose while they leave no doubt; where they do, the pose by UWB and odometry
    becomes the particles' belief (docs/models/switching_mcl.md). Ranges and fixes go to a
    RecoveringEkf beside the particles, which starts by itself and knows when it is lost.

    Parameters
    ----------
    config : SwitchingMclConfig
    mcl : Mcl
        Is copied, as is `uwb`.
    uwb : RecoveringEkf

    Raises
    ------
    ValueError
        If the config is out of range, or a threshold could fire for ever: `sure` must lie below
        `unsure`, and a pose by UWB that is of use must be sure.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> cells = np.full((60, 80), 0, dtype=np.int8)
    >>> cells[[0, -1], :] = cells[:, [0, -1]] = 100
    >>> mcl = Mcl(MclConfig(), OccupancyGrid(cells, resolution=0.05))  # anywhere in a room of 4 x 3 m
    >>> uwb = RecoveringEkf(RecoveringEkfConfig())
    >>> uwb.start_at(PoseEstimate(0, Pose2(1.0, 1.0, 0.0), np.diag([0.1, 0.1, 0.1]) ** 2))
    >>> switching = SwitchingMcl(SwitchingMclConfig(), mcl, uwb)
    >>> around = LaserGeometry(Pose2(), 0.0, np.pi / 2, range_min=0.1, range_max=10.0)
    >>> for second in range(4):
    ...     _ = switching.on(Velocity(second * 10**9, 0.0, 0.0))
    ...     _ = switching.on(PositionFix(second * 10**9, [1.0, 1.0], 0.01 * np.eye(2)))
    ...     _ = switching.on(LaserScan(second * 10**9, around, [2.95, 1.95, 0.95, 0.95]))
    >>> [(i.doubt.name, i.stamp // 10**9) for i in switching.injections]
    [('UNCERTAIN', 2)]
    """
    def __copy__(self) -> SwitchingMcl:
        """
        A snapshot.
        """
    def __deepcopy__(self, memo: typing.Any) -> SwitchingMcl: ...
    def __init__(self, config: SwitchingMclConfig, mcl: Mcl, uwb: RecoveringEkf) -> None: ...
    def __repr__(self) -> str: ...
    def estimate(self) -> PoseEstimate:
        """
        Of the particles, carried to the end of what odometry has told.
        """
    def health(self) -> HealthReport:
        """
        How far that may be trusted, by what particles were weighed with.
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
    def on(self, message: PoseObservation) -> Outcome: ...
    @typing.overload
    def on(self, message: RangeBearing) -> Outcome: ...
    @typing.overload
    def on(self, message: LaserScan) -> Outcome:
        """
        Takes one message. Ranges and fixes go to UWB's filter, all else weighs particles.
        """
    @property
    def hypotheses(self) -> list[PoseHypothesis]:
        """
        Clusters of particles, a list of PoseHypothesis, the likeliest first.
        """
    @property
    def injections(self) -> list[Injection]:
        """
        When UWB took over, a list of Injection.
        """
    @property
    def mcl(self) -> Mcl:
        """
        A snapshot of the particles.
        """
    @property
    def ready(self) -> bool:
        """
        Whether one cluster of particles is all but certain.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        A SourceStatus for each that weighs particles.
        """
    @property
    def uwb(self) -> RecoveringEkf:
        """
        A snapshot of UWB's filter.
        """
    @property
    def uwb_nis(self) -> float:
        """
        NIS of the last ranges or fixes per row, on average: 1 where UWB's filter is right.
        """

class RigidFitStatus(enum.Enum):
    """
    How a rigid fit went.
    """

    FITTED = ...
    MIRRORED = ...
    NOT_CONVERGED = ...
    NO_DIRECTION = ...

class RigidFit:
    """
    The pose of a rigid body whose points were measured.
    """
    def __repr__(self) -> str: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Of (x, y, heading), shape (3, 3).
        """
    @property
    def dof(self) -> int:
        """
        Of nis: 2 n - 3.
        """
    @property
    def nis(self) -> float:
        """
        How badly the points fit a rigid body.
        """
    @property
    def pose(self) -> Pose2:
        """
        T_world_body; NaN without a direction.
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
    What wheels err by, which points of the body share, and what each errs by itself.
    """
    def __init__(self) -> None: ...
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
        Each point, each axis; > 0.
        """
    @sigma_point_mps.setter
    def sigma_point_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def sigma_turn_rate_radps(self) -> float: ...
    @sigma_turn_rate_radps.setter
    def sigma_turn_rate_radps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class PointDistanceConfig:
    """
    How well a distance is known.
    """
    def __init__(self) -> None: ...
    @property
    def sigma_m(self) -> float: ...
    @sigma_m.setter
    def sigma_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class VelocityModel:
    """
    Velocities of points on a body as its wheels tell them; docs/models/velocity.md.
    """
    @staticmethod
    def predict(
        heading: typing.SupportsFloat | typing.SupportsIndex,
        twist: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        point_in_body: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"],
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        In world (2,) [m/s], of a body with `twist` (forward [m/s], left [m/s], turn rate [rad/s]).
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
    A known distance between two points; docs/models/point_distance.md.
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
        Linearization (1 x 4) with respect to (a, b); None if they lie together.
        """

class TagOrderVerdict(enum.Enum):
    """
    Whether fixes of three tags fit their triangle.
    """

    AMBIGUOUS = ...
    FITS = ...
    NO_FIT = ...
    SWAPPED = ...

class TagOrder:
    """
    Which tag is which, as fixes of one epoch tell.
    """
    def __repr__(self) -> str: ...
    def __str__(self) -> str: ...
    @property
    def best(self) -> float:
        """
        nis of `ids`.
        """
    @property
    def given(self) -> typing.Annotated[list[int], "FixedSize(3)"]:
        """
        The ids of the fixes.
        """
    @property
    def ids(self) -> typing.Annotated[list[int], "FixedSize(3)"]:
        """
        Those that fit best, in the order of the fixes.
        """
    @property
    def limit(self) -> float:
        """
        What that may be.
        """
    @property
    def nis(self) -> float:
        """
        Of the ids given, 3 degrees of freedom.
        """
    @property
    def verdict(self) -> TagOrderVerdict: ...

class TagVerdict(enum.Enum):
    """
    What became of a fix of an RTLS.
    """

    FROZEN = ...
    JUMP = ...
    PASSED = ...
    RESTARTED = ...
    STALE = ...
    UNKNOWN_TAG = ...

class ConditionedFix:
    """
    A fix of an RTLS and what became of it.
    """
    def __repr__(self) -> str: ...
    @property
    def fix(self) -> PositionFix | None:
        """
        Bias removed, low-passed; None unless it passed.
        """
    @property
    def verdict(self) -> TagVerdict: ...

class TagConditionerConfig:
    """
    What an RTLS does, and what the machine can do.
    """
    def __init__(self) -> None: ...
    @property
    def bias_x_m(self) -> float:
        """
        Taken from every fix, in world.
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
        Of the low-pass; 0 is none.
        """
    @cutoff_hz.setter
    def cutoff_hz(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def frozen_motion_m(self) -> float:
        """
        A tag that went further has another fix.
        """
    @frozen_motion_m.setter
    def frozen_motion_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def hold_s(self) -> float:
        """
        How long a velocity is believed without a new one.
        """
    @hold_s.setter
    def hold_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def jump_margin_m(self) -> float:
        """
        Beyond what that speed allows.
        """
    @jump_margin_m.setter
    def jump_margin_m(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_speed_mps(self) -> float:
        """
        Of a tag.
        """
    @max_speed_mps.setter
    def max_speed_mps(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def restart_after(self) -> int:
        """
        Jumps in a row.
        """
    @restart_after.setter
    def restart_after(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class TagConditioner:
    """
    Conditions the fixes of an RTLS, tag by tag, before a filter sees them.

    Takes a constant bias off, rejects jumps and values that are stuck, and low-passes the rest;
    docs/models/tag_triangle_ekf.md.

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
        Wheel odometry, which tells how far each tag went.
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
    def gate_position(self) -> float:
        """
        Probability that a good fix passes.
        """
    @gate_position.setter
    def gate_position(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_range(self) -> float: ...
    @gate_range.setter
    def gate_range(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_side(self) -> float: ...
    @gate_side.setter
    def gate_side(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def gate_velocity(self) -> float: ...
    @gate_velocity.setter
    def gate_velocity(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def heading_is_known(self) -> bool:
        """
        Whether wheels turn to velocities by a heading without error, as in the paper; else by that of the tags, with its Jacobian.
        """
    @heading_is_known.setter
    def heading_is_known(self, arg0: bool) -> None: ...
    @property
    def sides_m(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"] | None:
        """
        None, or (3,) from tag 0 to 1, 1 to 2, 2 to 0 as a tape tells.
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

    The 12-state filter of celan2017, section III.D: fixes of the tags, the velocities that wheel
    odometry gives them, the sides of their triangle; docs/models/tag_triangle_ekf.md. Slots are
    `tag0.position` to `tag2.position`, then `tag0.velocity` to `tag2.velocity`.

    Parameters
    ----------
    config : TagTriangleEkfConfig
    tags : list of Tag
        Three that make a triangle.
    start : PoseEstimate or list of PositionFix
        A pose, or a fix of each tag with one stamp.
    anchors : AnchorMap, optional
        For ranges.

    Raises
    ------
    ValueError
        If the config is out of range, the tags make no triangle, the start is not finite and positive
        definite, or fixes do not fit the triangle; the text names the order of ids that would.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> tags = [Tag(1, [0.6, 0, 1]), Tag(2, [-0.3, 0.2, 1]), Tag(3, [-0.3, -0.2, 1])]
    >>> start = PoseEstimate(0, Pose2(3, 2, 0), np.diag([0.2, 0.2, 0.1]) ** 2)
    >>> ekf = TagTriangleEkf(TagTriangleEkfConfig(), tags, start)
    >>> ekf.on(Velocity(100_000_000, 0.3, 0.0)).verdict.name
    'FUSED'
    >>> ekf.on(PositionFix(1_000_000_000, [3.9, 2.0], 0.04 * np.eye(2), tag=1)).verdict.name
    'FUSED'
    """
    def __copy__(self) -> TagTriangleEkf:
        """
        A snapshot.
        """
    def __deepcopy__(self, memo: typing.Any) -> TagTriangleEkf:
        """
        A snapshot.
        """
    @typing.overload
    def __init__(
        self,
        config: TagTriangleEkfConfig,
        tags: collections.abc.Sequence[Tag],
        start: PoseEstimate,
        anchors: AnchorMap | None = None,
    ) -> None: ...
    @typing.overload
    def __init__(
        self,
        config: TagTriangleEkfConfig,
        tags: collections.abc.Sequence[Tag],
        start: collections.abc.Sequence[PositionFix],
        anchors: AnchorMap | None = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def advance_to(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @typing.overload
    def estimate(self) -> PoseEstimate:
        """
        The belief at its own stamp.
        """
    @typing.overload
    def estimate(self, stamp: typing.SupportsInt | typing.SupportsIndex) -> PoseEstimate:
        """
        The belief carried to `stamp` [ns], which must not lie before it.
        """
    def fit(self) -> RigidFit:
        """
        The body on the tags; its nis tells how rigid they are.
        """
    def hold_sides(self) -> Outcome:
        """
        Fuses the three sides where the belief is: for who has no odometry.
        """
    @typing.overload
    def on(self, message: PositionFix) -> Outcome: ...
    @typing.overload
    def on(self, message: Velocity) -> Outcome: ...
    @typing.overload
    def on(self, message: Increment) -> Outcome: ...
    @typing.overload
    def on(self, message: Range) -> Outcome:
        """
        Fuses one message. One that is not fused changes no bit of the estimator. Odometry is followed by the sides of the triangle.
        """
    def pose(self) -> Pose2: ...
    @property
    def belief(self) -> GaussianBelief: ...
    @property
    def interventions(self) -> int:
        """
        How often a variance left its bounds and was put back.
        """
    @property
    def sides(self) -> Outcome:
        """
        What became of the three sides that were fused last.
        """
    @property
    def tags(self) -> list[Tag]: ...

class MessageLog:
    """
    Recorded messages, added as columns.

    Every `add_...` takes arrays of equal length; `arrival_ns`, where given, is when each message
    reaches the estimator, otherwise it arrives when it takes effect. A row that is not valid raises
    ValueError, names the row, and nothing is added; ids and stamps that are not integers raise
    TypeError. A log that another thread adds to, sorts or replays raises RuntimeError; several threads
    may replay it at once.
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
        Poses (n, 3): x, y [m], heading [rad], with their sigmas. Both -1, or both 0: not known; 1000 and more: not measured.
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
        Positions (n, 2) [m] with one sigma [m] each, of the antenna, or of the tags with these ids (n,); a negative id is the antenna. Sigma -1 or 0: not known; 1000 and more: not measured.
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
    def add_sightings(
        self,
        stamp_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64],
        landmark: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        range: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        bearing: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        sigma_range: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        sigma_bearing: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None,
        arrival_ns: typing.Annotated[numpy.typing.ArrayLike, numpy.int64] | None = None,
    ) -> None:
        """
        Landmarks by id (-1: not known which), range [m] and bearing [rad], NaN where not measured, with their sigmas.
        """
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

class ClockJump(enum.Enum):
    """
    What to do when the clock of all messages goes back.
    """

    CONTINUE = ...
    REFUSE = ...
    RESET = ...

class RunLog:
    """
    What a replay leaves behind, as columns.
    """
    def __repr__(self) -> str: ...
    def noise_factor(self, source: Source) -> float:
        """
        Factor of the variances of a Source by then: 1 unless adaptive.
        """
    @property
    def alarms(self) -> int:
        """
        How often it was lost.
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
        Errors that are states, as learnt by then.
        """
    @property
    def fallen_out(self) -> int:
        """
        Messages inside the history that were forgotten: there were too many.
        """
    @property
    def health_clue(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthClue, (k,).
        """
    @property
    def health_source(self) -> list[NamedSource | None]:
        """
        The source that the clue names, or None: k of them.
        """
    @property
    def health_stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of what is said of health, (k,).
        """
    @property
    def health_state(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthState, (k,).
        """
    @property
    def interventions(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Variances put back into their bounds, per message.
        """
    @property
    def jumps(self) -> int:
        """
        How often the clock went back; estimates are those after the last.
        """
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
    def protection(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Protection levels of x, y [m] and heading [rad], (k, 3).
        """
    @property
    def residual(self) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def restarts(self) -> int:
        """
        How often it then found another place.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        A SourceStatus for each, at the end of the log.
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
    def within(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the position error is below the limit, (k,).
        """
    @property
    def wrong(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the robot is somewhere else, (k,).
        """

class StartStep:
    """
    A change on the way to a start.
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
    How a start went.
    """
    @property
    def steps(self) -> list[StartStep]:
        """
        Whenever status or number of hypotheses changed.
        """
    @property
    def used_until(self) -> int:
        """
        Messages that take effect up to this stamp were used [ns].
        """

class LocalizeRun:
    """
    How a localization on a map went, as columns.
    """
    def __repr__(self) -> str: ...
    @property
    def covariances(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        (n, 3, 3).
        """
    @property
    def explained(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Share of the scan's returns that end at a wall, (n,).
        """
    @property
    def health_clue(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthClue, (k,).
        """
    @property
    def health_source(self) -> list[NamedSource | None]:
        """
        The source that the clue names, or None: k of them.
        """
    @property
    def health_stamp_ns(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Stamps of what is said of health, (k,).
        """
    @property
    def health_state(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Index into HealthState, (k,).
        """
    @property
    def particles(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        How many, (n,).
        """
    @property
    def poses(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        x, y, heading, (n, 3).
        """
    @property
    def probability(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Of the likeliest hypothesis, (n,).
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
    def scan_verdict(self) -> numpy.typing.NDArray[numpy.uint8]:
        """
        Likewise, one per scan.
        """
    @property
    def sigma(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Of all particles, in their worst direction [m], (n,).
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
    def within(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the position error is below the limit, (k,).
        """
    @property
    def wrong(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Probability that the robot is somewhere else, (k,).
        """

class Live:
    """
    A RecoveringEkf on a robot: messages as they arrive, from the first one on.

    It searches until one place is left; from there late messages are fused where they belong. Fed with
    a log in its order of arrival it gives the estimates of `find_start` and `replay`, bit for bit, if
    none came later than `patience` while it searched.

    Parameters
    ----------
    estimator : RecoveringEkf
        It tracks from the beginning if this one has started.
    history : int
        How late a message may be once it tracks, nanoseconds.
    clock_jump : ClockJump
        What to do when the clock of all messages goes back.
    most_messages : int
        Held for late ones, at least 512.
    patience : int
        How late a message may be while it searches, nanoseconds.

    Raises
    ------
    ValueError
        If an option is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from locfuse import *
    >>> live = Live(RecoveringEkf(RecoveringEkfConfig()))
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
        most_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
        patience: typing.SupportsInt | typing.SupportsIndex = 250000000,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def current(self) -> PoseEstimate:
        """
        The PoseEstimate at the stamp of the last message. Raises RuntimeError while it searches.
        """
    def enable(self, source: Source, enabled: bool) -> None:
        """
        Switches a Source off, or on again: while it is off its messages are IGNORED.
        """
    def estimate(self) -> PoseEstimate:
        """
        Likewise, carried to the end of odometry.
        """
    def health(self) -> HealthReport:
        """
        A HealthReport: how far its estimate may be trusted.
        """
    @typing.overload
    def on(self, scan: LaserScan) -> None:
        """
        Takes a scan, which is of use while it searches.
        """
    @typing.overload
    def on(
        self, message: Velocity | Increment | Range | PositionFix | PoseObservation | RangeBearing
    ) -> Outcome:
        """
        Takes a message and returns its Outcome.

        IGNORED while it searches and from a source that is off, STALE if it is too late.

        Raises
        ------
        ValueError
            If the message is not valid; it is forgotten.
        """
    def relocalize(self) -> None:
        """
        Forgets the pose and searches anew.
        """
    def reset(self) -> None:
        """
        As it was made.
        """
    def search(self) -> StartState:
        """
        How far the search has come, with its hypotheses.
        """
    def start_at(self, start: PoseEstimate) -> None:
        """
        Tracks from a PoseEstimate on, whatever was known before.
        """
    @property
    def errors(self) -> list[CalibratedError]:
        """
        A CalibratedError for each error that is a state, as learnt by now.
        """
    @property
    def fallen_out(self) -> int:
        """
        Messages inside the history that were forgotten: too many.
        """
    @property
    def is_tracking(self) -> bool: ...
    @property
    def jumps(self) -> int:
        """
        How often the clock went back and it started anew or went on.
        """
    @property
    def restarts(self) -> int:
        """
        How often it was lost and found another place.
        """
    @property
    def sources(self) -> list[SourceStatus]:
        """
        A SourceStatus for each.
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

def closest_beam(
    scan: LaserScan,
    first: typing.SupportsInt | typing.SupportsIndex,
    last: typing.SupportsInt | typing.SupportsIndex,
    radius: typing.SupportsFloat | typing.SupportsIndex,
) -> BeamLandmark:
    """
    Centre of a cylinder by its closest beam (wells eq. 8-11).

    Parameters
    ----------
    scan : LaserScan
    first, last : int
        Beams of the cylinder; `first` above `last` goes across the end of the scan.
    radius : float
        Added to the least range [m].

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
    The compiler that made the core, such as 'GCC 12.2.0'.
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
        Where the tag might be [m].
    sigma : float or array, shape (m,)
        Standard deviation of the ranges [m].
    height : float, optional
        Known height of the tag [m].

    Returns
    -------
    array, shape (k, d, d)
        Least covariance of any unbiased estimator [m^2]; infinite on the diagonal where the ranges
        leave a direction open.

    Examples
    --------
    >>> import numpy as np, locfuse
    >>> anchors = np.array([[10.0, 0.0], [0.0, 10.0]])
    >>> locfuse.cramer_rao(anchors, [[0.0, 0.0]], 0.1).round(6).tolist()
    [[[0.01, 0.0], [0.0, 0.01]]]
    """

def find_start(
    initializer: Initializer, log: MessageLog, scans: collections.abc.Sequence[LaserScan]
) -> StartRun:
    """
    Feeds a sorted log and scans until the initializer is ready or both end.
    """

def kernels() -> str:
    """
    Which kernels run here: 'avx2', with fused products and sums, or 'portable'. Both do the same, but for the last bits.
    """

def local(
    to: Pose2, origin: Pose2
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
    """
    Error state (3,) that leads from `origin` to `to`, heading wrapped.
    """

@typing.overload
def localize(
    mcl: Mcl,
    log: MessageLog,
    scans: collections.abc.Sequence[LaserScan],
    progress: collections.abc.Callable[[int, collections.abc.Callable[[], LocalizeRun]], None]
    | None = None,
) -> LocalizeRun: ...
@typing.overload
def localize(
    mcl: SwitchingMcl,
    log: MessageLog,
    scans: collections.abc.Sequence[LaserScan],
    progress: collections.abc.Callable[[int, collections.abc.Callable[[], LocalizeRun]], None]
    | None = None,
) -> LocalizeRun:
    """
    Feeds a log and scans to an Mcl in order of the stamps at which they take effect.

    Parameters
    ----------
    mcl : Mcl or SwitchingMcl
    log : MessageLog
    scans : list of LaserScan
    progress : callable, optional
        Told after each scan (messages and scans done, what returns a copy of the run so far while it
        is told); it may look at `mcl`. What is not done yet has the verdict IGNORED.
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
    ml: str = "ceres",
    wrong_side_probability: typing.SupportsFloat | typing.SupportsIndex = 1e-06,
    false_alarm_probability: typing.SupportsFloat | typing.SupportsIndex = 0.001,
    max_iterations: typing.SupportsInt | typing.SupportsIndex = 50,
) -> PositionSolution:
    """
    Position from ranges: SR-LS and maximum likelihood side by side, and everything that fits.

    Parameters
    ----------
    anchors : array, shape (m, 2) or (m, 3)
        Positions of the anchors [m]; (m, 3) with `height`.
    ranges : array, shape (m,)
        One per anchor [m].
    sigma : float or array, shape (m,)
        Standard deviation of the ranges [m].
    height : float, optional
        Known height of the tag [m]: the position is sought in the plane.
    loss : {'none', 'huber', 'cauchy', 'one_sided'}
        What residuals cost; 'one_sided' is for ranges that read long.
    loss_scale : float, optional
        Where it departs from the square [sigmas]; by default 95 % efficient.
    prior : (mean, sigma), optional
        What is known before, per axis [m]; an infinite sigma for nothing.
    box : (low, high), optional
        Ends of a box that the position is in [m].
    weights : {'equal', 'variance'}
        SR-LS or SR-WLS.
    ml : {'ceres', 'fast'}
        Which solver does maximum likelihood.

    Returns
    -------
    PositionSolution
        Derivation: docs/models/multilateration.md.

    Raises
    ------
    ValueError
        On numbers that are not finite, ranges or sigmas that are not positive, wrong shapes.

    Examples
    --------
    >>> import numpy as np, locfuse
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
    solver: str = "ml",
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
        One row per epoch [m]; NaN where an anchor was not heard.
    sigma : float or array, shape (m,)
        Standard deviation of the ranges [m].
    height : float, optional
        Known height of the tag [m].
    solver : {'ml', 'srls', 'srwls', 'ceres'}
        Maximum likelihood started by SR-LS, SR-LS or SR-WLS alone, or Ceres.
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
    >>> import numpy as np, locfuse
    >>> anchors = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    >>> truth = np.array([[3.0, 4.0], [6.0, 1.0]])
    >>> ranges = np.linalg.norm(truth[:, None] - anchors, axis=2)
    >>> locfuse.locate_batch(anchors, ranges).position.round(6).tolist()
    [[3.0, 4.0], [6.0, 1.0]]
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
        line and the column, both from 1. Or if names would take more than 64 MB and 16 times the
        text, as each takes as much as the longest of its column.

    Examples
    --------
    >>> stamp_ns, name = parse_table(b"stamp_s,tag\\n1.25,left\\n", "st", ",", 2, "example")
    >>> int(stamp_ns[0]), str(name[0])
    (1250000000, 'left')
    """

@typing.overload
def predict(belief: GaussianBelief, step: Propagation, slot: Slot) -> None:
    """
    Moves the pose in `slot`: P to F P F' + Q with its cross-covariances.
    """

@typing.overload
def predict(
    belief: GaussianBelief, step: BodyPropagation, slots: collections.abc.Sequence[Slot]
) -> None:
    """
    Moves the first variables of `slots`, as many as the step moves, by a motion of your own.

    It may depend on all of them: P to F P F' + Q with their cross-covariances.

    Raises
    ------
    ValueError
        If the slots do not match the step.
    NumericalError
        If a result is not finite or a variance not positive; the belief is untouched.
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
        One per landmark in order of id; the range is that to the surface, as the beam says it.

    Raises
    ------
    ValueError
        If scan or pose are not valid.
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
    most_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
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
    most_messages: typing.SupportsInt | typing.SupportsIndex = 100000,
    switches: collections.abc.Sequence[
        tuple[typing.SupportsInt | typing.SupportsIndex, Source, bool]
    ] = [],
) -> RunLog:
    """
    Feeds a sorted log to a copy of an estimator; late messages are fused where they belong.

    Parameters
    ----------
    start : PoseEkf or RecoveringEkf
        The latter must have started.
    log : MessageLog
    history : int
        How late a message may be, nanoseconds; older ones are stale.
    record : bool
        Keep outcomes and estimates, or only the last estimate.
    progress : callable, optional
        Told now and then (messages done, what returns a copy of the run so far while it is told): the
        outcomes of those messages, which late ones may still change, and the estimates.
    used_until : int, optional
        Messages that take effect up to this stamp [ns] were used for the start: they keep the verdict
        IGNORED.
    clock_jump : ClockJump
        What to do when the clock of all messages goes back.
    most_messages : int
        Held for late ones, at least 512; what falls out is counted.
    switches : list of (int, Source, bool)
        From this arrival [ns] on a source is off (False) or on again.
    """

def rigid_fit(
    body: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    world: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
) -> RigidFit:
    """
    Return the pose that takes points of a body to where they were measured.

    Least squares weighted with the covariance; docs/models/rigid_fit.md.

    Parameters
    ----------
    body : array, shape (n, 2)
        Metres, in body; at least two that differ.
    world : array, shape (n, 2)
        Metres, in world.
    covariance : array, shape (2 n, 2 n) or (n, 2, 2)
        Of `world` [m^2]: of (x0, y0, x1, y1, ...), or of each point where they share nothing.

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
    >>> from locfuse import rigid_fit
    >>> fit = rigid_fit([[1, 0], [-1, 0]], [[2, 4], [2, 2]], 0.01 * np.eye(4))
    >>> round(fit.pose.x, 6), round(fit.pose.y, 6), round(fit.pose.heading, 6)
    (2.0, 3.0, 1.570796)
    """

def tag_order(
    tags: collections.abc.Sequence[Tag],
    fixes: collections.abc.Sequence[PositionFix],
    probability: typing.SupportsFloat | typing.SupportsIndex = 0.999,
) -> TagOrder:
    """
    Try the fixes of three tags of one epoch on their triangle in every order.

    Parameters
    ----------
    tags : list of Tag
        Three.
    fixes : list of PositionFix
        One of each, of one stamp.
    probability : float
        Of a right order to pass.

    Returns
    -------
    TagOrder
        Its text names the ids that would fit.

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
        Updated whole or not at all.
    linearization : Linearization
        From a model of the library or made by hand.
    slots : list of Slot
        Variables that the Jacobian's columns stand for, in order.
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
    The same direction in [-pi, pi) [rad].
    """

__version__: str = "0.1.0"
