# SPDX-License-Identifier: Apache-2.0
"""A network namespace whose only interface is loopback: what tests send there reaches nobody.

``python tests/ros/namespace.py COMMAND...`` runs a command inside one.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import socket
import struct
import sys
from pathlib import Path

_CLONE_NEWUSER, _CLONE_NEWNET = 0x10000000, 0x40000000
_GET_FLAGS, _SET_FLAGS, _UP = 0x8913, 0x8914, 0x1


def is_isolated() -> bool:
    """Return whether this process can reach nothing but itself: loopback is up and alone."""
    return [name for _, name in socket.if_nameindex()] == ["lo"] and bool(_flags() & _UP)


def isolate() -> None:
    """Move this process, and all it starts, into a namespace of its own.

    Raises
    ------
    OSError
        If the kernel does not allow it: says what to do.
    """
    if is_isolated():
        return
    user, group = os.getuid(), os.getgid()
    _unshare(_CLONE_NEWNET | (_CLONE_NEWUSER if user else 0))
    if user:  # to be root in a namespace of users is enough to raise an interface
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    _set_flags(_flags() | _UP)


def _unshare(flags: int) -> None:
    if ctypes.CDLL(None, use_errno=True).unshare(flags) != 0:
        error = ctypes.get_errno()
        raise OSError(
            error,
            f"no network namespace of its own ({os.strerror(error)}); run as root, or allow user "
            "namespaces: sysctl kernel.unprivileged_userns_clone=1",
        )


def _flags() -> int:
    asked = struct.pack("16sh14x", b"lo", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        answer = fcntl.ioctl(any_socket, _GET_FLAGS, asked)
    return int(struct.unpack("16sh14x", answer)[1])


def _set_flags(flags: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sh14x", b"lo", flags))


if __name__ == "__main__":
    isolate()
    os.execvp(sys.argv[1], sys.argv[1:])
