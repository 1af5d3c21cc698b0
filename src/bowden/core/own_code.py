"""Which of the user's own Python files have run here because the user named them.

A law or a plant is a program, and may do whatever its user may. One that the user names, or that a rig.toml names which
the user gives, runs; it is remembered by the SHA-256 of its text and of what it imports. What a log brings along runs
only if it is one of those, so that a log of somebody else's is no program until its user has said so.
"""

import contextlib
from collections.abc import Sequence
from pathlib import Path

from bowden.core.kernel_cache import cache_folder
from bowden.core.user_file import UserModule, digest


def remember(source: bytes, modules: Sequence[UserModule]) -> None:
    """Its user has named this file; where that cannot be kept, the next log that has it is asked about."""
    with contextlib.suppress(OSError):
        place = _place(source, modules)
        place.parent.mkdir(mode=0o700, exist_ok=True)
        place.touch()


def known(source: bytes, modules: Sequence[UserModule]) -> bool:
    """Whether this very file, with what it imports, was named here before."""
    return _place(source, modules).exists()


def _place(source: bytes, modules: Sequence[UserModule]) -> Path:
    return cache_folder() / "named" / digest(source, modules)
