"""What a calibration holds for: its file keeps it, and new pictures that contradict it are named."""

import json
import struct
from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

import camviz
import camviz_clinic
from camviz_clinic.calibration.stamp import Stamp, now
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks import check, inspect
from camviz_clinic.checks.stamps import contradictions, holds_for, settings_differ, size_change
from camviz_clinic.checks.summary import Summary
from camviz_clinic.checks.virtual import detections, healthy, single
from camviz_clinic.commands.command import main
from camviz_clinic.files import CalibrationError, write

CANON = {0x010F: "Canon", 0x0110: "Canon EOS 80D"}
LENS = {0x9003: "2026:01:31 12:34:56", 0x920A: IFDRational(35, 1), 0x9206: IFDRational(21, 10), 0xA434: "EF-S18-55mm"}


def picture(path, tags=CANON, exif=LENS, size=(64, 48)):
    """A JPEG with these tags, of TIFF's directory and of EXIF's."""
    held = Image.Exif()
    held.update(tags)
    held.get_ifd(0x8769).update(exif)
    Image.new("L", size, 128).save(path, exif=held)
    return path


def test_the_stamp_of_pictures_is_their_exif(tmp_path):
    later = LENS | {0x9003: "2026:01:31 13:00:00", 0xA431: "7"}
    paths = [picture(tmp_path / "a.jpg"), picture(tmp_path / "b.jpg", exif=later)]
    stamp = Stamp.of(paths, model="standard")
    assert stamp == Stamp(
        model="standard",
        cameras=("Canon EOS 80D", "Canon EOS 80D, no. 7"),
        lenses=("EF-S18-55mm",),
        focal_lengths=(35.0,),
        focus_distances=(2.1,),
        taken=("2026-01-31 12:34", "2026-01-31 13:00"),
    )


@pytest.mark.parametrize(("distance", "known"), [((0xFFFFFFFF, 1), (1000.0,)), ((0, 1), ()), ((1, 0), ())])
def test_focus_at_infinity_is_a_kilometre_and_0_is_unknown(tmp_path, distance, known):
    path = picture(tmp_path / "a.jpg", exif={0x9206: IFDRational(*distance)})
    assert Stamp.of([path]).focus_distances == known


@pytest.mark.parametrize("ending", ["tif", "png", "webp"])
def test_exif_is_read_from_other_pictures_too(tmp_path, ending):
    assert Stamp.of([picture(tmp_path / f"a.{ending}")]).cameras == ("Canon EOS 80D",)


def test_a_picture_without_exif_or_with_a_damaged_one_tells_nothing(tmp_path):
    plain, damaged = tmp_path / "a.png", tmp_path / "b.jpg"
    Image.new("L", (8, 8)).save(plain)
    content = picture(damaged).read_bytes()
    damaged.write_bytes(content.replace(struct.pack(">H", 0x8769), b"\xff\xff").replace(b"MM\0*", b"MM\0\xff"))
    assert Stamp.of([plain, damaged, tmp_path / "missing.jpg"]) == Stamp()


def test_what_exif_says_is_printable_and_short(tmp_path):
    path = picture(tmp_path / "a.jpg", {0x0110: "x\x1b[31m\n" + "y" * 500}, {})
    (camera,) = Stamp.of([path]).cameras
    assert camera.isprintable()
    assert len(camera) == 100


def test_the_time_is_that_of_source_date_epoch(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert now() == "2023-11-14 22:13 UTC"


STAMP = Stamp(
    made="2026-01-31 12:34 UTC",
    program="camviz 0.1.0",
    model="standard",
    views=20,
    conditions='21 °C: "taped" at 50 %',
    cameras=("7", "Canon EOS 80D"),
    lenses=("null",),
    focal_lengths=(35.0, 35.5),
    focus_distances=(2.1,),
    digital_zooms=(1.0,),
    taken=("2026-01-31 12:00",),
)


@pytest.mark.parametrize("ending", [".yml", ".xml", ".json"])
def test_opencvs_file_keeps_the_stamp(tmp_path, ending):
    calibration = replace(healthy(np.random.default_rng(2)), stamps={"camera": STAMP})
    path = tmp_path / f"camera{ending}"
    assert write(calibration, path, "opencv") == ()
    assert camviz_clinic.load(path).stamps == {"camera": STAMP}
    assert cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ).getNode("stamp").getNode("views").real() == 20


def test_a_stamp_that_makes_no_sense_is_refused_by_its_key(tmp_path):
    calibration = replace(healthy(np.random.default_rng(2)), stamps={"camera": STAMP})
    path = tmp_path / "camera.yml"
    write(calibration, path, "opencv")
    text = path.read_text()
    for old, new, said in (
        ("- 35.\n", "- 0\n", r"stamp\.focal_lengths: expected positive numbers, got 0"),
        ("views: 20", "views: -1", r"stamp\.views: expected a whole number"),
        ("- 35.\n", "- many\n", r"stamp\.focal_lengths\[0\]: expected a number"),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(CalibrationError, match=said):
            camviz_clinic.load(path)


def test_another_format_says_that_the_stamp_is_left_out(tmp_path):
    calibration = replace(healthy(np.random.default_rng(2)), stamps={"camera": STAMP})
    assert "what it was made for and when" in write(calibration, tmp_path / "camera.yaml", "ros")


def test_the_time_that_opencvs_sample_writes_is_when_it_was_made(tmp_path):
    path = tmp_path / "a.yml"
    path.write_text(
        '%YAML:1.0\n---\ncalibration_time: "Thu Jul 24 10:11:12 2008"\nimage_width: 640\nimage_height: 480\n'
        "K: [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\nD: [0.1, 0, 0, 0, 0]\n"
    )
    calibration = camviz_clinic.load(path)
    assert calibration.stamps["camera"].made == "Thu Jul 24 10:11:12 2008"
    assert "calibrated Thu Jul 24 10:11:12 2008" in Summary.of(calibration).origin
    assert Summary.of(calibration).holds == ()


SIZES = [
    ((1280, 960), (640, 480), "binning", "fits binning 2×2 or resizing by 1/2"),
    ((640, 480), (1280, 960), "binning", "fits a calibration from pictures after binning 2×2 or resizing by 1/2"),
    ((1280, 960), (960, 720), "resizing", "fits resizing by 0.75, for the aspect is the same"),
    ((1280, 960), (1280, 720), "crop", "fits a crop to 1280×720 and no resizing, for the aspect changes"),
    ((1280, 720), (1280, 960), "crop", "fits a calibration from a crop to 1280×720 and no resizing"),
    ((1920, 1200), (960, 540), "binning and crop", "fits binning 2×2 and then a crop to 960×540"),
    ((1280, 960), (960, 1280), "turn", "fits pictures turned by a quarter"),
    ((1280, 960), (1400, 900), "unknown", "neither a factor nor a crop explains"),
    ((2591, 1943), (1295, 971), "binning", "fits binning 2×2"),
]


@pytest.mark.parametrize(("was", "now", "kind", "words"), SIZES)
def test_another_size_is_named_by_aspect_and_factor(was, now, kind, words):
    change = size_change(was, now)
    assert change.kind == kind
    assert change.words.startswith(words)


def test_binned_and_cropped_pictures_are_named_where_they_are_compared():
    calibration = healthy(np.random.default_rng(2))
    grid = calibration.cameras["camera"].intrinsics
    (found,) = [
        each
        for each in inspect(calibration, pictures={"a.png": (grid.width // 2, grid.height // 2)}).findings
        if each.id == "wrong-size"
    ]
    assert "which fits binning 2×2 or resizing by 1/2." in found.sentence


def test_a_check_of_cropped_pictures_says_that_a_crop_fits():
    set_up = single(np.random.default_rng(4))
    calibration, seen = set_up.solved(set_up.observed(np.random.default_rng(1))), set_up.corners[0]
    cropped = replace(detections(set_up.camera, seen), height=set_up.camera.intrinsics.height - 100)
    judged = check(calibration, cropped)
    assert judged.verdict == "fail"
    assert judged.worst.numbers["size_change"] == "crop"
    assert "fits a crop to" in judged.worst.reason


def said(calibrated, new):
    return {each.what: each for each in contradictions(calibrated, new)}


def test_another_camera_lens_focal_length_focus_and_zoom_contradict():
    new = Stamp(cameras=("Sony A",), lenses=("x",), focal_lengths=(50.0,), focus_distances=(0.5,), digital_zooms=(2.0,))
    found = said(STAMP, new)
    assert list(found) == ["camera", "lens", "focal length", "focus", "digital zoom"]
    assert "Sony A; the calibration is of 7 and Canon EOS 80D" in found["camera"].sentence
    assert found["focal length"].value == pytest.approx(50 / 35.5)
    image = [0.0355 * d / (d - 0.0355) for d in (0.5, 2.1)]  # the thin lens: 1/F = 1/d + 1/image
    assert found["focus"].value == pytest.approx(image[0] / image[1])
    assert not found["focus"].harmless


def test_what_one_of_the_two_does_not_tell_is_no_contradiction():
    assert said(STAMP, Stamp()) == said(Stamp(), STAMP) == said(STAMP, STAMP) == {}


def test_a_focus_that_moves_nothing_is_harmless():
    near, far = Stamp(focal_lengths=(8.0,), focus_distances=(10.0,)), Stamp(focus_distances=(1000.0,))
    assert said(near, far)["focus"].harmless


def test_a_check_tells_contradictions_beside_the_verdict():
    set_up = single(np.random.default_rng(4))
    calibration = replace(set_up.solved(set_up.observed(np.random.default_rng(1))), stamps={"camera": STAMP})
    seen = detections(set_up.camera, set_up.corners[0])
    judged = check(calibration, seen, taken={"camera": Stamp(focal_lengths=(24.0,))})
    (told,) = json.loads(judged.as_json())["contradictions"]
    assert (told["of"], told["what"], told["value"]) == ("camera", "focal length", pytest.approx(24 / 35))
    assert "camera: the pictures contradict the calibration: their focal length is 24 mm" in judged.as_text()
    assert judged.verdict == check(calibration, seen).verdict
    assert holds_for(calibration, "camera") in judged.as_text()


def test_an_inspection_with_pictures_names_another_focal_length(tmp_path):
    calibration = replace(healthy(np.random.default_rng(2)), stamps={"camera": STAMP})
    path = picture(tmp_path / "a.jpg", exif=LENS | {0x920A: IFDRational(18, 1), 0xA434: "null"})
    inspection = inspect(calibration, photographs=[path])
    (found,) = [each for each in inspection.findings if each.id == "other-settings"]
    assert "their focal length is 18 mm, the calibration's 35 mm" in found.sentence
    assert inspection.as_tree()["cameras"][0]["stamp"]["focal_lengths"] == [35.0, 35.5]
    assert "other-settings" in dict(inspect(calibration).skipped)


def test_what_it_holds_for_is_a_sentence():
    calibration = Calibration(healthy(np.random.default_rng(2)).cameras, "a.yml", "made", stamps={"camera": STAMP})
    grid = calibration.cameras["camera"].intrinsics
    assert holds_for(calibration, "camera") == (
        f"camera: holds for pictures of {grid.width} × {grid.height} px, taken by 7, Canon EOS 80D, null, at 35 to "
        "35.5 mm, focused at 2.1 m. Another crop, binning, focus or zoom makes it void. "
        'Conditions: 21 °C: "taped" at 50 %.'
    )


def test_what_it_holds_for_is_said_with_what_is_known():
    known = Stamp(program="camviz", focal_lengths=(35.0,))
    calibration = Calibration(healthy(np.random.default_rng(2)).cameras, "a.yml", "made", stamps={"camera": known})
    assert " px, taken at 35 mm. Another crop" in holds_for(calibration, "camera")
    bare = replace(calibration, stamps={"camera": Stamp(program="camviz")})
    assert holds_for(bare, "camera").endswith("void. Its pictures do not tell camera, lens, focal length or focus.")


def test_a_zoom_that_moved_between_the_pictures_is_said():
    (sentence,) = settings_differ(Stamp(focal_lengths=(24.0, 35.0)))
    assert sentence == "The zoom moved between the pictures, from 24 to 35 mm (EXIF)."
    assert settings_differ(STAMP)[0] == "The pictures were taken with 2 cameras, 7 and Canon EOS 80D."


def test_calibrate_stamps_and_check_contradicts(tmp_path, monkeypatch, capsys):
    """Three pictures of a board with EXIF: the file holds it, and pictures at another focal length are named."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    boards = [_photographed(tmp_path / f"{view}.jpg", view, 35) for view in range(4)]
    out = tmp_path / "camera.yaml"
    words = [*map(str, boards), "--board", "7x5", "--square-mm", "30", "--workers", "1"]
    assert main(["calibrate", *words, "-o", str(out), "--conditions", "21 °C"]) == 0
    stamp = camviz_clinic.load(out).stamps["camera"]
    assert (stamp.made, stamp.program, stamp.model) == (now(), f"camviz {camviz.__version__}", "standard")
    assert (stamp.views, stamp.focal_lengths, stamp.conditions) == (4, (35.0,), "21 °C")
    other = [str(_photographed(tmp_path / f"new{view}.jpg", view, 24)) for view in range(4)]
    capsys.readouterr()
    main(["check", str(out), *other])
    assert "their focal length is 24 mm, the calibration's 35 mm" in capsys.readouterr().out


def _photographed(path, view, focal_mm):
    """A 7 × 5 chessboard as a camera sees it, with the focal length in its EXIF."""
    squares = np.kron(np.indices((6, 8)).sum(axis=0) % 2, np.ones((40, 40))) * 200 + 30
    flat = np.pad(squares, 60, constant_values=230).astype(np.uint8)
    high, wide = flat.shape
    K = np.array([[600, 0, 320], [0, 600, 240], [0, 0, 1.0]])
    turn = cv2.Rodrigues(np.array([(0.4, -0.3, 0.1), (-0.4, 0.2, 0), (0.1, 0.45, -0.1), (0.3, 0.4, 0.2)][view]))[0]
    place = turn @ [[0.001, 0, -0.0005 * wide], [0, 0.001, -0.0005 * high], [0, 0, 0]] + [[0] * 3, [0] * 3, [0, 0, 0.6]]
    seen = cv2.warpPerspective(flat, K @ place, (640, 480), borderValue=230, flags=cv2.INTER_AREA)
    held = Image.Exif()
    held.get_ifd(0x8769)[0x920A] = IFDRational(focal_mm, 1)
    Image.fromarray(cv2.GaussianBlur(seen, (0, 0), 0.8)).save(path, quality=98, exif=held)
    return path
