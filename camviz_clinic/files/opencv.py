"""OpenCV FileStorage: one camera or a pair, under the spellings that OpenCV's samples and tutorials use."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Any
from urllib.parse import unquote

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt, Lens, Perspective, UnifiedSphere
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.line_delay import LineDelay
from camviz_clinic.calibration.stamp import LONGEST, Stamp
from camviz_clinic.calibration.types import Board, Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.opencv_redundancy import redundancies
from camviz_clinic.files.opencv_writing import TITLE, UNDISTORTED, write
from camviz_clinic.files.section import Section, Size, agreed_size, explained

# Spellings are compared without capitals and underscores: Camera_Matrix, cameraMatrix and camera_matrix are one.
MATRIX = "cameramatrix|intrinsicmatrix|intrinsics|mtx|k|m"
DISTORTION = "distortioncoefficients|distortioncoeffs|distcoeffs|distcoeff|distortion|dist|d"
WIDTH, HEIGHT, SIZE = "(image|img)?width", "(image|img)?height", "(image|img)size|resolution"
ROTATION, TRANSLATION = "r|rotation|rotationmatrix", "t|translation|translationvector"
PROJECTION = "p|projection(matrix)?"
OF_A_PAIR = {"E": "e|essential(matrix)?", "F": "f|fundamental(matrix)?", "Q": "q|disparitytodepth(map|matrix)?"}
EXTRINSICS, ERRORS, DETECTIONS = "extrinsicparameters", "perviewreprojectionerrors", "imagepoints"
PICTURES, ASIDE, LINE_DELAY = "picturenames", "setaside", "linedelay"
ESTIMATED, COVARIANCE, PRIOR = "estimatedparameters", "intrinsicscovariance", "denominatorprior"

STAMP = "stamp"
NUMBERS = ("focal_lengths", "focus_distances", "digital_zooms")
SEVERAL = ("cameras", "lenses", "taken")

PAIRS = ({"0", "1"}, {"1", "2"}, {"l", "r"}, {"left", "right"})
FOUR_COEFFICIENTS = (
    "Four distortion coefficients are read as k1 k2 p1 p2; cv2.fisheye writes four as well, "
    "and a file of its needs the line fisheye_model: 1."
)


def camera_tags(section: Section) -> set[str]:
    """What the names of the camera matrices end (or begin) with: {""} for one camera, {"1", "2"} for M1 and M2."""
    matrices = {key for key, value in section.values.items() if isinstance(value, (dict, list))}
    return {tag for key in matrices if (tag := _tag(key, MATRIX)) is not None}


def read(file: File) -> Calibration:
    """One camera, or a pair with X_right = R X_left + T; the world is the left camera's frame."""
    tags = camera_tags(file.section)
    if len(tags) == 1:
        return _read_one(file, tags.pop())
    if tags in PAIRS:
        return _read_pair(file, *sorted(tags))
    keys = ", ".join(sorted(key for key in file.section.values if _tag(key, MATRIX) is not None))
    raise CalibrationError(f"expected one camera matrix or a pair such as M1 and M2, got {keys}")


def _read_one(file: File, tag: str) -> Calibration:
    section = file.section
    name = section.text("camera_name") if "camera_name" in section else "camera"
    camera, notes = _camera(section, tag, image_size(section, file.size)), _notes(section, [tag])
    if key := _find(section, ROTATION):
        section.rotation(key)
        notes.append("R and T are not used: the file holds one camera, and it stands at the origin.")
    return Calibration({name: camera}, file.path, TITLE, **_recorded(section, {name: tag}, notes))


def _read_pair(file: File, left: str, right: str) -> Calibration:
    section = file.section
    size, notes = image_size(section, file.size), _notes(section, [left, right])
    right_from_left = _right_from_left(section)
    if right_from_left is None:
        right_from_left = RigidTransform.identity()
        notes.append("The file holds no R and T: both cameras are drawn at the same place.")
    for tag in (left, right):
        if key := _find(section, ROTATION, tag):
            section.rotation(key)
    cameras = {
        "left": _camera(section, left, size),
        "right": _camera(section, right, size).at(right_from_left.inv()),
    }
    recorded = _recorded(section, {"left": left, "right": right}, notes)
    redundant = tuple(redundancies(section, _pair_keys(section, left, right), *cameras.values()))
    return Calibration(cameras, file.path, f"{TITLE}, stereo", redundant=redundant, **recorded)


def _pair_keys(section: Section, left: str, right: str) -> dict[str, str]:
    """The keys of what OpenCV computes of a pair, by the names that its manual has for them."""
    spelled = {"R": (ROTATION, ""), "T": (TRANSLATION, "")}
    spelled |= {name: (spelling, "") for name, spelling in OF_A_PAIR.items()}
    if not _find(section, TRANSLATION, left):  # else these are poses
        spelled |= {f"R{number}": (ROTATION, tag) for number, tag in enumerate((left, right), 1)}
    spelled |= {f"P{number}": (PROJECTION, tag) for number, tag in enumerate((left, right), 1)}
    found = {name: [key for key in section.values if _tag(key, words) == tag] for name, (words, tag) in spelled.items()}
    return {name: keys[0] for name, keys in found.items() if keys}


def image_size(section: Section, given: Size | None) -> Size:
    """Width and height from the file, or as given where the file is silent; never one against the other."""
    if key := _find(section, SIZE):
        held = section.size(key)
    else:
        held = section.sides(_find(section, WIDTH) or "image_width", _find(section, HEIGHT) or "image_height")
    return agreed_size(held, given, "image_width, image_height")


def _camera(section: Section, tag: str, size: Size) -> Camera:
    key = _find(section, MATRIX, tag) or "camera_matrix"
    return Camera(section.intrinsics(section.matrix(key, 3, 3), section.where(key), size), _lens(section, tag))


def _lens(section: Section, tag: str) -> Lens:
    key = _find(section, DISTORTION, tag)
    if key is None:
        raise CalibrationError(
            f"expected distortion coefficients (distortion_coefficients, D{tag} …) beside the camera matrix, "
            "found none; a lens without distortion has five zeros"
        )
    with explained(section.where(key)):
        if xi := _find(section, "xi", tag):
            return UnifiedSphere(section.number(xi), *section.coefficients(key, [4], "k1 k2 p1 p2 of cv2.omnidir"))
        if _is_fisheye(section):
            return KannalaBrandt(*section.coefficients(key, [4], "k1 k2 k3 k4 of cv2.fisheye"))
        lens = BrownConrady.from_coefficients(section.coefficients(key, [4, 5, 8, 12, 14], "k1 k2 p1 p2 k3 …"))
        return Perspective() if section.values.get(UNDISTORTED) in (1, "1") and lens == BrownConrady() else lens


def _is_fisheye(section: Section) -> bool:
    if section.values.get("distortion_model") == "fisheye":  # as VOXL writes it
        return True
    key = _find(section, "(is)?fisheye(model)?")
    return key is not None and section.values[key] in (1, True, "1")


def _notes(section: Section, tags: list[str]) -> list[str]:
    keys = [key for tag in tags if (key := _find(section, DISTORTION, tag)) and not _find(section, "xi", tag)]
    said = _find(section, "(is)?fisheye(model)?") or "distortion_model" in section
    four = any(section.array(key).size == 4 for key in keys) and not said
    return [FOUR_COEFFICIENTS] if four else []


def _right_from_left(section: Section) -> RigidTransform | None:
    rotation, translation = _find(section, ROTATION), _find(section, TRANSLATION)
    if rotation is None and translation is None:
        return None
    t = section.vector(translation or "T", [3], "x y z of the left camera's origin in the right camera's frame")
    return RigidTransform.from_components(t, section.rotation(rotation or "R"))


def _recorded(section: Section, tags: dict[str, str], notes: list[str]) -> dict[str, Any]:
    """All that a calibration holds beside its cameras, whose names have the tags of their keys."""
    by_name: dict[str, dict[str, Any]] = {}
    for name, tag in tags.items():
        of_camera = _views(section, tag) | _solution(section, tag) | _stamp(section, tag) | _line_delay(section, tag)
        for field, value in of_camera.items():
            by_name.setdefault(field, {})[name] = value
    skipped = words(section, "skipped_pictures")
    if len(skipped) % 2:
        raise section.error("skipped_pictures", "pairs of a picture and a reason", f"{len(skipped)} words")
    pairs = tuple(zip(skipped[::2], skipped[1::2], strict=True))
    said = (*notes, *words(section, "notes"))
    return by_name | _warp(section) | {"board": _board(section), "skipped": pairs, "notes": said}


def _warp(section: Section) -> dict[str, Array]:
    """The board's two sagittas and their covariance, where the file has them."""
    values = {}
    if "board_warp" in section:
        values["board_warp"] = np.array(section.vector("board_warp", [2], "sagittas along x and y"))
    if "board_warp_covariance" in section:
        values["board_warp_covariance"] = section.matrix("board_warp_covariance", 2, 2)
    for array in values.values():
        array.flags.writeable = False
    return values


def words(section: Section, key: str) -> tuple[str, ...]:
    """A list of words, in which OpenCV's troublesome characters are written %XX; empty where there is none."""
    if key not in section:
        return ()
    value = section.values[key]
    listed = value if isinstance(value, list) else [value]
    return tuple(unquote(Section({str(i): one}, section.where(key)).text(str(i))) for i, one in enumerate(listed))


def _board(section: Section) -> Board | None:
    keys = [_find(section, name) for name in ("boardwidth", "boardheight", "squaresize")]
    width, height, square = keys
    if width is None or height is None or square is None:
        return None
    with explained(section.where("board")):
        marker = section.number("marker_size") if "marker_size" in section else None
        dictionary = section.text("marker_dictionary") if "marker_dictionary" in section else None
        kind = section.text("board_kind") if "board_kind" in section else ""
        columns, rows = section.whole(width, 1000), section.whole(height, 1000)
        legacy = bool(section.whole("marker_legacy", 1)) if "marker_legacy" in section else False
        first = section.whole("marker_first_id", 100_000) if "marker_first_id" in section else 0
        border = section.whole("marker_border_bits", 2) if "marker_border_bits" in section else 1
        return Board(
            columns=columns,
            rows=rows,
            square_size=section.number(square),
            marker_size=marker,
            dictionary=dictionary,
            kind=kind,
            legacy=legacy,
            first_id=first,
            border_bits=border,
        )


def _views(section: Section, tag: str) -> dict[str, Any]:
    """What the file keeps of each view of a camera: corners, poses, errors …; all of the same number of views."""
    views: dict[str, Any] = {}
    if key := _find(section, DETECTIONS, tag):
        views["detections"] = _detections(section, key)
    if key := _find(section, EXTRINSICS, tag):
        views["cam_from_board"] = _board_poses(section, key)
    if key := _find(section, ERRORS, tag):
        views["per_view_errors"] = section.array(key).ravel()
    if key := _find(section, PICTURES, tag):
        views["pictures"] = words(section, key)
    if key := _find(section, ASIDE, tag):
        views["set_aside"] = _mask(section, key, views.get("detections"))
    counts = {field: len(values) for field, values in views.items()}
    if len(set(counts.values())) > 1:
        held = ", ".join(f"{count} {field}" for field, count in counts.items())
        raise CalibrationError(f"expected the same number of views everywhere, got {held}")
    for values in views.values():
        if isinstance(values, np.ndarray):
            values.flags.writeable = False
    return views


def _solution(section: Section, tag: str) -> dict[str, Any]:
    """Which intrinsics of a camera were estimated, their covariance, and the prior that they were estimated under."""
    solution: dict[str, Any] = {}
    if key := _find(section, ESTIMATED, tag):
        solution["estimated"] = words(section, key)
        if not all(re.fullmatch("[a-z]+(_[xy]|[0-9])?", name) for name in solution["estimated"]):
            raise section.error(key, "names such as fx, cx and k1", ", ".join(solution["estimated"])[:60])
    if key := _find(section, COVARIANCE, tag):
        count = len(solution.get("estimated", ()))
        solution["intrinsics_covariance"] = section.matrix(key, count, count)
        solution["intrinsics_covariance"].flags.writeable = False
    if key := _find(section, PRIOR, tag):
        values = section.matrix(key, 1, 3).ravel().tolist()
        if not min(values) > 0:
            raise section.error(key, "three positive numbers (reach, deviation, noise)", values)
        solution["priors"] = DenominatorPrior(*values)
    return solution


def _stamp(section: Section, tag: str) -> dict[str, Any]:
    """What `camviz calibrate` says of how and when the calibration was made; of other programs their time of it."""
    key = _find(section, STAMP, tag)
    if key is None:
        time = section.values.get("calibration_time")
        return {"stamps": Stamp(made=time[:LONGEST])} if isinstance(time, str) and time.isprintable() else {}
    part, held = section.section(key), dict[str, Any]()
    for each in fields(Stamp):
        if each.name not in part:
            continue
        if each.name in NUMBERS:
            held[each.name] = tuple(sorted(float(x) for x in part.array(each.name).ravel()))
            if min(held[each.name], default=1.0) <= 0:
                raise part.error(each.name, "positive numbers", f"{held[each.name][0]:g}")
        elif each.name == "views":
            held[each.name] = part.whole(each.name, 1_000_000)
        else:
            said = tuple(" ".join(word.split())[: 10 * LONGEST] for word in words(part, each.name))
            held[each.name] = said if each.name in SEVERAL else " ".join(said)
    return {"stamps": Stamp(**held)}


def _line_delay(section: Section, tag: str) -> dict[str, Any]:
    """How long a rolling shutter takes from row to row, in seconds, as `camviz calibrate` writes it."""
    key, spread = _find(section, LINE_DELAY, tag), _find(section, f"{LINE_DELAY}sigma", tag)
    if key is None:
        return {}
    sigma = None if spread is None else section.number(spread)
    if sigma is not None and not sigma >= 0:
        raise section.error(spread or key, "a standard deviation in seconds", f"{sigma:g}")
    return {"line_delays": LineDelay(section.number(key), sigma)}


def _mask(section: Section, key: str, detections: Any) -> Any:
    """Ones for the corners of `detections` that were set aside, zeros for the others."""
    mask = section.array(key)
    if detections is None or mask.shape != detections.shape[:2] or not np.isin(mask, (0, 1)).all():
        expected = "of image_points" if detections is None else "×".join(map(str, detections.shape[:2]))
        raise section.error(key, f"a 0 or a 1 for each of the corners {expected}", "×".join(map(str, mask.shape)))
    return mask == 1


def _detections(section: Section, key: str) -> Any:
    points = section.array(key, damaged=True)
    if points.ndim != 3 or points.shape[-1] != 2:
        raise section.error(key, "views × corners × 2 pixels", "×".join(map(str, points.shape)))
    return points


def _board_poses(section: Section, key: str) -> RigidTransform:
    vectors = section.array(key)
    if vectors.ndim != 2 or vectors.shape[1] != 6 or not len(vectors):
        raise section.error(key, "views × 6 numbers (rotation vector, translation)", "×".join(map(str, vectors.shape)))
    return RigidTransform.from_components(vectors[:, 3:], Rotation.from_rotvec(vectors[:, :3]))


def _find(section: Section, spellings: str, tag: str = "") -> str | None:
    """The one key that is a spelling of a name with its camera's tag; CalibrationError where two are."""
    found = [key for key in section.values if key in section and _tag(key, spellings) == tag]
    if len(found) > 1:
        raise CalibrationError(f"expected one of the keys {' and '.join(found)}, got both")
    return found[0] if found else None


def _tag(key: str, spellings: str) -> str | None:
    plain = key.replace("_", "").lower()
    match = re.fullmatch(rf"(?P<before>left|right)?(?:{spellings})(?P<after>[0-9]|left|right|l|r)?", plain)
    return match and (match["before"] or "") + (match["after"] or "")


FORMAT = Format(
    name="opencv",
    title=TITLE,
    file="camera.yml, .xml or .json",
    recognise=lambda file: camera_tags(file.section),
    read=read,
    write=write,
    endings=(".yml", ".xml", ".json"),
    most_cameras=2,
    models="5, 8, 12, 14 coefficients; `fisheye_model: 1` or VOXL's `distortion_model: fisheye`; `xi` of omnidir; "
    "`undistorted: 1` of a pinhole",
    says="X_right = R X_left + T",
    lacks="skew (but for omnidir)",
    rank=80,
)
