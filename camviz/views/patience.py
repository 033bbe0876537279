"""A time limit for a reader's function: a call that does not return is stopped, and the kernel lives.

In the main thread an interval timer's signal raises `TimeIsUp`, which also ends `time.sleep`. In other threads, and on
Windows, a second thread raises it. Time in a debugger does not count.

Not stopped: one call of C code that does not return, `time.sleep` outside the main thread, and a loop that catches
BaseException for ever. These need a restart of the kernel.
"""

from __future__ import annotations

import ctypes
import signal
import sys
import threading
from collections.abc import Callable
from contextvars import copy_context
from types import FrameType
from typing import Any, TypeVar

T = TypeVar("T")

LIMIT_S = 10.0
"""The time that all calls of one check, or one call for a picture, may take together."""

NOTICE_S = 2.0
"""The time after which the reader is told that the function still runs."""

_DEBUGGERS = ("bdb", "pydevd")  # the modules in which pdb, IPython's and JupyterLab's debugger wait

notices: list[Callable[[str], bool]] = []
"""Functions that show a notice where no cell prints, such as a widget; each returns whether it did."""


class TimeIsUp(BaseException):
    """Raised in a call that takes too long. Not an Exception, because loops catch those."""


class Patience:
    """A time limit that several calls share.

    >>> with Patience() as patience:
    ...     patience.call(max, 1, 2)
    2

    Its notice is printed where `print` goes when it is made.
    """

    def __init__(self) -> None:
        self._screen = sys.stdout
        self._thread = threading.get_ident()
        self._main = threading.current_thread() is threading.main_thread()
        self._inside = self._noticed = self._expired = False
        self._lock = threading.Lock()  # the second thread interrupts only what is inside a call
        self._over = threading.Event()

    def __enter__(self) -> Patience:
        if self._main and hasattr(signal, "setitimer"):
            self._handler_before = signal.signal(signal.SIGALRM, self._on_alarm)
            signal.setitimer(signal.ITIMER_REAL, NOTICE_S, LIMIT_S - NOTICE_S)
        else:
            run = copy_context().run  # to print where the caller prints
            threading.Thread(target=run, args=(self._watch,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._main and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, self._handler_before)

    def call(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return what the function returns. Raises what it raises, and TimeIsUp where it was stopped."""
        if self._expired:
            raise TimeIsUp
        self._inside = True
        try:
            return function(*arguments)
        finally:
            with self._lock:
                self._inside = False
            if self._expired:  # even where the function caught what was raised in it
                raise TimeIsUp from None

    def _on_alarm(self, _: int, frame: FrameType | None) -> None:
        if self._must_stop(frame):
            raise TimeIsUp

    def _watch(self) -> None:
        wait_s = NOTICE_S
        while not self._over.wait(wait_s):
            wait_s = LIMIT_S - NOTICE_S
            with self._lock:
                if self._must_stop(sys._current_frames().get(self._thread)):
                    self._interrupt()
                    return

    def _must_stop(self, frame: FrameType | None) -> bool:
        """Show the notice at first; later return whether a call is running that must be stopped."""
        if self._inside and is_debugging(frame):
            self._noticed = False  # its time begins again
        elif not self._noticed:
            self._noticed = True
            self._show_notice()
        else:
            self._expired = True
        return self._expired and self._inside

    def _interrupt(self) -> None:
        if self._main:
            signal.raise_signal(signal.SIGINT)  # on Windows it ends a sleep, too
        else:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._thread), ctypes.py_object(TimeIsUp))

    def _show_notice(self) -> None:
        words = f"still running: {'press ■ to stop' if self._main else f'it is stopped after {LIMIT_S:g} s'}"
        if any(show(words) for show in notices):
            return
        try:
            print(words, file=self._screen, flush=True)
        except (OSError, ValueError):  # a closed screen shows nothing
            self._screen = None


def is_debugging(frame: FrameType | None) -> bool:
    """Whether the thread of this innermost frame waits in a debugger."""
    while frame and frame.f_globals.get("__name__") not in _DEBUGGERS:
        frame = frame.f_back
    return frame is not None
