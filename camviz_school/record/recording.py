"""`record`: a widget is drawn along everything that moves it, and what comes out is stored for a page of its own."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

from camviz.draw.flow import Tile
from camviz.draw.picture import Picture
from camviz.widgets import Explorer
from camviz_school.record.axes import Axis
from camviz_school.record.packing import Images, Pack, hashed, script, transferred, webp
from camviz_school.record.panes import Pane, Values, pane

# Of the positions that a budget allows: the last share is drawn first, and tells how many more are possible.
SHARES = (1.0, 0.75, 0.52, 0.37, 0.27, 0.2, 0.14, 0.1, 0.07)
PLAYER = "replay.js"


class BudgetError(ValueError):
    """A pane that is too large for its budget, even with the fewest positions.

    >>> issubclass(BudgetError, ValueError)
    True
    """


@dataclass(frozen=True)
class Budget:
    """What a pane may cost, and how many positions it may have.

    Args:
        size: In bytes as transferred (gzip), all its photographs included.
        positions: States that are drawn. A pane whose fewest positions are more keeps those.
        slider, grid, orbit: Positions at most: of a slider, of a slider among those that belong together, of the
            onlooker all around.

    >>> Budget().count(Axis.slider("k1", -1, 1, 0.01, 0), 0.5, together=False)
    20
    """

    size: int = 2_500_000
    positions: int = 400
    slider: int = 41
    grid: int = 15
    orbit: int = 24

    def count(self, axis: Axis, share: float, *, together: bool) -> int:
        """At how many positions an axis is recorded, of a slider at least its ends and its first value.

        Args:
            axis: What is moved.
            share: Of the most positions, 0 … 1.
            together: Whether the axis is one of those whose combinations are recorded.

        Returns: At least 3.
        """
        most = self.grid if together else self.orbit if axis.period else self.slider
        return max(3, round(share * most))


@dataclass(frozen=True)
class PositionGrid:
    """Positions in every combination of some axes; the others stay at their first value."""

    axes: tuple[Axis, ...]
    values: tuple[tuple[Any, ...], ...]

    def states(self) -> Iterator[Values]:
        """Each combination, the last axis quickest."""
        for combination in product(*self.values):
            yield {axis.name: value for axis, value in zip(self.axes, combination, strict=True)}


@dataclass(frozen=True)
class RecordedPane:
    """A recorded pane: its files in a folder, what it holds, what it cost, and how it stands on a page.

    Attributes:
        title: The pane's name.
        folder: Where the files are.
        pack: The name of the script that holds all texts.
        files: The names of all files that the page needs, `pack` and photographs among them.
        positions: States that were drawn.
        counts: Positions of each axis by its name.
        size: Bytes as transferred (gzip) once all photographs are there; the stills of `html` come on top.
        still: What stands on the page before any script.
        controls: Labels of the pane's controls, for which `html` keeps room.
        panels: The words of the panels that buttons open, for which it keeps room as well.

    >>> from pathlib import Path
    >>> RecordedPane("A dot", Path("."), "d.js", ("d.js",), 41, {"x": 41}, 900, None).html("dots/")[:63]
    '<div class="camviz-recorded" data-recording="dots/d.js" data-po'
    """

    title: str
    folder: Path
    pack: str
    files: tuple[str, ...]
    positions: int
    counts: dict[str, int]
    size: int
    still: Picture | None = field(repr=False, compare=False)
    controls: tuple[str, ...] = ()
    panels: tuple[str, ...] = ()

    def html(self, base: str = "") -> str:
        """The pane for a page that loads `replay.js`.

        Before any script, and without JavaScript, it is the first picture: an external SVG a tile, with its alternative
        text.

        Args:
            base: The folder's address from the page, with its "/".

        Returns: HTML, one element.
        Raises: OSError where the folder cannot be written.
        """
        return self._html(base, lambda picture: _stills(picture, self.folder, base))

    def html_within(self) -> str:
        """The pane for a page that has all its files within: the first picture is in the HTML.

        Returns: HTML, one element.
        """
        return self._html("", Picture.figure)

    def _html(self, base: str, figure: Callable[[Picture], str]) -> str:
        stills = _room(self.controls) + figure(_lighter(self.still)) if self.still else ""
        stills += _row(self.panels) if self.still and self.panels else ""
        words = f"A still picture. With JavaScript it moves: {self.positions} positions are recorded."
        return (
            f'<div class="camviz-recorded" data-recording="{escape(base + self.pack)}" '
            f'data-positions="{self.positions}">{stills}<p class="camviz-recorded-line">{words}</p></div>'
        )


def record(widget: Explorer | Pane, folder: str | Path, *, budget: Budget | None = None) -> RecordedPane:
    """Record a widget into a folder of files named by their content; see `camviz_school.record` for the page.

    Every slider is drawn at up to `budget.slider` positions with all else at its first value, every choice and switch
    in each of its values, the axes that belong together in all combinations, and the onlooker from all around. Where
    they would be too many or too large, positions are thinned. The same budget gives the same positions on any machine.

    Args:
        widget: What is recorded.
        folder: Where the files go; it is made if need be.
        budget: What the pane may cost.

    Returns: What is in the folder.
    Raises: BudgetError where the fewest positions are still too large.

    >>> import anywidget, traitlets
    >>> from camviz_school.record import Axis, Widget
    >>> class Dot(anywidget.AnyWidget):
    ...     _esm = "export default { render() {} }"
    ...     x = traitlets.Int(0).tag(sync=True)
    >>> made = record(Widget(Dot(), (Axis.slider("x", 0, 100, 1, first=0),), title="A dot"), "recorded")
    >>> made.positions, made.counts, len(made.files)
    (41, {'x': 41}, 2)
    """
    return _Recorder(pane(widget), Path(folder), budget or Budget()).recording()


def write_player(folder: str | Path) -> Path:
    """Write `replay.js` into a folder; a page loads it as <script src="replay.js" defer></script>.

    Args:
        folder: It is made if need be.

    Returns: Path of the script.

    >>> write_player("recorded").name
    'replay.js'
    """
    path = Path(folder) / PLAYER
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text((files("camviz_school.record") / PLAYER).read_text(encoding="utf-8"), encoding="utf-8")
    return path


class _Recorder:
    """One pane on its way into a folder. States are drawn once, whatever sheet they are in."""

    def __init__(self, pane: Pane, folder: Path, budget: Budget) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._pane, self._folder, self._budget = pane, folder, budget
        self._images = Images()
        self._drawn: dict[tuple[Any, ...], dict[str, Any]] = {}
        self._source, source = script(pane.sources)
        self._scripts = {self._source: source}
        self._says = ""
        self._too_large: tuple[int, int] | None = None  # the fewest states that broke the budget, and their bytes

    def recording(self) -> RecordedPane:
        """The finest of SHARES that holds the budget, as far as the coarser ones foretell it."""
        kept = self._within(SHARES[-1])
        if kept is None:
            raise BudgetError(self._says)
        while finer := self._finer(kept):
            kept = finer
        return self._written(kept)

    def _finer(self, kept: RecordedPane) -> RecordedPane | None:
        """The finest recording that should hold the budget by what was drawn so far, and does; None: there is none."""
        for share in SHARES[:-1]:
            states = len(self._states(self._sheets(share)))
            fits = self._foretold(states, kept) <= self._budget.size and states <= self._budget.positions
            if states > kept.positions and fits:
                finer = self._within(share)
                if finer:
                    return finer
        return None

    def _foretold(self, states: int, kept: RecordedPane) -> float:
        """The bytes of that many states: as many each as `kept` has, or on the line from it to what was too large.

        What a pane takes whatever its positions counts with each of them, so that few positions foretell too much.
        """
        if not self._too_large:
            return kept.size * states / kept.positions
        most, size = self._too_large
        return kept.size + (size - kept.size) * (states - kept.positions) / (most - kept.positions)

    def _within(self, share: float) -> RecordedPane | None:
        """The recording with that share of the positions; None where it breaks the budget, which `_says` why."""
        sheets = self._sheets(share)
        states = self._states(sheets)
        for key, values in self._in_turn(states):
            if key not in self._drawn:
                self._drawn[key] = self._frame(values)
        pack, content, images = self._packed(sheets)
        size = transferred(content) + sum(len(self._images.data[name]) for name in images)
        if size > self._budget.size:
            limit = f"{self._budget.size / 1e6:g} MB: they take {size / 1e6:.1f} MB"
            self._says = f"{self._pane.title}: its fewest positions, {len(states)}, do not fit into {limit}."
            self._too_large = len(states), size
            return None
        self._scripts[pack] = content
        counts = {sheet.axes[0].name: len(sheet.values[0]) for sheet in sheets if len(sheet.axes) == 1}
        names = (pack, self._source, *images)
        still, traits = self._pane.still(), self._pane.traits
        labels = tuple(control["label"] for control in traits.get("controls", ()))
        room = labels, tuple(panel["words"] for panel in traits.get("panels", ()))
        return RecordedPane(self._pane.title, self._folder, pack, names, len(states), counts, size, still, *room)

    def _written(self, kept: RecordedPane) -> RecordedPane:
        """The recording, its files written."""
        for name in kept.files[:2]:
            (self._folder / name).write_bytes(self._scripts[name])
        self._images.write(kept.files[2:], self._folder)
        return kept

    def _sheets(self, share: float) -> list[PositionGrid]:
        """Each axis alone, those that belong together, and each with what is recorded with each."""
        wanted: list[tuple[tuple[Axis, ...], bool]] = [((axis,), False) for axis in self._pane.axes]
        joint = tuple(axis for axis in self._pane.axes if axis.name in self._pane.together)
        if len(joint) > 1:
            wanted.append((joint, True))
        wanted += [
            ((axis, one), True) for one in self._pane.axes if one.with_each for axis in self._pane.axes if axis != one
        ]
        return [
            PositionGrid(axes, tuple(axis.thinned(self._budget.count(axis, share, together=many)) for axis in axes))
            for axes, many in wanted
        ] or [PositionGrid((), ())]

    def _key(self, values: Values) -> tuple[Any, ...]:
        return tuple(values.get(axis.name, axis.first) for axis in self._pane.axes)

    def _states(self, sheets: list[PositionGrid]) -> dict[tuple[Any, ...], Values]:
        """Every state of the sheets once, the first one first."""
        first: dict[str, Any] = {axis.name: axis.first for axis in self._pane.axes}
        states: dict[tuple[Any, ...], Values] = {self._key(first): first}
        for sheet in sheets:
            states |= {self._key(values): {**first, **values} for values in sheet.states()}
        return states

    def _in_turn(self, states: dict[tuple[Any, ...], Values]) -> Iterator[tuple[tuple[Any, ...], Values]]:
        """The states, those that differ only in what is recorded with each (an opened panel) one after the other.

        What such a view has measured or traced is still there for the next.
        """
        alike: dict[tuple[Any, ...], list[tuple[Any, ...]]] = {}
        for key in states:
            rest = tuple(value for axis, value in zip(self._pane.axes, key, strict=True) if not axis.with_each)
            alike.setdefault(rest, []).append(key)
        return ((key, states[key]) for keys in alike.values() for key in keys)

    def _frame(self, values: Values) -> dict[str, Any]:
        """A state's traits, its photographs apart."""
        frame: dict[str, Any] = self._images.stored(self._pane.frame(values))
        return frame

    def _packed(self, sheets: list[PositionGrid]) -> tuple[str, bytes, list[str]]:
        """The pack's name and content, and the names of its photographs."""
        pack, numbers = Pack(), dict[str, int]()  # of frames, by what is in them: those that are alike are kept once
        first = {axis.name: axis.first for axis in self._pane.axes}

        def number(values: Values) -> int:
            frame = pack.packed(self._drawn[self._key({**first, **values})])
            return numbers.setdefault(json.dumps(frame), len(numbers))

        told = [
            {
                "axes": [axis.name for axis in sheet.axes],
                "values": sheet.values,
                "frames": [*map(number, sheet.states())],
            }
            for sheet in sheets
        ]
        content = {
            "source": self._source,
            "title": self._pane.title,
            "traits": self._pane.traits,
            "axes": [{"name": axis.name, "first": axis.first, "period": axis.period} for axis in self._pane.axes],
            "positions": len(self._states(sheets)),
            "sheets": told,
            "frames": [json.loads(frame) for frame in numbers],
            "pieces": pack.pieces,
        }
        name, script_ = script(content)
        return name, script_, list(pack.images)


def _room(controls: Sequence[str]) -> str:
    """The controls, drawn where the live ones and their buttons will be (explorer.css), so that nothing jumps."""
    font = "font:normal 13px system-ui,sans-serif"
    row = "height:26px;display:flex;gap:8px;align-items:center"
    track = '<s style="flex:1;height:5px;border-radius:3px;background:#8b94a3"></s>'
    rows = "".join(f'<i style="{row};{font}">{escape(label)}{track}</i>' for label in controls)
    grid = "display:grid;grid-template-columns:minmax(min(320px,100%),792px);gap:4px 22px;padding:6px 2px 8px"
    return (
        f'<div aria-hidden="true" style="{grid}">'
        f'{rows}<i class="camviz-foot-room" style="height:24px;grid-column:1/-1;font-size:13px"></i></div>'
    )


def _row(panels: Sequence[str]) -> str:
    """Room for the buttons that open panels: it breaks where theirs will."""
    font = "font:normal 13px/24px system-ui,sans-serif"
    buttons = "".join(f'<i style="height:24px;padding:0 13px;{font}">+ {escape(words)}</i>' for words in panels)
    row = "display:flex;flex-wrap:wrap;gap:6px;padding:4px 2px;visibility:hidden"
    return f'<div aria-hidden="true" style="{row}">{buttons}</div>'


def _lighter(picture: Picture) -> Picture:
    """The picture with its photographs as WebP."""
    return replace(picture, photographs={name: webp(data) for name, data in picture.photographs.items()})


def _stills(picture: Picture, folder: Path, base: str) -> str:
    """The picture as a figure whose tiles are SVG files in the folder, loaded when they come near the screen."""

    def address(tile: Tile) -> str:
        drawn = picture.document(tile).encode()
        name = f"{hashed(drawn)}.svg"
        (folder / name).write_bytes(drawn)
        return base + name

    return picture.figure(address)
