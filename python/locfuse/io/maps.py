# SPDX-License-Identifier: Apache-2.0
"""Grid maps as ROS keeps them: a YAML file beside a picture."""

from __future__ import annotations

import difflib
import io
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import read_bytes
from locfuse.io.log_yaml import load_yaml, number
from locfuse.io.whole import whole_file, write_whole
from locfuse.types import (
    FARTHEST_M,
    FREE,
    OCCUPIED,
    RESOLUTIONS_M,
    UNKNOWN,
    FloatArray,
    GridMap,
    LogError,
    shown,
)

KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
MODES = ("trinary", "scale", "raw")
SHADES: Mapping[int, int] = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}  # those of ROS's map_saver
YAML = """\
image: {image}
mode: trinary
resolution: {resolution!r}
origin: [{origin[0]!r}, {origin[1]!r}, {origin[2]!r}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def read_map(path: str | Path, free_thresh: float | None = None) -> GridMap:
    """Read a map of ROS's map_server.

    A pixel of brightness v in 0..255 is occupied with probability p = (255 - v) / 255, or v / 255
    with ``negate``: above ``occupied_thresh`` the cell is occupied, below ``free_thresh`` free,
    otherwise unknown. Mode ``scale``, whose steps between free and occupied are unknown as well
    here, gives the same; in both a transparent pixel is unknown. In mode ``raw`` v is p in percent,
    and above 100 unknown. Other keys than map_server's are left alone.

    Parameters
    ----------
    path : str or Path
        Of the YAML file. The picture is PGM (P2 or P5) or PNG, named relative to it; its lowest row
        is row 0 of the cells.
    free_thresh : float, optional
        Instead of the file's: 0.196 keeps the shade 205 unknown where newer ROS 2 tools wrote 0.25.

    Raises
    ------
    LogError
        If a file cannot be read or a key is missing, misspelt or out of bounds; the text names the
        file and the key.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     text = "P2 2 1 255  0 255"
    ...     _ = Path(folder, "map.pgm").write_text(text)
    ...     _ = Path(folder, "map.yaml").write_text(YAML.format(
    ...         image="map.pgm", resolution=0.05, origin=(0.0, 0.0, 0.0)))
    ...     read_map(Path(folder, "map.yaml")).cells.tolist()
    [[100, 0]]
    """
    path = Path(path)
    settings = load_yaml(path)
    if free_thresh is not None and isinstance(settings, Mapping):
        settings = {**settings, "free_thresh": free_thresh}
    settings = _checked(settings, str(path))
    picture = _read_picture(path.parent / settings["image"])
    cells = _meanings(picture.brightness, settings)[picture.codes]
    if picture.opaque is not None and settings["mode"] != "raw":
        cells[~picture.opaque] = UNKNOWN
    return GridMap(cells[::-1].copy(), settings["resolution"], settings["origin"])


def write_map(grid: GridMap, path: str | Path) -> None:
    """Write a map that `read_map` reads back bit for bit: a YAML file and a PGM beside it.

    `path` is that of the YAML file; the picture has its name, but for the ending ``.pgm``.
    """
    path = Path(path)
    shades = np.empty(grid.cells.shape, np.uint8)
    for cell, shade in SHADES.items():
        shades[grid.cells == cell] = shade
    height, width = len(shades), len(shades[0])
    image = path.with_suffix(".pgm")
    with whole_file(image) as file:
        file.write_bytes(f"P5\n{width} {height}\n255\n".encode() + shades[::-1].tobytes())
    origin = tuple(float(part) for part in grid.origin)
    text = YAML.format(image=image.name, resolution=float(grid.resolution_m), origin=origin)
    write_whole(path, text)


def _checked(found: Any, where: str) -> dict[str, Any]:
    """Return the settings with numbers as float, or raise LogError."""
    if not isinstance(found, Mapping):
        raise LogError(f"{where}: {shown(found)}, expected keys {', '.join(KEYS)}")
    absent = [key for key in (*KEYS, "mode") if key not in found]
    for key in found:  # a file may hold more, but a misspelt key would be lost in silence
        for meant in difflib.get_close_matches(key, absent, n=1, cutoff=0.75):
            raise LogError(f"{where}: unknown key {shown(key)}; did you mean {meant!r}?")
    for key in absent:
        if key != "mode":
            raise LogError(f"{where}: {key} is missing")
    settings = {"mode": "trinary", **found}
    if not isinstance(settings["image"], str) or not settings["image"]:
        raise LogError(f"{where}: image is {shown(settings['image'])}, expected a file name")
    if settings["mode"] not in MODES:
        expected = ", ".join(MODES)
        raise LogError(f"{where}: mode is {shown(settings['mode'])}, expected one of {expected}")
    if settings["negate"] not in (0, 1):
        raise LogError(f"{where}: negate is {shown(settings['negate'])}, expected 0 or 1")
    for key in ("resolution", "occupied_thresh", "free_thresh"):
        settings[key] = number(settings[key], f"{where}: {key}")
    least, most = RESOLUTIONS_M
    if not least <= settings["resolution"] <= most:
        raise LogError(f"{where}: resolution is {settings['resolution']:g}, expected {least:g} to "
                       f"{most:g} m")  # fmt: skip
    low, high = settings["free_thresh"], settings["occupied_thresh"]
    if not 0.0 <= low <= high <= 1.0:
        raise LogError(f"{where}: free_thresh and occupied_thresh are {low:g} and {high:g}, "
                       "expected 0 <= free <= occupied <= 1")  # fmt: skip
    origin = settings["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        raise LogError(f"{where}: origin is {shown(origin)}, expected [x_m, y_m, yaw_rad]")
    settings["origin"] = tuple(number(part, f"{where}: origin") for part in origin)
    if max(map(abs, settings["origin"])) > FARTHEST_M:
        raise LogError(
            f"{where}: origin is {shown(origin)}, expected numbers within {FARTHEST_M:g}"
        )
    return settings


class _Picture(NamedTuple):
    """Codes of pixels, first row on top, and what they mean: far fewer numbers than pixels.

    ``brightness`` is that of each code, in 0..255; ``opaque`` is None if all pixels are.
    """

    codes: NDArray[Any]
    brightness: FloatArray
    opaque: NDArray[np.bool_] | None = None


def _meanings(brightness: FloatArray, settings: Mapping[str, Any]) -> NDArray[np.int8]:
    """Return what a cell of each brightness holds."""
    shade = 255.0 - brightness if settings["negate"] else brightness
    occupied, known = (255.0 - shade) / 255.0, np.ones(shade.shape, np.bool_)
    if settings["mode"] == "raw":
        occupied, known = shade / 100.0, shade <= 100.0
    cells = np.full(shade.shape, UNKNOWN, np.int8)
    cells[known & (occupied > settings["occupied_thresh"])] = OCCUPIED
    cells[known & (occupied < settings["free_thresh"])] = FREE
    return cells


def _read_picture(path: Path) -> _Picture:
    data = read_bytes(path)
    if data[:2] in (b"P2", b"P5"):
        return _pgm(data, path)
    if data.startswith(b"\x89PNG"):
        return _png(data, path)
    raise LogError(f"{path}: neither PGM (P2 or P5) nor PNG, it begins with {data[:8]!r}")


def _pgm(data: bytes, path: Path) -> _Picture:
    space = rb"(?:\s|#[^\n]*\n){1,1000}"  # without end, each would take memory
    match = re.match(rb"P[25]" + 3 * (space + rb"(\d{1,9})") + rb"\s", data)
    if match is None:
        raise LogError(f"{path}: no PGM header, expected P2 or P5, width, height and maximum")
    width, height, maximum = (int(number) for number in match.groups())
    if not (width > 0 and height > 0 and 0 < maximum < 65536):
        raise LogError(f"{path}: {width} x {height} pixels up to {maximum}, expected at least "
                       "1 x 1 up to 1..65535")  # fmt: skip
    body = data[match.end() :]
    pixels: NDArray[Any]
    if data[:2] == b"P5":
        dtype = np.dtype(np.uint8 if maximum < 256 else ">u2")
        pixels = np.frombuffer(body[: len(body) - len(body) % dtype.itemsize], dtype)
    else:
        words = re.sub(rb"#[^\n]*", b"", body).split()
        if not all(word.isdigit() for word in words):
            odd = next(word for word in words if not word.isdigit())
            raise LogError(f"{path}: {odd[:20].decode('ascii', 'replace')!r} is no pixel")
        pixels = np.array(words, np.float64)
    if len(pixels) < width * height:
        raise LogError(f"{path}: {len(pixels)} pixels, its header says {width} x {height}")
    values = pixels[: width * height].reshape(height, width)
    if values.max() > maximum:
        raise LogError(f"{path}: a pixel of {values.max():g}, its header says at most {maximum}")
    return _Picture(values.astype(np.uint16), np.arange(maximum + 1) * 255.0 / maximum)


def _png(data: bytes, path: Path) -> _Picture:
    try:  # loads slowly, and most maps are PGM
        from PIL import Image, UnidentifiedImageError
    except ModuleNotFoundError:
        raise LogError(
            f"{path}: a PNG needs the package Pillow: pip install 'locfuse[plots]'; a PGM does not"
        ) from None

    too_large = (Image.DecompressionBombWarning, Image.DecompressionBombError)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(data), formats=("PNG",))
            is_grey = image.mode.startswith("I")  # of 16 bits
            pixels = np.asarray(image if is_grey else image.convert("RGBA"))
    except UnidentifiedImageError:  # its text names a memory address
        raise LogError(f"{path}: cannot be read: is no PNG") from None
    except (OSError, SyntaxError, ValueError, LookupError, *too_large) as error:
        raise LogError(f"{path}: cannot be read: {error}") from error
    if is_grey:
        return _Picture(pixels.astype(np.uint16), np.arange(65536) / 257.0)
    sums = pixels[:, :, :3].sum(axis=2, dtype=np.uint16)
    return _Picture(sums, np.arange(3 * 255 + 1) / 3.0, pixels[:, :, 3] == 255)
