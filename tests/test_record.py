"""A recording holds what the kernel would have answered, within its budget, and says what does not fit."""

import json
import sys
from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self
from xml.etree import ElementTree

import anywidget
import numpy as np
import pytest
import traitlets

from camviz.draw import svg
from camviz.draw.marks import Image, Marks
from camviz.draw.picture import Picture, jpeg
from camviz.views.base import View, choice, slider, switch
from camviz.views.distortion import DistortionView
from camviz.widgets import explore
from camviz_school.record import Axis, Budget, BudgetError, RecordedPane, Widget, record, write_one_file
from camviz_school.record.packing import Images, Pack
from camviz_school.record.panes import Explored
from camviz_school.views.readout import ReadoutView

sys.path.append(str(Path(__file__).resolve().parents[1] / "tools/benchmarks"))

from smallest import Smallest


@dataclass(frozen=True)
class Toy(View):
    """A view whose picture says its state, with a photograph of each size; it refuses sizes above 8."""

    title = "Toy"
    size: float = slider(1.0, 0, 10, 0.5)
    height: float = slider(0.0, 0, 1, 0.01)
    colour: str = choice("red", "blue", "green")
    lit: bool = switch(True)

    def figure(self, *, draft: bool = False) -> Picture:
        if self.size > 8:
            raise ValueError("size must be at most 8")
        words = f"size {self.size:g}, height {self.height:g}, {self.colour}, {self.lit}"
        body = svg.handle(svg.rectangle(0, 0, 300, 200, "card"), "size", "size") + svg.image("photo", 0, 0, 8, 8)
        body += svg.text((5, 20), words) + svg.text((5, 38), "below", "")
        photo = jpeg(np.full((8, 8, 3), int(20 * self.size), np.uint8))
        return Picture.whole(body, 300, 200, "Toy", words, {"photo": photo})

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        return self.but(size=min(max(self.size + dx / 30, 0.0), 10.0))


def content(made: RecordedPane) -> dict[str, Any]:
    """What the pack holds."""
    text = (made.folder / made.pack).read_text(encoding="utf-8")
    return json.loads(text.partition(",")[2].removesuffix(");\n"))


def unpacked(value: Any, pieces: list[str], unit: float) -> Any:
    """What was packed, in tiles of that many picture units a CSS pixel."""
    if isinstance(value, list):
        return [unpacked(one, pieces, unit) for one in value]
    if not isinstance(value, dict):
        return value
    if "$text" in value:
        runs = value["$text"]
        return "".join("".join(pieces[at : at + count]) for at, count in zip(runs[::2], runs[1::2], strict=True))
    if "$joined" in value:
        return "".join(unpacked(value["$joined"], pieces, unit))
    if "$tile" in value:
        fitting = [text for at, text in zip(value["units"], value["texts"], strict=True) if at <= unit]
        return unpacked(fitting[-1], pieces, unit)
    if "$image" in value:
        return value["$image"]
    return {name: unpacked(one, pieces, unit) for name, one in value.items()}


def states(made: RecordedPane, unit: float = 1.0) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Each recorded position, as its values, and its frame."""
    held = content(made)
    first = {axis["name"]: axis["first"] for axis in held["axes"]}
    found = []
    for sheet in held["sheets"]:
        grid = np.indices([len(values) for values in sheet["values"]]).reshape(len(sheet["axes"]), -1).T
        for places, frame in zip(grid, sheet["frames"], strict=True):
            moved = {name: all_[at] for name, all_, at in zip(sheet["axes"], sheet["values"], places, strict=True)}
            found.append((first | moved, unpacked(held["frames"][frame], held["pieces"], unit)))
    return found


@pytest.mark.parametrize("unit", [1.0, 2.0])
def test_every_frame_is_what_the_view_draws_for_its_values(tmp_path, unit):
    explorer = explore(Toy(), together=("height", "lit"))
    assert Toy().figure().flow({"Toy": 2.0}) != Toy().figure().flow()  # where it is shown small, words make room
    made = record(explorer, tmp_path, budget=Budget(slider=5, grid=3))
    found = states(made, unit)
    for values, frame in found:
        if values["size"] <= 8:
            picture = Toy(**values).figure()
            assert frame["frame"]["html"] == picture.flow({"Toy": unit})
            assert frame["frame"]["described"] == picture.description
            assert frame["frame"]["error"] == ""
        assert frame["values"] == values or values["size"] > 8
    assert len({tuple(values.values()) for values, _ in found}) == made.positions
    (error,) = {frame["frame"]["error"] for values, frame in found if values["size"] == 10}
    assert error == "size must be at most 8"  # a state that cannot be drawn
    places = [values for values, _ in found]
    assert {(v["height"], v["lit"]) for v in places} >= {(h, lit) for h in (0, 1) for lit in (True, False)}
    assert all(v["size"] == 1.0 for v in places if v["height"] or v["colour"] != "red")  # axes alone


def test_a_panel_that_a_button_opens_is_recorded_with_each_control(tmp_path):
    """One at a time: a reader who opens a panel and moves a slider then still has it."""
    view = DistortionView.by_the_wall()
    made = record(explore(view, "k1", "show"), tmp_path, budget=Budget(slider=3, grid=3))
    found = states(made)
    further = [name for name in view.openable if name not in view.opened]
    assert {(one["panel"], one["k1"]) for one, _ in found} >= {(name, k1) for name in further for k1 in (-1.0, 1.0)}
    assert {(one["panel"], one["show"]) for one, _ in found} >= {(name, "undistorted") for name in further}
    for values, frame in found:
        assert frame["opened"] == ([values["panel"]] if values["panel"] else list(view.opened))
        drawn = view.with_panels({values["panel"]: True} if values["panel"] else {})
        drawn = drawn.but(k1=values["k1"], show=values["show"])
        assert frame["frame"]["described"] == drawn.figure().description


def test_a_sliders_positions_hold_both_ends_and_the_first():
    axis = Axis.slider("k", -1.0, 1.0, 0.01, 0.333)
    assert len(axis.values) == 41
    assert (axis.values[0], axis.values[-1]) == (-1.0, 1.0)
    assert {one for one in axis.values if abs(one * 100 - round(one * 100)) > 1e-9} == {0.333}
    for count in (3, 5, 8, 15, 31):
        thinned = axis.thinned(count)
        assert len(thinned) == count
        assert {-1.0, 0.333, 1.0} < set(thinned) <= set(axis.values) or count == 3
    assert Axis.slider("n", 1, 4, 1, 2).values == (1, 2, 3, 4)


def test_photographs_are_files_of_their_own_each_once(tmp_path):
    first = record(explore(Toy(), "size"), tmp_path)
    again = record(explore(Toy(colour="blue"), "size"), tmp_path)
    photographs = [name for name in first.files if name.endswith(".webp")]
    drawn = {values["size"] for values, _ in states(first) if values["size"] <= 8}
    assert len(photographs) == len(drawn)
    assert set(photographs) == {name for name in again.files if name.endswith(".webp")}
    assert (tmp_path / photographs[0]).read_bytes()[:4] == b"RIFF"
    assert b"data:image" not in (tmp_path / first.pack).read_bytes()
    assert record(explore(Toy(), "size"), tmp_path / "again").files == first.files


def noise(rng: np.random.Generator, size: int) -> svg.Marks:
    """Words of so many random bytes, which cannot be compressed."""
    return Marks([Image(rng.bytes(size).hex(), 0, 0, 1, 1)])


@dataclass(frozen=True)
class Noisy(Toy):
    """A view that cannot be compressed."""

    def figure(self, *, draft: bool = False) -> Picture:
        rng = np.random.default_rng(int(1000 * self.height) + 17)
        return Picture.whole(noise(rng, 20_000), 10, 10, "Noisy", f"height {self.height:g}")


@dataclass(frozen=True)
class Heavy(Toy):
    """A view that has the most in common between its positions, and it cannot be compressed."""

    def figure(self, *, draft: bool = False) -> Picture:
        common = np.random.default_rng(17)
        drawn = noise(common, 20_000) + svg.rectangle(0, 0, self.height, 1, "card")
        return Picture.whole(drawn, 10, 10, "Heavy", f"height {self.height:g}")


@dataclass(frozen=True)
class Steep(Toy):
    """A view that is alike at both ends and in the middle, so that the fewest positions foretell too little."""

    drawn: ClassVar[list[float]] = []

    def figure(self, *, draft: bool = False) -> Picture:
        self.drawn.append(self.height)
        rng = np.random.default_rng(int(1000 * self.height) if self.height % 0.5 else 17)
        return Picture.whole(noise(rng, 9_000), 10, 10, "Steep", f"height {self.height:g}")


def test_positions_are_thinned_until_the_budget_holds(tmp_path):
    """Of bytes or of positions; what all positions have in common takes none away, and the fewest are always made."""
    made = record(explore(Noisy(), "height"), tmp_path, budget=Budget(size=400_000))
    assert made.size <= 400_000
    assert 8 <= made.counts["height"] < 41
    heights = [values["height"] for values, _ in states(made)]
    assert (heights[0], heights[-1]) == (0, 1)
    heavy = record(explore(Heavy(), "height"), tmp_path)
    made = record(explore(Heavy(), "height"), tmp_path, budget=Budget(size=int(1.6 * heavy.size)))
    assert made.counts["height"] == heavy.counts["height"] == 41
    whole = record(explore(Toy()), tmp_path)
    made = record(explore(Toy()), tmp_path, budget=Budget(positions=whole.positions - 1))
    assert 3 < made.counts["height"] < 41
    fewest = record(explore(Toy()), tmp_path, budget=Budget(positions=1))
    assert fewest.counts == {"size": 3, "height": 3, "colour": 3, "lit": 2}
    words = r"^Toy: its fewest positions, \d+, do not fit into 0.03 MB: they take 0.1 MB.$"
    with pytest.raises(BudgetError, match=words):
        record(explore(Noisy(), "height"), tmp_path / "large", budget=Budget(size=30_000))
    assert not [*(tmp_path / "large").glob("*.js")]
    with pytest.raises(ValueError, match="together must name controls that are shown, size, got 'height'"):
        explore(Toy(), "size", together=("size", "height"))


def test_no_share_is_drawn_that_is_foretold_to_be_too_large(tmp_path):
    Steep.drawn.clear()
    made = record(explore(Steep(), "height"), tmp_path, budget=Budget(size=100_000))
    assert made.counts["height"] == 11
    assert len(set(Steep.drawn)) == 21  # 3 and 21, which were too large, and 11 of these; 15 would have been others


class Doubled(anywidget.AnyWidget):
    """A widget whose page sets a trait, and whose kernel answers with another."""

    _esm = "export default { render({ model, el }) {} }"
    x = traitlets.Int(1).tag(sync=True)
    twice = traitlets.Int(2).tag(sync=True)

    @traitlets.observe("x")
    def _follow(self, change: dict[str, int]) -> None:
        self.twice = 2 * change["new"]


def test_a_widget_that_is_moved_by_its_traits_is_recorded_too(tmp_path):
    made = record(Widget(Doubled(), (Axis.slider("x", 0, 4, 1, 1),), "Doubled"), tmp_path)
    assert [frame for _, frame in states(made)] == [{"x": x, "twice": 2 * x} for x in range(5)]
    made = record(Widget(Smallest(), (Axis.slider("x", 0.0, 100.0, 0.1, 0.0, most=5),), "A dot"), tmp_path)
    drawn = [one for _, frame in states(made) for one in ElementTree.fromstring(frame["svg"]).iter() if one.get("cx")]
    assert [one.get("cx") for one in drawn] == ["0.0", "150.0", "300.0", "450.0", "600.0"]


def test_a_pull_is_learnt_as_the_view_answers_it():
    does = Explored(explore(Toy(), "size")).traits["hands"]["size"]
    direction, after = does["pulls"]["size"]
    assert direction == "x"
    assert after[24:27] == pytest.approx([1.0, 1 + 20 / 30, 1 + 40 / 30])
    assert does["keys"] == {"ArrowRight": {"size": 1}, "ArrowLeft": {"size": -1}}
    drawn = Explored(explore(ReadoutView(), "time")).traits["hands"]
    assert [does["pulls"]["time"][0] for does in drawn.values()] == ["x"]


@pytest.mark.parametrize("name", ["toy.mjs", "toy.html"])
def test_a_recording_in_one_file_has_all_its_files_within(tmp_path, name):
    made = record(explore(Toy(), "size"), tmp_path / "recorded", budget=Budget(slider=5))
    text = write_one_file(made, tmp_path / name).read_text(encoding="utf-8")
    photographs = [one for one in made.files if one.endswith(".webp")]
    assert len(photographs) == 4  # of sizes 0 to 7.5; 10 is refused
    for one in photographs:
        data = b64encode((made.folder / one).read_bytes()).decode()
        assert f'camvizRecorded("{one}","data:image/webp;base64,{data}")' in text
    assert text.count("A still picture.") == 1
    with pytest.raises(ValueError, match=r"the file must end in \.mjs \(a module\) or \.html \(a page\), got toy\.js"):
        write_one_file(made, tmp_path / "toy.js")
    html = made.html("files/")  # the still is outside the page, with its words and sizes
    still = html.partition('src="files/')[2].partition('"')[0]
    assert "data:image/webp;base64," in (made.folder / still).read_text()
    assert 'alt="Toy. size 1, height 0, red, True"' in html
    assert 'loading="lazy" width="300" height="200"' in html
    assert f'data-recording="files/{made.pack}" data-positions="{made.positions}"' in html


def test_a_text_is_packed_without_loss_and_kept_once():
    pack, texts = Pack(), [f"<g>{'<line x=1/>' * 20}<text>{i}</text>plain {i}</g>" * 3 for i in range(3)]
    packed = [pack.packed(one) for one in texts]
    assert [unpacked(one, pack.pieces, 1.0) for one in packed] == texts
    assert pack.pieces.count("<line x=1/>") == 1
    assert len(Images().stored({"a": [1, "x"]})["a"]) == 2


def test_no_text_of_a_widget_ends_the_script_of_a_page(tmp_path):
    class Talker(anywidget.AnyWidget):
        _esm = "export default { render({ el }) { el.innerHTML = '<!-- <script></script>'; } };"
        words = traitlets.Unicode("</script><b>out</b>").tag(sync=True)

    made = record(Widget(Talker(), (), "Talker"), tmp_path)
    assert write_one_file(made, tmp_path / "page.html").read_text(encoding="utf-8").count("</script") == 1
