# SPDX-License-Identifier: Apache-2.0
"""Every name of the compiled core: messages, maps, models, front ends, filters and estimators.

`locfuse` itself has the names that a user needs first. The rest is here: models and their
settings, motion, the verdicts and reasons of front ends, single steps of filters.

>>> import locfuse.core as lf
>>> lf.arc(1.0, 0.0, 0.0)
Pose2(x=1, y=0, heading=0)
"""

from locfuse._core import *  # noqa: F403

# parse_table reads the columns of a CSV file for locfuse.io.
__all__ = [name for name in dir() if not name.startswith("_") and name != "parse_table"]
