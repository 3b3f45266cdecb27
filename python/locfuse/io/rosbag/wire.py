# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes and back, by rosbags, which knows the types of both ROS."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from locfuse.io.rosbag.container import Connection, need, short
from locfuse.types import NANOSECONDS, LogError

LONGEST_ARRAY = 1000  # of fixed length, of messages or texts
NO_PACKAGE = {
    # of tf2_msgs, which rosbags does not count as one of ROS 1
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n"
}


@cache
def definitions() -> Mapping[str, str]:
    """Return the texts that define our own messages, by type."""
    folder = files("locfuse.io.rosbag") / "msg"
    return {f"locfuse_msgs/msg/{file.name.removesuffix('.msg')}": file.read_text("utf-8")
            for file in folder.iterdir() if file.name.endswith(".msg")}  # fmt: skip


@cache
def store(encoding: str) -> Any:
    """Return the types that either ROS has, and ours; `encoding` is ``ros1`` or ``cdr``.

    Raises LogError if rosbags is not installed.
    """
    typesys = need("rosbags.typesys")
    stores = typesys.Stores
    found = typesys.get_typestore(stores.ROS1_NOETIC if encoding == "ros1" else stores.ROS2_HUMBLE)
    types = {}
    for name, text in {**NO_PACKAGE, **definitions()}.items():
        if name not in found.types:
            types.update(typesys.get_types_from_msg(text, name))
    found.register(types)
    return found


def long(name: str) -> str:
    """Return the name of a type as rosbags has it.

    Examples
    --------
    >>> long("nav_msgs/Odometry")
    'nav_msgs/msg/Odometry'
    """
    return "/msg/".join(name.split("/")) if name.count("/") == 1 else name


@cache
def deserializer(connection: Connection) -> Callable[[bytes], Any]:
    """Return the function that deserializes the messages of a connection.

    It uses the bag's own definition of the type, or that of ROS where the bag has none, and raises
    one of `broken()` where bytes do not fit it. Raises LogError if neither the bag nor ROS defines
    the type, or the definition cannot be used.
    """
    name = long(connection.type)
    types = store(connection.encoding)
    if connection.definition:
        typesys = need("rosbags.typesys")
        types = typesys.get_typestore(typesys.Stores.EMPTY)
        try:
            fields = _definition(connection)
            _check_arrays(fields, name)
            types.register(fields)
            types.get_msgdef(name)
        except (typesys.TypesysError, KeyError, ValueError, RecursionError) as error:
            raise _unusable(connection, error) from error
    else:
        _definition(connection)
    if connection.encoding == "ros1":
        return lambda data: types.deserialize_ros1(data, name)
    return lambda data: types.deserialize_cdr(data, name)


@cache
def _definition(connection: Connection) -> Mapping[str, Any]:
    """Return the fields of the type of a connection, and of those that it is made of."""
    name = long(connection.type)
    if connection.encoding not in ("ros1", "cdr"):
        raise LogError(
            f"{connection.type} is encoded as {connection.encoding!r}, expected ros1 or cdr"
        )
    if not connection.definition:
        known: Mapping[str, Any] = store(connection.encoding).fielddefs
        if name not in known:
            raise LogError(f"nothing defines {short(name)}: the bag brings no definition of it")
        return known
    typesys = need("rosbags.typesys")
    try:
        found = (typesys.get_types_from_idl(connection.definition) if connection.is_idl else
                 typesys.get_types_from_msg(connection.definition, name))  # fmt: skip
    except (typesys.TypesysError, KeyError, ValueError, RecursionError) as error:
        raise _unusable(connection, error) from error
    return {**typesys.get_typestore(typesys.Stores.EMPTY).fielddefs, **found}


def _check_arrays(fields: Mapping[str, Any], name: str) -> None:
    """Raise ValueError where a short definition or message is long when it is read.

    rosbags writes code for each element of an array of fixed length that is not of numbers, and of
    elements without bytes a message may have any number.
    """
    nodes = need("rosbags.interfaces").Nodetype

    @cache
    def is_empty(name: str) -> bool:
        found = [has_no_bytes(*kind) for _, kind in fields[name][1]]  # each is checked
        return all(found)

    def has_no_bytes(node: Any, what: Any) -> bool:
        if node in (nodes.BASE, nodes.NAME):
            return bool(node == nodes.NAME and is_empty(what))
        (inner, element), length = what
        if inner == nodes.NAME and is_empty(element):
            raise ValueError(f"an array of {short(element)}, which has no fields")
        is_fixed = node == nodes.ARRAY
        if is_fixed and length > LONGEST_ARRAY and (inner == nodes.NAME or element[0] == "string"):
            raise ValueError(f"an array of {length} elements, expected at most {LONGEST_ARRAY}")
        return is_fixed and not length

    is_empty(name)


def _unusable(connection: Connection, error: Exception) -> LogError:
    return LogError(f"the definition of {connection.type} cannot be used ({error})")


@cache
def broken() -> tuple[type[Exception], ...]:
    """Return what deserializers raise where bytes are not what their type says."""
    of_rosbags: type[Exception] = need("rosbags.serde").SerdeError
    return (of_rosbags, struct.error, ValueError, IndexError, AssertionError)


@cache
def serializer(encoding: str, name: str) -> Callable[[Mapping[str, Any]], bytes]:
    """Return the function that serializes the fields of a message as `encode` returns them."""
    types = store(encoding)
    fill = _filler(encoding, long(name))
    if encoding == "ros1":
        return lambda fields: types.serialize_ros1(fill(fields), long(name))
    return lambda fields: types.serialize_cdr(fill(fields), long(name))


def defined(encoding: str, name: str) -> tuple[str, str]:
    """Return the definition of a type and its MD5 sum, which only ROS 1 has."""
    types = store(encoding)
    if encoding == "ros1":
        text, digest = types.generate_msgdef(long(name))
        return str(text), str(digest)
    return str(types.generate_msgdef(long(name), ros_version=2)[0]), ""


@cache
def _filler(encoding: str, name: str) -> Callable[[Any], Any]:
    """Return what makes a message of rosbags of its fields; those that are left out are 0."""
    kind = store(encoding).types[name]
    if name in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):

        def of_ns(fields: Any) -> Any:
            seconds, rest = divmod(fields.get("ns", 0), NANOSECONDS)
            return kind(sec=seconds, nanosec=rest)

        return of_ns
    parts = {field: _part(encoding, type_) for field, type_ in store(encoding).fielddefs[name][1]}
    makers = {field: make for field, (make, _) in parts.items()}
    defaults = {field: default() for field, (_, default) in parts.items()}  # nobody changes them

    def fill(fields: Any) -> Any:
        given = {field: makers[field](value) for field, value in fields.items() if field in makers}
        return kind(**{**defaults, **given})

    return fill


def _part(encoding: str, published: Any) -> tuple[Callable[[Any], Any], Callable[[], Any]]:
    """Return what makes a field of what is said, and what makes it of nothing."""
    nodes = need("rosbags.interfaces").Nodetype
    node, what = published
    if node == nodes.BASE:
        number = float if what[0].startswith("float") else int
        make: Callable[..., Any] = {"string": str, "bool": bool}.get(what[0], number)
        return make, make
    if node == nodes.NAME:
        fill = _filler(encoding, what)
        return fill, lambda: fill({})
    (inner, element), length = what
    if inner == nodes.NAME:
        fill = _filler(encoding, element)
        return lambda several: [fill(one) for one in several], list
    if element[0] == "string":
        return lambda several: [str(one) for one in several], list
    odd = {"byte": "u1", "char": "u1", "octet": "u1", "float128": "V16"}
    dtype: np.dtype[Any] = np.dtype(odd.get(element[0], element[0]))
    size = length if node == nodes.ARRAY else 0
    return lambda several: np.asarray(several, dtype), lambda: np.zeros(size, dtype)
