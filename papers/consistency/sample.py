# SPDX-License-Identifier: Apache-2.0
"""Errors of one seed in units of an estimator's own covariance: NEES and NIS."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from locfuse import _core
from locfuse.types import FloatArray, wrap_angle

Model = TypeVar("Model", bound=BaseModel)
Squared = tuple[float, int]  # a sum of normalised squares, and of how many components


@dataclass
class Sample:
    """One run.

    Attributes
    ----------
    nees : dict of group to (e' P^-1 e, components)
        Of the errors at the end.
    nis : dict of source to (sum over what was fused, rows in all)
    """

    nees: dict[str, Squared] = field(default_factory=dict)
    nis: dict[str, Squared] = field(default_factory=dict)

    def add(self, source: str, outcome: _core.Outcome) -> None:
        """Count the innovation of a message that was fused."""
        if outcome.verdict == _core.Verdict.FUSED and outcome.dof > 0:
            total, rows = self.nis.get(source, (0.0, 0))
            self.nis[source] = (total + outcome.nis, rows + outcome.dof)


def nees_of(
    error: FloatArray, covariance: FloatArray, groups: Mapping[str, Iterable[int]]
) -> dict[str, Squared]:
    """Return the NEES of some components each, and of all of them where there is another."""
    parts = {name: list(rows) for name, rows in groups.items()}
    parts["all"] = list(range(len(error)))
    return {
        name: (float(error[rows] @ np.linalg.solve(covariance[np.ix_(rows, rows)], error[rows])),
               len(rows))
        for name, rows in parts.items()
    }  # fmt: skip


def pose_nees(truth: FloatArray, estimate: _core.PoseEstimate) -> dict[str, Squared]:
    """Return the NEES of an estimated pose; truth is (x, y, heading)."""
    pose = estimate.pose
    error = np.array([truth[0] - pose.x, truth[1] - pose.y,
                      float(wrap_angle(truth[2] - pose.heading))])  # fmt: skip
    return nees_of(error, estimate.covariance, {"position": (0, 1), "heading": (2,)})


def with_sigmas_times(model: Model, factor: float) -> Model:
    """Return a model of a configuration with every sigma in it times `factor`."""
    changed: dict[str, Any] = {}
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            changed[name] = with_sigmas_times(value, factor)
        elif name.startswith("sigma_"):
            changed[name] = factor * value
    return model.model_copy(update=changed)
