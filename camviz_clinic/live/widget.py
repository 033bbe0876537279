"""`capture(board)`: a guided calibration in a notebook, with the reader's webcam or with a film in its place."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from html import escape
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import traitlets

from camviz.draw.picture import jpeg
from camviz.lenses.base import Array
from camviz.widgets.still import StillWidget
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.summary import GOOD
from camviz_clinic.films.reading import Film
from camviz_clinic.live.session import FrameAnswer, Session
from camviz_clinic.live.tracking import Gray, decoded

_HERE = Path(__file__).parent
PROMISE = "The camera's frames go to your own kernel, by the connection that this page has to it, and nowhere else."
WANTED = (640, 480)  # pixels: what the camera is asked for
LAST = 600  # frames, whose delays are kept
MOST_BYTES = 8_000_000  # of a frame


class CaptureWidget(StillWidget):
    """A guided calibration: the page shows the camera, the ghost board, what is covered, and how σ of fx falls.

    One frame is under way at a time: the page sends the next one, its newest, when the last one is answered. So a slow
    kernel is sent fewer frames and never old ones. With a film, the kernel reads the frames and the page asks for them.

    Args:
        session: The calibration itself.
        film: Read by the kernel in place of the camera.
        size: Width and height in pixels that the camera is asked for.

    Attributes:
        delays_ms: Of the last 600 frames, the time from the camera to the overlay, as the page measured it.

    >>> from camviz_clinic.calibration import Board
    >>> widget = capture(Board(9, 6, 0.025))
    >>> widget.session.views, widget.still()["text/plain"]
    ((), 'Guided calibration. Run this cell, and press Start.')
    """

    session: Session
    delays_ms: deque[float]
    _esm = _HERE / "capture.js"
    _css = _HERE / "capture.css"
    wanted: Any = traitlets.Tuple(WANTED, read_only=True).tag(sync=True)
    film = traitlets.Bool(False, read_only=True).tag(sync=True)
    promise = traitlets.Unicode(PROMISE, read_only=True).tag(sync=True)

    def __init__(self, session: Session, film: Film | None = None, size: tuple[int, int] = WANTED) -> None:
        self.session = session
        self.delays_ms = deque(maxlen=LAST)
        self._frames = None if film is None else _frames(film)
        super().__init__()
        self.set_trait("film", film is not None)
        self.set_trait("wanted", size)
        self.on_msg(self._receive)

    @property
    def calibration(self) -> Calibration:
        """The camera by the views taken so far. Raises CannotCalibrate before there is one."""
        return self.session.calibration

    def save(self, path: str | PathLike[str], format: str = "opencv") -> tuple[str, ...]:
        """Write the calibration.

        Args:
            path: Where to.
            format: One of `camviz_clinic.files.formats()`.

        Returns: What the format cannot hold, as noun phrases such as "the board".
        """
        return self.session.save(path, format)

    def run(self) -> CaptureWidget:
        """Without a page: take the views from the film, to the goal or its end.

        Returns: Itself.
        Raises: ValueError without a film.
        """
        if self._frames is None:
            raise ValueError('film must be given to run without a page, as in capture(board, film="film.mp4")')
        self.session.run(self._frames)
        return self

    def still(self) -> dict[str, str]:
        done = self.session.verdict if self.session.views else "Run this cell, and press Start."
        return {
            "text/html": f"<p><b>Guided calibration.</b> {escape(done)} {PROMISE}</p>",
            "text/plain": f"Guided calibration. {done}",
        }

    def _receive(self, _widget: object, message: Any, buffers: Any) -> None:
        number = message.get("number") if isinstance(message, dict) else None
        try:
            self._answer(message, buffers)
        # The widget's edge: what is wrong belongs in front of the reader, and the page waits for an answer.
        except Exception as error:
            said = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
            self.send({"number": number, "error": said})

    def _answer(self, message: dict[str, Any], buffers: Any) -> None:
        if isfinite(delay := float(message.get("delay") or np.nan)):
            self.delays_ms.append(delay)
        if self._frames is not None:
            gray, time_s = next(self._frames, (None, 0.0))
            if gray is None:
                raise ValueError(f"The film is at its end. {self.session.verdict}")
            sent = [jpeg(gray)]
        else:
            if len(buffers) != 1 or len(buffers[0]) > MOST_BYTES:
                raise ValueError(f"a message must hold one frame of at most {MOST_BYTES} bytes, got {len(buffers)}")
            gray, time_s, sent = decoded(buffers[0]), float(message["time"]), []
        views = len(self.session.views)
        answer = self.session.look(gray, time_s)
        self.send({"number": message["number"], **self._told(answer, gray)}, buffers=sent)
        if len(self.session.views) > views:
            self.keep_soon()

    def _told(self, answer: FrameAnswer, gray: Gray) -> dict[str, Any]:
        """What the page is told of a frame: pixels rounded to a tenth."""
        session, guide = self.session, self.session.guide
        board = session.board
        rim = [0, board.columns - 1, board.columns * board.rows - 1, board.columns * (board.rows - 1)]
        return {
            "size": [gray.shape[1], gray.shape[0]],
            "corners": _rounded(answer.corners) if answer.corners is not None else [],
            "ghost": _rounded(guide.lattice) if guide and not session.done else [],
            "squares": board.kind in ("chessboard", "charuco"),
            "covered": [_rounded(view.corners[rim]) for view in session.views],
            "coverage": session.coverage,
            "known": [[each.views, each.fx, _finite(each.sigma), _finite(each.largest)] for each in session.known],
            "taken": answer.taken,
            "views": len(session.views),
            "sentence": answer.sentence,
            "done": session.done,
        }


def capture(
    board: Board,
    film: str | PathLike[str] | None = None,
    *,
    model: str = "standard",
    goal: float = GOOD,
    size: tuple[int, int] = WANTED,
) -> CaptureWidget:
    """Calibrate the reader's webcam, guided: show the widget, press Start, and cover the orange board with yours.

    A view is taken by itself when the board rests, is sharp, and says enough that is new. It ends when the largest
    expected error of where a far point is seen is within the goal. Frames go to the reader's own kernel and nowhere
    else.

    Args:
        board: What is held before the camera.
        film: A film in place of the camera; its frames are read by the kernel.
        model: One of `camviz_clinic.calibration.MODELS`.
        goal: In pixels.
        size: Width and height in pixels that the camera is asked for. Calibrate in the mode that you will use.

    Returns: The widget, whose `calibration` is the camera, and whose `save(path, format)` writes it.
    Raises: ValueError for an unknown model or a goal that is not positive, FilmError for a film that cannot be read.

    >>> from camviz_clinic.calibration import Board
    >>> from camviz_clinic.films.virtual import example
    >>> example("film.avi")  # two poses of a board, too few for a camera
    >>> capture(Board(4, 3, 0.05), "film.avi").run().session.done
    False
    """
    return CaptureWidget(Session(board, model, goal), None if film is None else Film(film), size)


def _frames(film: Film) -> Iterator[tuple[Gray, float]]:
    with film:
        for frame in film.frames():
            yield frame.gray, frame.time_s


def _rounded(pixels: Array) -> list[Any]:
    """Nested lists; None where there is no pixel, because JSON has no NaN."""
    return np.where(np.isfinite(pixels), np.round(pixels, 1), None).tolist()  # type: ignore[call-overload]


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
