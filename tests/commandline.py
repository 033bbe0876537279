"""The command as the tests run it."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import MappingProxyType

import camviz
from camviz_clinic.commands.command import main

ROOT = Path(camviz.__file__).parents[1]


def run(*words, **options):
    """The command in a process of its own, as a person runs it."""
    return python("-m", "camviz", *words, **options)


def python(*words, environment=MappingProxyType({}), **options):
    """A process of Python that finds this repository's packages."""
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        timeout=300,
        **options,
    )


def on_a_full_disk(*words, **options):
    """Python in a process that can write a file's first 1,000 bytes.

    It keeps no compiled modules: Python keeps the part of them that fits, and no later process can import it.
    """
    import resource  # Windows has none, and skips what needs this

    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (1000, 1000))
    return python(*words, environment={"PYTHONDONTWRITEBYTECODE": "1"}, preexec_fn=limit, **options)


def refused(capsys, room, *words):
    """The one sentence of a refusal with status 2 that wrote nothing."""
    before = sorted(room.rglob("*"))
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("camviz: ")
    assert err.count("\n") == 1
    assert sorted(room.rglob("*")) == before
    return err
