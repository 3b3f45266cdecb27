# SPDX-License-Identifier: Apache-2.0
"""The frame of a survey, and what differs from a list of anchors that was there before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations

import numpy as np

from locfuse.types import Columns, FloatArray, LogError

OF_LIST = "the frame is that of anchors.csv, onto which the survey is laid as a whole"
NOT_LIKE_THE_LIST = ("the anchors found do not lie to one another as anchors.csv says: is it of "
                     "another place, or are units or odometry wrong?")  # fmt: skip
_MEASURED_M = 0.02  # sigma of a coordinate that was measured by hand
_SLACK_M = 0.1  # of what is still no contradiction
_OFF_M = 0.3  # a place nearer to the list than this is the list's
_ALIKE_M = 0.6  # a place this near to one of the list may be that, with a wrong height
_UNSURE_M = 1.0  # and not more for want of sureness
_PAIRS = 12  # of anchors, the widest ones, by which a list is recognized


@dataclass(frozen=True)
class Framed:
    """Anchors in the frame of a survey.

    `position` has shape (n, 3), `covariance` (3n, 3n). `pose` is that of the frame of the start in
    this one: x, y [m] and heading [rad]; before that, y is taken times `side`, which is -1 where
    a list shows that all was mirrored, 0 where nothing shows it.
    """

    names: list[str]
    position: FloatArray
    covariance: FloatArray
    sentence: str
    pose: FloatArray = field(default_factory=lambda: np.zeros(3))
    side: int = 1

    @property
    def turn(self) -> float:
        """How much the frame of the start is turned in this one [rad]."""
        return float(self.pose[2])

    def moved(self, points: FloatArray) -> FloatArray:
        """Return points of the frame of the start, shape (n, 3), in this one."""
        return _moved(points * [1.0, self.sign, 1.0], self.pose)

    @property
    def sign(self) -> float:
        """What y is taken times."""
        return -1.0 if self.side < 0 else 1.0

    @property
    def rotation(self) -> FloatArray:
        """What a direction of the frame of the start is multiplied by, shape (2, 2)."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        rotation: FloatArray = np.array([[c, -s], [s, c]]) * [1.0, self.sign]
        return rotation

    def sigma(self, row: int) -> float:
        """Return the sigma of a place along the axis in the plane that is known least [m]."""
        P = self.covariance[3 * row : 3 * row + 2, 3 * row : 3 * row + 2]
        return float(np.sqrt(max(np.linalg.eigvalsh(P)[-1], 0.0)))


@dataclass(frozen=True)
class Wanted:
    """Which frame is asked for.

    Attributes
    ----------
    measured : dict of arrays or None
        With x and y of at least two anchors it is the frame, and corrects the others.
    frame : (str, str) or None
        The origin, and an anchor on the positive x axis.
    listed : dict of arrays or None
        A list that the result is laid onto as a whole.
    of_start : str
        The sentence of the frame where there is none of these.
    is_given : bool
        Whether positions or poses give that, so that no list is needed.
    is_side_open : bool
        Whether all may be mirrored: a list of three anchors shows it.
    two_places : frozenset of str
        Anchors that may be elsewhere, and give no frame.
    """

    measured: Columns | None
    frame: tuple[str, str] | None
    listed: Columns | None
    of_start: str
    is_given: bool
    is_side_open: bool
    two_places: frozenset[str] = frozenset()

    def of(self, names: list[str], position: FloatArray, covariance: FloatArray) -> Framed:
        """Return anchors (n, 3) of the frame of the start, with their covariance, in it."""
        side = _side(names, position, covariance, self.listed) if self.is_side_open else 1
        if side < 0:
            flip = np.tile([1.0, -1.0, 1.0], len(names))
            position = position * [1.0, -1.0, 1.0]
            covariance = flip[:, None] * covariance * flip
        return replace(self._of(names, position, covariance), side=side)

    def _of(self, names: list[str], position: FloatArray, covariance: FloatArray) -> Framed:
        known = [] if self.measured is None else _rows(names, self.measured)
        if why := self._lacks(names, known):
            return Framed(names, position, covariance, f"{why}: {self.of_start}")
        if len(known) >= 2:
            return _by_measured(names, position, covariance, known)
        if self.frame is not None:
            a, b = (names.index(name) for name in self.frame)
            sentence = f"the origin is {self.frame[0]}, x points to {self.frame[1]}"
            return _laid(names, position, covariance, sentence, lambda at: _onto_axis(at, a, b))
        is_list_wanted = self.frame is None and not self.is_given and not self.two_places
        if self.listed is not None and is_list_wanted:
            rows = _recognized(names, position, covariance, self.listed)
            if len(rows) >= 2:
                return _onto_list(names, position, covariance, rows, _listed(self.listed))
        return Framed(names, position, covariance, self.of_start)

    def _lacks(self, names: list[str], known: list[tuple[int, FloatArray]]) -> str:
        """Return why the frame that is asked for cannot be had; empty if it can."""
        places = {} if self.measured is None else _listed(self.measured)
        asked = [*places, *(self.frame or ())]
        if open_ones := sorted(self.two_places & set(asked)):
            return f"{', '.join(open_ones)} may be in two places and give no frame"
        missing = sorted(set(self.frame or ()) - set(names))
        if missing:
            return f"{', '.join(missing)} is not placed and gives no frame"
        if places and len(known) < 2:
            return "x and y of two anchors that are placed make a frame, fewer are measured"
        return ""


def _side(
    names: list[str], position: FloatArray, covariance: FloatArray, listed: Columns | None
) -> int:
    """Return 1 or -1 where a list says so by at least three anchors, else 0."""
    if listed is None:
        return 0
    places = _listed(listed)
    found = {}
    for side in (1, -1):
        at = position * [1.0, side, 1.0]
        rows = _recognized(names, at, covariance, listed)
        if len(rows) >= 3:
            laid = _onto_list(names, at, covariance, rows, places)
            off = [laid.position[names.index(a), :2] - places[b] for a, b in rows.items()]
            error = float(np.sqrt(np.mean(np.square(off))))
            found[side] = (len(rows), sum(a == b for a, b in rows.items()), -error)
    if not found:
        return 0
    best = max(found, key=lambda side: found[side])
    other = found.get(-best)
    clear = other is None or found[best][:2] > other[:2] or 2.0 * found[best][2] > other[2]
    return best if clear else 0


def differences(framed: Framed, listed: Columns | None) -> tuple[str, ...]:
    """Say which anchors of a list are swapped, and which stand elsewhere."""
    if listed is None or framed.side == 0:
        return ()
    places = {name: at for name, at in _listed(listed).items() if name in framed.names}
    if len(places) < 3:
        return ()
    rows = _recognized(framed.names, framed.position, framed.covariance, listed)
    if len(rows) < 2 or (len(rows) == 2 and len(places) > 3):
        return (NOT_LIKE_THE_LIST,)
    laid = _onto_list(framed.names, framed.position, framed.covariance, rows, _listed(listed))
    at = {name: laid.position[i, :2] for i, name in enumerate(laid.names)}
    sigma = {name: laid.sigma(i) for i, name in enumerate(laid.names)}
    limit = {name: limit_of(sigma[name]) for name in at}
    off = [name for name in places if np.hypot(*(at[name] - places[name])) > limit[name]]
    stands_at: dict[str, str] = {}
    for name in off:
        near = min((other for other in off if other != name), default=None,
                   key=lambda other: float(np.hypot(*(at[name] - places[other]))))  # fmt: skip
        if near is not None and np.hypot(*(at[name] - places[near])) <= limit[name]:
            stands_at[name] = near
    sentences = []
    for a, b in combinations(off, 2):
        if stands_at.get(a) == b and stands_at.get(b) == a:
            sentences.append(f"anchors {a} and {b} are swapped in anchors.csv: each stands where "
                             "the other should")  # fmt: skip
            off = [name for name in off if name not in (a, b)]
    for name in off:
        if name in stands_at:
            sentences.append(f"anchor {name} stands where anchors.csv has {stands_at[name]}")
            continue
        far = float(np.hypot(*(at[name] - places[name])))
        sentences.append(f"anchor {name} stands {far:.2f} m from where anchors.csv has it (sigma "
                         f"{sigma[name]:.2f} m): it was moved, or its place or height is "
                         "wrong")  # fmt: skip
    return tuple(sentences)


def limit_of(sigma_m: float) -> float:
    """Return how far a place may be from that of a list which it does not refute, metres."""
    return max(_OFF_M, 3.0 * sigma_m)


def _listed(table: Columns) -> dict[str, FloatArray]:
    rows = zip(table["anchor"].tolist(), table["x_m"].tolist(), table["y_m"].tolist(), strict=True)
    return {str(name): np.array([x, y]) for name, x, y in rows if np.isfinite(x + y)}


def _rows(names: list[str], table: Columns) -> list[tuple[int, FloatArray]]:
    return [(names.index(name), at) for name, at in _listed(table).items() if name in names]


def _moved(points: FloatArray, pose: FloatArray) -> FloatArray:
    """Return points (n, 3) turned by pose[2] and shifted by pose[:2]."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = points[:, 0], points[:, 1]
    return np.column_stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y, points[:, 2]])


def _fit(points: FloatArray, onto: FloatArray) -> FloatArray:
    """Return the (x, y, turn) that lays points (n, 2) onto others by least squares."""
    a, b = points.mean(axis=0), onto.mean(axis=0)
    p, q = points - a, onto - b
    turn = np.arctan2(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]), np.sum(p * q))
    c, s = np.cos(turn), np.sin(turn)
    return np.array([*(b - np.array([c * a[0] - s * a[1], s * a[0] + c * a[1]])), turn])


def _onto_list(
    names: list[str], position: FloatArray, covariance: FloatArray, rows: dict[str, str],
    places: dict[str, FloatArray],
) -> Framed:  # fmt: skip
    mine = [names.index(name) for name in rows]
    theirs = np.array([places[place] for place in rows.values()])
    return _laid(names, position, covariance, OF_LIST, lambda at: _fit(at[mine, :2], theirs))


def _onto_axis(at: FloatArray, a: int, b: int) -> FloatArray:
    base = at[b, :2] - at[a, :2]
    length = np.hypot(*base)
    return (
        _fit(at[[a, b], :2], np.array([[0.0, 0.0], [length, 0.0]])) if length > 0 else np.zeros(3)
    )


def _laid(
    names: list[str], position: FloatArray, covariance: FloatArray, sentence: str,
    pose_of: Callable[[FloatArray], FloatArray],
) -> Framed:  # fmt: skip
    """Return anchors in the frame that `pose_of` makes of them, with their covariance in it."""
    n = len(names)

    def moved(flat: FloatArray) -> FloatArray:
        at = flat.reshape(n, 3)
        return _moved(at, pose_of(at)).ravel()

    J = _jacobian(moved, position.ravel())
    return Framed(names, moved(position.ravel()).reshape(n, 3), J @ covariance @ J.T, sentence,
                  pose_of(position))  # fmt: skip


def _by_measured(
    names: list[str], position: FloatArray, covariance: FloatArray,
    known: list[tuple[int, FloatArray]],
) -> Framed:  # fmt: skip
    """Return anchors as they are where some were measured: an iterated Kalman update."""
    _check_measured(names, position, covariance, known)
    n = len(names)
    rows = [row for row, _ in known]
    z = np.concatenate([at for _, at in known])
    pose = _fit(position[rows, :2], z.reshape(-1, 2))
    prior = np.concatenate([pose, position.ravel()])
    P = np.zeros((3 + 3 * n, 3 + 3 * n))
    P[:3, :3] = np.diag([1e6, 1e6, 1e2])
    P[3:, 3:] = covariance
    R = _MEASURED_M**2 * np.eye(len(z))

    def predict(x: FloatArray) -> FloatArray:
        return _moved(x[3:].reshape(n, 3)[rows], x[:3])[:, :2].ravel()

    x = prior
    for _ in range(10):
        H = _jacobian(predict, x)
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        x = prior + K @ (z - predict(x) - H @ (prior - x))
    left = np.eye(len(x)) - K @ H
    P = left @ P @ left.T + K @ R @ K.T

    def out(x: FloatArray) -> FloatArray:
        return _moved(x[3:].reshape(n, 3), x[:3]).ravel()

    J = _jacobian(out, x)
    measured = ", ".join(names[row] for row in rows)
    return Framed(
        names,
        out(x).reshape(n, 3),
        J @ P @ J.T,
        f"the frame is that in which {measured} were measured",
        x[:3],
    )


def _check_measured(
    names: list[str], position: FloatArray, covariance: FloatArray,
    known: list[tuple[int, FloatArray]],
) -> None:  # fmt: skip
    """Raise LogError where places that were measured do not lie to one another as those found."""
    rows = [row for row, _ in known]
    onto = np.array([at for _, at in known])
    laid = _laid(names, position, covariance, "", lambda at: _fit(at[rows, :2], onto))
    off = np.hypot(*(laid.position[rows, :2] - onto).T)
    limit = 4.0 * np.array([np.hypot(laid.sigma(row), _MEASURED_M) for row in rows]) + _SLACK_M
    worst = int(np.argmax(off / limit))
    if off[worst] > limit[worst]:
        what = ", ".join(names[row] for row in rows)
        raise LogError(f"the measured places of {what} contradict the drive, which lays "
                       f"{names[rows[worst]]} {off[worst]:.2f} m elsewhere; are names, numbers or "
                       "heights mixed up?")  # fmt: skip


def _jacobian(function: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Return the derivatives of a function, by differences."""
    columns = []
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-5
        columns.append((function(x + step) - function(x - step)) / 2e-5)
    return np.array(columns).T


def stands_for(framed: Framed, listed: Columns | None) -> dict[str, str]:
    """Return the anchors that stand where a list has another one, and that one."""
    if listed is None:
        return {}
    rows = _recognized(framed.names, framed.position, framed.covariance, listed)
    found = {name: place for name, place in rows.items() if name != place}
    # One that is not recognized, as its height is wrong, may be in the place of the one in its.
    free = {
        place: name
        for name, place in found.items()
        if place in framed.names and place not in rows and name not in rows.values()
    }
    return found | free


def _recognized(
    names: list[str], position: FloatArray, covariance: FloatArray, listed: Columns
) -> dict[str, str]:
    """Return which anchors stand in places of a list, and what those are called.

    The motion that lays most anchors onto places of the list, and of equal ones most onto those of
    their names. Reflections are none.
    """
    places = _listed(listed)
    called = list(places)
    if len(names) < 2 or len(called) < 2:
        return {}
    itself = _laid(names, position, covariance, "", lambda at: _fit(at[:, :2], position[:, :2]))
    unsure = min(3.0 * max(itself.sigma(row) for row in range(len(names))), _UNSURE_M)
    theirs = np.array(list(places.values())).reshape(-1, 2)
    mine = position[:, :2]
    pairs = sorted(combinations(range(len(names)), 2),
                   key=lambda pair: -float(np.hypot(*(mine[pair[0]] - mine[pair[1]]))))  # fmt: skip
    best: tuple[tuple[int, int, float], dict[str, str]] = ((0, 0, 0.0), {})
    for a, b in pairs[:_PAIRS]:
        length = float(np.hypot(*(mine[a] - mine[b])))
        tolerance = max(_ALIKE_M, 0.05 * length) + unsure
        for p, q in permutations(range(len(called)), 2):
            if abs(float(np.hypot(*(theirs[p] - theirs[q]))) - length) > tolerance:
                continue
            pose = _fit(mine[[a, b]], theirs[[p, q]])
            laid = _moved(position, pose)[:, :2]
            apart = np.hypot(*(laid[:, None] - theirs[None]).transpose(2, 0, 1))
            fits = _pairs_of(apart, tolerance)
            named = sum(names[i] == called[k] for i, k in fits)
            score = (len(fits), named, -sum(float(apart[i, k]) for i, k in fits))
            if score > best[0]:
                best = (score, {names[i]: called[k] for i, k in fits})
    return best[1]


def _pairs_of(apart: FloatArray, tolerance: float) -> list[tuple[int, int]]:
    """Return pairs of rows and columns, each in one pair, the nearest ones first."""
    left = apart.copy()
    pairs = []
    while left.size and left.min() < tolerance:
        i, k = (int(n) for n in np.unravel_index(np.argmin(left), left.shape))
        pairs.append((i, k))
        left[i, :] = left[:, k] = np.inf
    return pairs
