"""A time limit for what a reader wrote: what does not return is stopped, and the kernel lives.

The function runs in the thread that calls it, so that ■, NumPy and OpenCV take it for any other code. A second thread
waits beside it, and is gone when the call ends. When time is up it raises a `TimeIsUp` in the first thread that
raises the next one as soon as it is caught: loops that catch Exception do not hold it, nor do those that catch
BaseException. A main thread that waits (`time.sleep`, a lock) is woken by the signal that Ctrl-C sends.

What cannot be stopped is one single call of C code that does not return, such as the product of two enormous matrices
or `sum(itertools.count())`: the function is stopped when that call returns, and until then only a restart of the kernel
helps. A call that never lets go of Python's lock (`re` on a bad pattern, huge integers) holds up the watching thread,
too; ■ ends some of these. Outside the main thread, where JupyterLab has a view's controls answered, nothing wakes
`time.sleep`, and ■ is not heard.
"""

from __future__ import annotations

import ctypes
import signal
import sys
import threading
from collections.abc import Callable
from contextvars import copy_context
from functools import partial
from typing import Any, TypeVar

T = TypeVar("T")

LIMIT_S = 10.0
"""What all calls of one check, or one call for a picture, may take together."""

NOTICE_S = 2.0
"""After this the reader is told that the function still runs."""

_AGAIN_S = 0.05
_WAKE_EVERY = 4  # rounds

_raise_in = ctypes.pythonapi.PyThreadState_SetAsyncExc
_raise_in.argtypes, _raise_in.restype = (ctypes.c_ulong, ctypes.py_object), None
_NOTHING = ctypes.py_object()  # takes back what has not been raised yet

notices: list[Callable[[str], bool]] = []
"""Who shows a notice where no cell prints, such as a widget: each says whether it did."""


class TimeIsUp(BaseException):
    """Raised in a call that has taken too long. No Exception, for a loop may catch those."""


def _again(thread: int | None) -> type[TimeIsUp]:
    """A TimeIsUp that is raised again when it is made, where the thread then is: in whatever `except` caught it.

    Its `__init__` is a C function, within which Python does not yet look for what is to be raised.
    """
    again = type("TimeIsUp", (TimeIsUp,), {})
    again.__init__ = staticmethod(partial(_raise_in, thread, again))  # type: ignore[misc]
    return again


class Patience:
    """The time that several calls have together, and the thread that watches them.

    >>> with Patience() as patience:
    ...     patience.call(max, 1, 2)
    2

    What it tells the reader goes where `print` goes at its making.
    """

    def __init__(self) -> None:
        self._screen = sys.stdout
        self._here = threading.get_ident()
        self._inside = self._expired = False
        self._turn = threading.Lock()
        self._over = threading.Event()
        run = copy_context().run  # to print where the caller prints
        self._thread = threading.Thread(target=run, args=(self._watch, LIMIT_S, NOTICE_S), daemon=True)

    def __enter__(self) -> Patience:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def call(self, function: Callable[..., T], *arguments: Any) -> T:
        """What the function returns. Raises what it raises, and TimeIsUp where it had to be stopped."""
        if self._expired:
            raise TimeIsUp
        here = self._here
        raised: BaseException | None = None
        try:
            self._inside = True
            result = function(*arguments)
            self._inside = False
        except BaseException as error:
            self._inside = False
            _raise_in(here, _NOTHING)  # first of all: what waits is raised at the next call or loop
            raised = error
        try:  # one more and the wakening that came with it may be on their way: they end here
            try:
                self._leave()
            except (TimeIsUp, KeyboardInterrupt) as late:
                _raise_in(here, _NOTHING)
                raised = raised or late
                self._leave()
        except (TimeIsUp, KeyboardInterrupt):
            _raise_in(here, _NOTHING)
            self._leave()
        if self._expired:  # even where the function caught what was raised in it
            raise TimeIsUp from None
        if raised:
            raise raised
        return result

    def _leave(self) -> None:
        with self._turn:  # the other thread does nothing more to this one
            _raise_in(self._here, _NOTHING)

    def _watch(self, limit: float, notice: float) -> None:
        if self._over.wait(min(notice, limit)):
            return
        if notice < limit:
            self._tell(limit)
            if self._over.wait(limit - notice):
                return
        again, rounds = _again(self._here), 0
        while not self._over.is_set():
            rounds += 1
            with self._turn:
                if self._inside:
                    self._expired = True
                    _raise_in(self._here, again)
                    if rounds % _WAKE_EVERY == 0:
                        self._wake()
            self._over.wait(_AGAIN_S)

    def _tell(self, limit: float) -> None:
        main = self._here == threading.main_thread().ident
        words = f"still running: {'press ■ to stop' if main else f'it is stopped after {limit:g} s'}"
        if any(show(words) for show in notices):
            return
        try:
            print(words, file=self._screen, flush=True)
        except (OSError, ValueError):  # closed: nobody is there to be told
            self._screen = None

    def _wake(self) -> None:
        """Wake the main thread from where Ctrl-C would, unless it is deaf to that."""
        if self._here != threading.main_thread().ident or not callable(signal.getsignal(signal.SIGINT)):
            return
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(self._here, signal.SIGINT)
        else:  # Windows, where it ends a sleep from any thread
            signal.raise_signal(signal.SIGINT)
