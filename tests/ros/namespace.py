# SPDX-License-Identifier: Apache-2.0
"""A network namespace whose only interface is loopback, so that no packet of a test leaves.

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
    """Return whether loopback is up and the only interface of this process."""
    return [name for _, name in socket.if_nameindex()] == ["lo"] and bool(_flags() & _UP)


def isolate() -> None:
    """Move this process and its children into a separate namespace.

    Raises
    ------
    OSError
        If the kernel does not permit it.
    """
    if is_isolated():
        return
    user, group = os.getuid(), os.getgid()
    _unshare(_CLONE_NEWNET | (_CLONE_NEWUSER if user else 0))
    if user:  # root in a user namespace may raise an interface
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    _set_flags(_flags() | _UP)


def _unshare(flags: int) -> None:
    if ctypes.CDLL(None, use_errno=True).unshare(flags) != 0:
        error = ctypes.get_errno()
        raise OSError(
            error,
            f"no separate network namespace ({os.strerror(error)}); run as root, or allow user "
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
