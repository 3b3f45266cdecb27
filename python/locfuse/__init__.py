# SPDX-License-Identifier: Apache-2.0
"""Localization for mobile robots: UWB ranges, odometry, positions and poses fused honestly.

The names that a user needs first; `locfuse.core` has every name of the compiled core.
"""

import logging as _logging
from types import ModuleType as _Module

from locfuse._core import AirEkf as AirEkf
from locfuse._core import AirEkfConfig as AirEkfConfig
from locfuse._core import AirEstimate as AirEstimate
from locfuse._core import Altitude as Altitude
from locfuse._core import Anchor as Anchor
from locfuse._core import AnchorMap as AnchorMap
from locfuse._core import CylinderDetector as CylinderDetector
from locfuse._core import Gate as Gate
from locfuse._core import GaussianBelief as GaussianBelief
from locfuse._core import Heading as Heading
from locfuse._core import HealthState as HealthState
from locfuse._core import Increment as Increment
from locfuse._core import Initializer as Initializer
from locfuse._core import InitializerConfig as InitializerConfig
from locfuse._core import Landmark as Landmark
from locfuse._core import LandmarkEkf as LandmarkEkf
from locfuse._core import LandmarkEkfConfig as LandmarkEkfConfig
from locfuse._core import LandmarkMap as LandmarkMap
from locfuse._core import LandmarkSensor as LandmarkSensor
from locfuse._core import LaserGeometry as LaserGeometry
from locfuse._core import LaserScan as LaserScan
from locfuse._core import Linearization as Linearization
from locfuse._core import Live as Live
from locfuse._core import Mcl as Mcl
from locfuse._core import MclConfig as MclConfig
from locfuse._core import MessageLog as MessageLog
from locfuse._core import NumericalError as NumericalError
from locfuse._core import OccupancyGrid as OccupancyGrid
from locfuse._core import Outcome as Outcome
from locfuse._core import Pose2 as Pose2
from locfuse._core import PoseEkf as PoseEkf
from locfuse._core import PoseEkfConfig as PoseEkfConfig
from locfuse._core import PoseEstimate as PoseEstimate
from locfuse._core import PoseObservation as PoseObservation
from locfuse._core import PositionFix as PositionFix
from locfuse._core import Range as Range
from locfuse._core import RangeBearing as RangeBearing
from locfuse._core import RecoveringEkf as RecoveringEkf
from locfuse._core import RecoveringEkfConfig as RecoveringEkfConfig
from locfuse._core import ScanMatcher as ScanMatcher
from locfuse._core import ScanOdometry as ScanOdometry
from locfuse._core import SlotKind as SlotKind
from locfuse._core import SwitchingMcl as SwitchingMcl
from locfuse._core import SwitchingMclConfig as SwitchingMclConfig
from locfuse._core import Tag as Tag
from locfuse._core import Velocity as Velocity
from locfuse._core import Verdict as Verdict
from locfuse._core import World as World
from locfuse._core import __version__ as __version__
from locfuse._core import localize as localize
from locfuse._core import locate as locate
from locfuse._core import locate_batch as locate_batch
from locfuse._core import predict as predict
from locfuse._core import replay as replay
from locfuse._core import update as update
from locfuse.types import ConfigError as ConfigError
from locfuse.types import Log as Log
from locfuse.types import LogError as LogError
from locfuse.types import RunResult as RunResult
from locfuse.types import Trajectory as Trajectory

_logging.getLogger(__name__).addHandler(_logging.NullHandler())

__all__ = sorted(
    name
    for name, value in vars().items()
    if name == "__version__" or not (name.startswith("_") or isinstance(value, _Module))
)
