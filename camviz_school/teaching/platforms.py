"""The kinds of machine that a bundle can be for, and which of a lock's packages each of them takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

_GLIBC = ("manylinux1", "manylinux2010", "manylinux2014", *(f"manylinux_2_{minor}" for minor in range(5, 32)))
_WINDOWS, _MACOS, _LINUX = ("win32", "nt", "Windows"), ("darwin", "posix", "Darwin"), ("linux", "posix", "Linux")


@dataclass(frozen=True)
class Platform:
    """A kind of machine: the tags of the wheels it takes, and what a lock's markers ask about it."""

    tags: tuple[str, ...]
    sys_platform: str
    os_name: str
    platform_system: str
    platform_machine: str


PLATFORMS: Mapping[str, Platform] = MappingProxyType(
    {
        "linux-x86_64": Platform(tuple(f"{one}_x86_64" for one in _GLIBC[::-1]), *_LINUX, "x86_64"),
        "linux-aarch64": Platform(tuple(f"{one}_aarch64" for one in _GLIBC[:1:-1]), *_LINUX, "aarch64"),
        "macos-arm64": Platform(("macosx_14_0_arm64",), *_MACOS, "arm64"),
        "windows-x86_64": Platform(("win_amd64",), *_WINDOWS, "AMD64"),
    }
)
"""What a bundle can be made for, by name. On Linux: with glibc 2.31, of the year 2020, or a newer one.

Macs with an Intel processor are missing, for JupyterLab's dependencies have no wheels for them any more."""


def wanted(entries: Sequence[str], platform: Platform, release: str) -> list[str]:
    """A lock's entries, without their markers, that a Python (3.12.4) on a platform takes.

    pip itself would ask the markers about the machine that it runs on.
    """
    from packaging.markers import Marker

    asked = {
        "sys_platform": platform.sys_platform,
        "os_name": platform.os_name,
        "platform_system": platform.platform_system,
        "platform_machine": platform.platform_machine,
        "python_version": release.rpartition(".")[0],
        "python_full_version": release,
        "implementation_name": "cpython",
        "implementation_version": release,
        "platform_python_implementation": "CPython",
    }
    taken = []
    for entry in entries:
        head, _, hashes = entry.partition(" \\\n")
        package, _, marker = head.partition(";")
        if not marker or Marker(marker).evaluate(asked):
            taken.append(f"{package.strip()} \\\n{hashes}")
    return taken
