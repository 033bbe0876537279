"""An inspection as one HTML file: the findings in words, then the views, linked with each other."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path

import numpy as np

from camviz.cameras import transform
from camviz.draw import svg
from camviz.draw.items import Face, Item, Label, Line
from camviz.draw.page import document
from camviz.draw.panel import image_panel
from camviz.draw.picture import Picture
from camviz.draw.space import OrbitCamera, axes_triad, camera_body, draw_space, space_panel
from camviz.poses import RigidTransform
from camviz_clinic.checks import words
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.checks.registry import Finding
from camviz_clinic.checks.summary import MOST_CAMERAS
from camviz_clinic.report.findings import findings_html, verdict_html
from camviz_clinic.report.pictures import embedded, figure
from camviz_clinic.views.board_poses import BoardPosesView
from camviz_clinic.views.catalogue import ALIASES, VIEWS, Case, Entry, title_of
from camviz_clinic.views.chessboard import outline
from camviz_clinic.views.missing import MissingView
from camviz_clinic.views.observations import Observations, short_names
from camviz_clinic.views.residuals import ResidualsView, bars_panel

MOST_VIEWS = 24  # pictures of views that a page holds: the worst of them
MOST_BOARDS = 20  # of views whose pictures are not on the page


Folders = str | PathLike[str] | Mapping[str, Path]
"""The folder of a calibration's pictures, or one by the name of each camera."""


def write_report(inspection: Inspection, path: str | PathLike[str], *, images: Folders | None = None) -> None:
    """Write the report of an inspection to `path`; `images` says where the calibration's pictures are."""
    Path(path).write_text(report(inspection, images=images), encoding="utf-8")


def report(inspection: Inspection, *, images: Folders | None = None) -> str:
    """The report as HTML text, readable without a network and without JavaScript."""
    layout, script = (
        (files("camviz_clinic.report") / name).read_text(encoding="utf-8") for name in ("report.css", "report.js")
    )
    if inspection.calibration is None:
        views = (finding.view for finding in inspection.findings)
        body = verdict_html(inspection) + _findings(inspection) + _missing(dict.fromkeys(views, _UNREAD))
        name = inspection.source.name if inspection.source else "A calibration"
        return document(f"{name}: it could not be read", body, layout=layout, script=script)
    folders = images if images is None or isinstance(images, Mapping) else Path(images)
    case = Case.of(inspection, folders)
    sections: list[tuple[Entry, str]] = []
    missing: dict[str, str] = {}
    for entry in VIEWS.values():
        shown, why = _section(case, entry, inspection)
        sections += [(entry, shown)] if shown else []
        missing |= {entry.name: why} if why else {}
    contents = "".join(f'<a href="#view-{entry.name}">{escape(entry.title)}</a> ' for entry, _ in sections)
    parts = [
        verdict_html(inspection),
        _findings(inspection),
        f'<nav aria-label="Views">{contents}</nav>',
        *(shown for _, shown in sections),
        _missing(missing),
    ]
    return document(inspection.calibration.source.name, "".join(parts), layout=layout, script=script)


_STILL = RigidTransform.identity()
_UNREAD = "The file could not be read beyond the fault above."


def _findings(inspection: Inspection) -> str:
    listed = findings_html(inspection, lambda finding: _see(inspection, finding))
    return f'<section id="findings"><h2>{words.counted(inspection.findings) or "Checks"}</h2>{listed}</section>'


def _see(inspection: Inspection, finding: Finding) -> str:
    """Links to the view that shows a finding, and to the pictures that it is about."""
    links = [f'<a href="#view-{finding.view}">{escape(title_of(finding.view))}</a>']
    calibration = inspection.calibration
    camera = finding.camera or (next(iter(calibration.cameras)) if calibration else "")
    if calibration and camera in calibration.detections:
        pictures = calibration.pictures.get(camera, ())
        for view in finding.pictures[:6]:
            name = pictures[view] if view < len(pictures) else f"view {view + 1}"
            links.append(f'<a href="#{_id(camera)}-{view + 1}">{escape(Path(name).name)}</a>')
    return f"→ {', '.join(links)}"


def _section(case: Case, entry: Entry, inspection: Inspection) -> tuple[str, str]:
    """One view's section, of each camera where it is of one; or "" and why there is none."""
    cameras = ("",) if entry.of_all else case.names[:MOST_CAMERAS]
    shown, why = "", ""
    for name in cameras:
        view = entry.view(case, name)
        if isinstance(view, ResidualsView):
            shown += _linked(case, name, len(cameras) > 1, accused(inspection, name))
        elif isinstance(view, MissingView):
            why = view.sentence
        else:
            shown += figure(name if len(cameras) > 1 else "", view.figure())
    if not shown:
        return "", why
    if len(case.names) > MOST_CAMERAS and not entry.of_all:
        shown += f'<p class="note">Shown for {MOST_CAMERAS} of {len(case.names)} cameras.</p>'
    head = f"{_anchors(entry.name)}<h2>{escape(entry.title)}</h2><p>{escape(entry.purpose)}</p>"
    return f'<section id="view-{entry.name}">{head}{shown}</section>', ""


def _anchors(name: str) -> str:
    """Where links to a view's other names lead."""
    return "".join(f'<span id="view-{alias}"></span>' for alias, of in ALIASES.items() if of == name)


def _missing(missing: Mapping[str, str]) -> str:
    """The views that could not be made, each with its anchor and the reason."""
    items = "".join(
        f'<li id="view-{name}">{_anchors(name)}<strong>{escape(title_of(name))}</strong>: {escape(why)}</li>'
        for name, why in missing.items()
    )
    return f'<section id="missing"><h2>What could not be shown</h2><ul>{items}</ul></section>' if items else ""


# A bar → its picture → its board -------------------------------------------------------------------------------------


def accused(inspection: Inspection, name: str) -> list[int]:
    """The views (from 0) of a camera that findings are about, those of the gravest finding first."""
    cameras = inspection.calibration.cameras if inspection.calibration else {}
    alone = next(iter(cameras), "")
    return [view for finding in inspection.findings if (finding.camera or alone) == name for view in finding.pictures]


def _linked(case: Case, name: str, headed: bool, named: Sequence[int]) -> str:
    """The bars of all views, and of those `named` and the worst their pictures and boards, linked by `data-choose`.

    The first of those named is chosen at first, or the worst.
    """
    seen = case.observations(name)
    shown = worst_views(seen, named)
    first = next((view for view in named if view in shown), seen.worst)
    view = ResidualsView.about(seen)
    links = {i: f"#{_id(name)}-{i + 1}" for i in shown}
    panel = bars_panel(seen)
    drawn = Picture.whole(
        view.bars_panel(panel, links=links), 960, 206,
        f"Error of every view of {name}", view.description().split(" Shown:")[0],
    )  # fmt: skip
    which = f"<p>Of the {len(seen)} views {len(shown)} are shown: those that a finding names, and the worst.</p>"
    few = which if len(shown) < seen.shown.sum() else ""
    said = f'{few}<p class="live-only">Choose a bar, or a board in space, or press the arrow keys on one.</p>'
    figures = "".join(_view_figure(view.but(view=i + 1), name, i) for i in shown)
    bars, boards = figure("", drawn), figure("", _boards(seen, name, links))
    heading = f"<h3>{escape(name)}</h3>" if headed else ""
    return (
        f'<div class="linked" data-first="{first + 1}">{heading}{said}{bars}'
        '<div class="side-by-side"><div '
        f'class="pictures">{figures}</div>{boards}</div></div>'
    )


def worst_views(seen: Observations, named: Sequence[int] = ()) -> list[int]:
    """The views (from 0) whose pictures a page holds, in their order: all of them, or those `named` and the worst."""
    errors = np.nan_to_num(seen.rms_seen, nan=-1)
    ranked = dict.fromkeys([*named, *np.argsort(-errors, kind="stable").tolist()])
    return sorted([i for i in ranked if i < len(seen) and seen.shown[i]][:MOST_VIEWS])


def _view_figure(view: ResidualsView, name: str, i: int) -> str:
    """One view's picture with its residuals, those on the board, and its figures."""
    k = view.observations.camera.intrinsics
    panel = image_panel(f"picture {i + 1}", 10, 34, 450, k.width, k.height, tallest=400)
    image, attached = view.picture_panel(panel)
    below = panel.y + panel.height + 34
    board = view.board_panel(space_panel(f"board {i + 1}", 10, below, 450, 170))
    rows = svg.join(
        svg.text((10, below + 196 + 20 * j), a, "note") + svg.text((110, below + 196 + 20 * j), b, "label")
        for j, (a, b) in enumerate(view.numbers().items())
    )
    height = below + 196 + 20 * len(view.numbers())
    described = view.description().split("Shown: ")[1]
    picture = Picture.whole(
        image + board + rows,
        470,
        height,
        view.observations.picture(i),
        described,
        attached,
    )
    return f'<figure id="{_id(name)}-{i + 1}" data-view="{i + 1}" tabindex="-1">{embedded(picture)}</figure>'


def _boards(seen: Observations, name: str, links: Mapping[int, str]) -> Picture:
    """The camera and the boards before it; each shown view's board is a group of its own, to be picked out."""
    standing, size = seen.camera, seen.board.square_size
    drawn = BoardPosesView(standing, seen.cam_from_board, seen.board, "camera")
    panel = space_panel("boards", 10, 34, 470, 470)
    away = float(np.nanmedian(seen.distances))
    middle = np.nanmedian(seen.corners_cam.mean(axis=1), axis=0)
    eye = OrbitCamera(tuple((0.7 * middle).tolist()), 1.9 * away + 0.5 * float(np.nanmax(seen.distances)), -50, 20)
    items: list[Item] = [*camera_body(standing, 2 * size, colour="blue"), *axes_triad(_STILL, 2 * size)]
    others = [i for i in range(len(seen)) if i not in links and seen.shown[i]][:MOST_BOARDS]
    items += [item for i in others for item in drawn.board_items(seen.cam_from_board[i], False)]
    content, _ = draw_space(panel, items, eye, renderer="wire")
    names = short_names(seen.pictures, len(seen))
    for i, link in links.items():
        corners = transform(seen.cam_from_board[i], outline(seen.board))
        group: list[Item] = [
            Face(corners, "orange", 0.35),
            Line(np.vstack([corners, corners[:1]]), "muted", 1.1),
            Label(corners[0], names[i], "note"),
        ]
        lines, _ = draw_space(panel, group, eye, renderer="wire")
        content += svg.group(
            lines,
            "board",
            href=link,
            data_choose=i + 1,
            tabindex=-1,
            aria_label=f"the board of {seen.picture(i)}",
        )
    body = panel.show(content, title="Where the boards were held")
    told = (
        f"The boards of {len(seen)} views of {name}, {np.nanmin(seen.distances):.2g} m to "
        f"{np.nanmax(seen.distances):.2g} m before the camera."
    )
    return Picture.whole(body, 490, 514, "Boards in space", told)


def _id(name: str) -> str:
    """A camera's name as the beginning of an anchor."""
    return "of-" + re.sub(r"[^A-Za-z0-9]+", "-", name)
