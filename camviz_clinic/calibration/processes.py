"""The processes that look for boards: how they are started and ended, and how signals are heard meanwhile."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from types import SimpleNamespace
from typing import Any, Self

from camviz_clinic.calibration.boards import Shape
from camviz_clinic.calibration.finding import look_on_request


class WorkerPool:
    """Processes that look for boards, each known by the pipe to it; all are gone when the block is left."""

    def __init__(self, board: Shape, finder: str) -> None:
        plain: Any = SimpleNamespace(**vars(board))  # what a process can unpack without importing half of camviz
        self.asked = plain, finder
        self.processes: dict[Connection, Any] = {}

    def __enter__(self) -> Self:
        return self

    def another(self) -> Connection:
        """Start one more, and give the pipe to it."""
        context = multiprocessing.get_context("spawn")
        with _starting_processes():
            ours, theirs = context.Pipe()
            process = context.Process(target=look_on_request, args=(theirs, *self.asked), daemon=True)
            self.processes[ours] = process
            process.start()
        theirs.close()
        return ours

    def dismiss(self, *pipes: Connection) -> None:
        """End those at these pipes."""
        for pipe in pipes:
            if self.processes[pipe].pid is not None:  # it was started
                self.processes[pipe].kill()
        for pipe in pipes:
            process = self.processes.pop(pipe)
            if process.pid is not None:
                process.join()
            pipe.close()

    def __exit__(self, *_: object) -> None:
        self.dismiss(*self.processes)


@contextmanager
def signals_put_off() -> Iterator[Callable[[], None]]:
    """Ctrl-C and SIGTERM wait until what this gives is called, or the block is left."""
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None  # signals interrupt the main thread only
        return
    came: list[int] = []
    handlers: dict[int, Any] = {
        number: signal.getsignal(number)
        for number in (signal.SIGINT, signal.SIGTERM)
        if signal.getsignal(number) not in (signal.SIG_IGN, None)
    }

    def note(number: int, _: object) -> None:
        came.append(number)

    def hear() -> None:
        while came:
            number = came.pop(0)
            signal.signal(number, handlers[number])
            try:
                signal.raise_signal(number)
            finally:
                signal.signal(number, note)

    for number in handlers:
        signal.signal(number, note)
    try:
        yield hear
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in came:
            signal.raise_signal(number)


@contextmanager
def _starting_processes() -> Iterator[None]:
    """Processes started here do not run the caller's script again, of which they need nothing; Ctrl-C is not theirs."""
    main = sys.modules["__main__"]
    held = {name: getattr(main, name) for name in ("__file__", "__spec__") if hasattr(main, name)}
    block: Any = getattr(signal, "pthread_sigmask", lambda *_: set())  # inherited; not on Windows
    if os.name == "posix":
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()  # which would come with the first process, and unblock SIGINT
    mask = block(getattr(signal, "SIG_BLOCK", None), {signal.SIGINT})
    try:
        main.__spec__ = None
        if "__file__" in held:
            del main.__file__
        yield
    finally:
        for name, value in held.items():
            setattr(main, name, value)
        block(getattr(signal, "SIG_SETMASK", None), mask)


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
