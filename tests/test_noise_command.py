"""`camviz noise` gives the figures of the sensor whose frames it reads, or says in one sentence why it cannot."""

import json
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from camviz.sensors import Sensor
from camviz_clinic.commands.command import main
from camviz_clinic.commands.noise import NOISE

SENSOR = Sensor(
    quantum_efficiency=0.5,
    full_well_e=9_000,
    read_noise_e=8.0,
    gain_dn_per_e=0.4,
    offset_dn=80,
    dark_current_e_per_s=300,
    dsnu_e=6,
    prnu=0.02,
)
PHOTONS_PER_MS = 60.0
EXPOSURES_MS = (20, 60, 100.5, 140, 180, 220, 260, 300, 340)
FIGURES = {
    "gain_dn_per_e",
    "quantum_efficiency",
    "read_noise_e",
    "snr_max_db",
    "dynamic_range_db",
    "full_well_e",
    "prnu",
    "dsnu_e",
    "dark_current_e_per_s",
    "threshold_e",
    "threshold_photons",
    "linearity_error",
    "linearity_error_min",
    "linearity_error_max",
    *(f"dsnu_{part}_e" for part in ("row", "column", "pixel")),
    *(f"prnu_{part}" for part in ("row", "column", "pixel")),
}


def expose(photons, exposure_ms, rng, sensor=SENSOR, size=(240, 320)):
    return sensor.expose(np.full(size, photons, np.float32), exposure_ms / 1000, 20.0, rng).dn


def shoot(folder, frames=2, suffix="png"):
    rng = np.random.default_rng(15)
    for t in EXPOSURES_MS:
        for number in range(frames):
            cv2.imwrite(str(folder / f"bright_{t}_{number}.{suffix}"), expose(PHOTONS_PER_MS * t, t, rng))
            cv2.imwrite(str(folder / f"dark_{t}_{number}.{suffix}"), expose(0, t, rng))


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    shoot(folder)
    return folder


@pytest.fixture
def shots(frames, tmp_path):
    """Frames of a known sensor that a test may spoil."""
    return shutil.copytree(frames, tmp_path / "shots")


def figures(capsys, *words):
    assert main(["noise", *map(str, words), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def refused(capsys, folder, *words):
    """The one sentence of a refusal that wrote nothing."""
    before = sorted(folder.parent.rglob("*"))
    assert main(["noise", str(folder), "--report", str(folder.parent / "noise.html"), *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("camviz: ")
    assert err.count("\n") == 1
    assert sorted(folder.parent.rglob("*")) == before
    return err


def test_the_figures_of_the_sensor_come_out_of_its_files(frames, capsys):
    """77k pixels and 9 levels: 0.5 % on a variance, 0.3 % on the gain. False failure: below 1e-5 (limits of 5σ)."""
    found = figures(capsys, frames, "--photons-per-ms", PHOTONS_PER_MS)
    assert set(found) == FIGURES | {"why", "bounds"}
    assert found["gain_dn_per_e"] == pytest.approx(0.4, rel=0.03)
    assert found["quantum_efficiency"] == pytest.approx(0.5, rel=0.03)
    assert found["read_noise_e"] == pytest.approx(8, rel=0.03)
    assert found["prnu"] == pytest.approx(0.02, rel=0.05)
    assert found["dsnu_e"] == pytest.approx(6, rel=0.05)
    assert found["dark_current_e_per_s"] == pytest.approx(300, rel=0.03)
    sigma = np.hypot(8, np.sqrt(1 / 12) / 0.4)
    assert found["threshold_e"] == pytest.approx(0.5 + np.sqrt(sigma**2 + 0.25), rel=0.03)
    assert found["threshold_photons"] == pytest.approx(found["threshold_e"] / 0.5, rel=0.06)


def test_what_the_frames_cannot_tell_is_null_with_its_bounds_and_the_reason(frames, tmp_path, capsys):
    """Exposures 13 % apart: the well of 9 000 electrons is seen full between 7 700 and 9 000."""
    found = figures(capsys, frames, "--photons-per-ms", PHOTONS_PER_MS)
    assert found["full_well_e"] is None
    low, high = found["bounds"]["full_well_e"]
    assert 7_500 < low < 8_500 < high < 9_100
    assert "too far apart" in found["why"]["full_well_e"]
    assert {name for name in FIGURES if found[name] is None} == set(found["why"])
    page = tmp_path / "noise.html"
    assert main(["noise", str(frames), "--report", str(page)]) == 0
    for text in (capsys.readouterr().out, page.read_text(encoding="utf-8")):
        assert "too far apart" in text
        assert re.search(r"not known, from \d+ e⁻ to \d+ e⁻", text)
        assert "σ + ½" in text


def test_without_photons_the_quantum_efficiency_is_null_and_the_reason_given(frames, capsys):
    lit = figures(capsys, frames, "--photons-per-ms", PHOTONS_PER_MS)
    found = figures(capsys, frames)
    missing = {name for name in FIGURES if found[name] is None and lit[name] is not None}
    assert missing == {"quantum_efficiency", "threshold_photons"}
    assert main(["noise", str(frames)]) == 0
    assert "not known: the photons per pixel are not known" in capsys.readouterr().out


@pytest.mark.parametrize("suffix", ["tif", "TIFF"])
def test_tiff_gives_the_same_as_png(frames, tmp_path, capsys, suffix):
    (tmp_path / "tiff").mkdir()
    for path in frames.glob("*.png"):
        cv2.imwrite(str(tmp_path / "tiff" / f"{path.stem}.tif"), cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
        (tmp_path / "tiff" / f"{path.stem}.tif").rename(tmp_path / "tiff" / f"{path.stem}.{suffix}")
    assert figures(capsys, tmp_path / "tiff") == figures(capsys, frames)


@pytest.mark.parametrize("kind", [np.float32, np.int32, np.uint32])
def test_whole_numbers_of_32_bits_give_the_same_as_16(frames, tmp_path, capsys, kind):
    for path in frames.glob("*.png"):
        cv2.imwrite(str(tmp_path / f"{path.stem}.tif"), cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(kind))
    assert figures(capsys, tmp_path) == figures(capsys, frames)


def test_eight_bits_are_read_as_they_are(tmp_path, capsys):
    """K = 0.05 DN/e⁻: a read noise of 10 e⁻ is half a step, and rounding hides most of it."""
    rng = np.random.default_rng(3)
    sensor = Sensor(full_well_e=4_000, read_noise_e=10, gain_dn_per_e=0.05, offset_dn=16, bits=8)
    for t in np.linspace(10, 340, 25).round():
        for number in range(2):
            for kind, light in (("bright", 25.0 * t), ("dark", 0.0)):
                frame = expose(light, t, rng, sensor).astype(np.uint8)
                cv2.imwrite(str(tmp_path / f"{kind}_{t:.0f}_{number}.png"), frame)
    assert figures(capsys, tmp_path)["gain_dn_per_e"] == pytest.approx(0.05, rel=0.03)


def test_the_docs_and_the_help_name_the_frames_alike():
    """Every name of a frame and every line of a descriptor stands in both."""
    formats = (Path(__file__).parent.parent / "docs" / "formats.md").read_text(encoding="utf-8")
    section = formats.split("## Frames for `camviz noise`")[1].split("\n## ")[0]
    in_docs = set(re.findall(r"`((?:bright|dark)_<[^`]+|[vnbdi] <[^`]+)`", section))
    in_help = set(re.findall(r"(?:bright|dark)_<exposure ms>_\d\.png|\b[vnbdi] <[^>]+>(?: <[^>]+>)*", NOISE))
    assert len(in_docs) == 9
    assert in_docs == in_help
    keys = {key for line in section.splitlines() if line.startswith("| `") for key in re.findall(r"`(\w+)`", line)}
    assert keys >= FIGURES | {"why", "bounds"}
    for words in ("65535", "steady, even light", "lens covered"):
        assert words in section
        assert words in NOISE


def test_twelve_bits_in_the_upper_bits_of_sixteen_have_sixteen_times_the_gain(frames, tmp_path, capsys):
    for path in frames.glob("*.png"):
        cv2.imwrite(str(tmp_path / path.name), 16 * cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    upper, plain = figures(capsys, tmp_path), figures(capsys, frames)
    assert upper["gain_dn_per_e"] == pytest.approx(16 * plain["gain_dn_per_e"])
    assert upper["read_noise_e"] == pytest.approx(plain["read_noise_e"])
    assert upper["threshold_e"] == pytest.approx(plain["threshold_e"])


def test_a_descriptor_gives_the_same_as_the_folder(frames, tmp_path, capsys):
    """With the photons in it; Windows' separators and a decimal comma, as the published ones have."""
    lines = ["# a camera", "v 4.0", "n 12 320 240"]
    for t in EXPOSURES_MS:
        lines += [f"b {t * 1e6:.0f} {PHOTONS_PER_MS * t:g}".replace(".", ",")]
        lines += [rf"i shots\bright_{t}_{number}.png" for number in range(2)]
        lines += [f"d {t * 1e6:.1f}", *(f"i shots/dark_{t}_{number}.png" for number in range(2))]
    (tmp_path / "data.txt").write_text("\n".join(lines))
    shutil.copytree(frames, tmp_path / "shots")
    expected = figures(capsys, frames, "--photons-per-ms", PHOTONS_PER_MS)
    for given in (tmp_path / "data.txt", tmp_path):
        found = figures(capsys, given)
        assert found["why"] == expected["why"]
        assert {name: found[name] for name in FIGURES} == pytest.approx({name: expected[name] for name in FIGURES})


def test_more_frames_of_one_exposure_are_its_stack(shots, capsys):
    rng = np.random.default_rng(9)
    for number in range(2, 8):
        cv2.imwrite(str(shots / f"bright_140_{number}.png"), expose(PHOTONS_PER_MS * 140, 140, rng))
        cv2.imwrite(str(shots / f"dark_140_{number}.png"), expose(0, 140, rng))
    assert main(["noise", str(shots)]) == 0
    said = capsys.readouterr().out
    assert "PRNU of rows" in said
    assert "DSNU of pixels" in said
    assert figures(capsys, shots)["prnu"] == pytest.approx(0.02, rel=0.05)


def test_the_report_is_one_page_that_needs_no_network(frames, tmp_path, capsys):
    page = tmp_path / "noise.html"
    assert main(["noise", str(frames), "--report", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=\"(?!data:|#)", text)
    assert "http" not in re.sub(r"http://www\.w3\.org/\S+", "", text)
    assert "Photon transfer" in text
    assert "the photons per pixel are not known" in text
    assert [path.name for path in tmp_path.iterdir()] == ["noise.html"]


def spoil(path, frame):
    cv2.imwrite(str(path), frame)


def missing_partner(folder):
    (folder / "bright_140_1.png").unlink()


def missing_dark(folder):
    for number in range(2):
        (folder / f"dark_140_{number}.png").unlink()


def another_size(folder):
    spoil(folder / "dark_60_1.png", np.full((60, 160), 80, np.uint16))


def another_depth(folder):
    spoil(folder / "dark_60_1.png", np.full((240, 320), 80, np.uint8))


def in_colour(folder):
    spoil(folder / "dark_60_1.png", np.full((120, 160, 3), 80, np.uint16))


def jpeg(folder):
    for path in folder.glob("*.png"):
        spoil(path.with_suffix(".jpg"), (cv2.imread(str(path), -1) // 16).astype(np.uint8))
        path.unlink()


def jpeg_called_png(folder):
    _, data = cv2.imencode(".jpg", np.full((240, 320), 80, np.uint8))
    (folder / "bright_60_0.png").write_bytes(data.tobytes())


def saturated_throughout(folder):
    for path in folder.glob("bright_*"):
        spoil(path, np.full((240, 320), 4095, np.uint16))


def changed_places(folder):
    for path in list(folder.glob("*.png")):
        kind, rest = path.name.split("_", 1)
        path.rename(folder / f"new_{'dark' if kind == 'bright' else 'bright'}_{rest}")
    for path in list(folder.glob("new_*")):
        path.rename(folder / path.name.removeprefix("new_"))


def copied(folder):
    shutil.copy(folder / "bright_60_0.png", folder / "bright_60_1.png")


def cut_short(folder):
    path = folder / "bright_60_0.png"
    path.write_bytes(path.read_bytes()[:60])


def one_level(folder):
    for path in folder.glob("*.png"):
        if "_60_" not in path.name:
            path.unlink()


def dark_only(folder):
    for path in folder.glob("bright_*"):
        path.unlink()


def other_names(folder):
    for path in folder.glob("*.png"):
        path.rename(folder / f"IMG{path.name}")


def twice(folder):
    shutil.copy(folder / "bright_60_0.png", folder / "bright_60.0_0.png")


def floating(folder):
    spoil(folder / "bright_60_0.tif", np.full((240, 320), 80.5, np.float32))
    (folder / "bright_60_0.png").unlink()


def too_large(folder):
    spoil(folder / "bright_60_0.tif", np.full((240, 320), 70_000, np.int32))
    (folder / "bright_60_0.png").unlink()


def of_64_bits(folder):
    spoil(folder / "bright_60_0.tif", np.full((240, 320), 80.0))
    (folder / "bright_60_0.png").unlink()


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (missing_partner, "has no partner"),
        (missing_dark, "140 ms has bright frames but no dark ones"),
        (another_size, "is 160x60 pixels, but"),
        (another_depth, "all frames must have one depth"),
        (in_colour, "is in colour (3 channels)"),
        (jpeg, "JPEG changes the noise"),
        (jpeg_called_png, "JPEG changes the noise"),
        (saturated_throughout, "saturated throughout"),
        (changed_places, "have they changed places?"),
        (copied, "is the same picture as bright_60_0.png"),
        (cut_short, "the PNG picture is cut off: it ends after 60 bytes"),
        (one_level, "at least two levels of exposure, got 1"),
        (dark_only, "holds dark frames only"),
        (other_names, "expected frames named bright_<exposure ms>_0.png"),
        (twice, "is frame 0 of 60 ms, and so is"),
        (floating, "has the value 80.5; expected whole numbers from 0 to 65535"),
        (too_large, "has the value 70000; expected whole numbers"),
        (of_64_bits, "values of type float64; expected 8, 16 or 32 bits"),
    ],
)
def test_bad_frames_are_refused_in_one_sentence(harm, said, shots, capsys):
    harm(shots)
    assert said in refused(capsys, shots)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("b 40000 120\ni a.png\n", "the bright shot of 40000 ns has 1 frames, expected two"),
        ("b 40000 120\ni a.png\ni b.png\n", "40000 ns has bright frames but no pair of dark ones"),
        ("d 40000\ni a.png\ni b.png\n", "names no pair of bright frames"),
        ("b forty 120\n", "line 1 is no line of an EMVA 1288 descriptor"),
        ("v 3.0\ni a.png\n", "line 2 is no line"),
        ("hello world\n", "line 1 is no line"),
        ("b 4e4 9\ni a.png\ni b.png\nd 4e4\ni a.png\ni b.png\n", "cannot be read (No such file or directory)"),
        ("", "names no pair of bright frames"),
    ],
)
def test_bad_descriptors_are_refused_in_one_sentence(text, said, tmp_path, capsys):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "data.txt").write_text(text)
    assert said in refused(capsys, tmp_path / "in" / "data.txt")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["noise"], "required: FOLDER"),
        (["noise", "nowhere"], "there is no such folder"),
        (["noise", ".", "--photons-per-ms", "0"], "expected photons per pixel and millisecond, above 0"),
        (["noise", ".", "--photons-per-ms", "nan"], "expected photons per pixel and millisecond, above 0"),
        (["noise", "a\0b"], "is not the name of a folder"),
        (["noise", ".", "--report", "nowhere/noise.html"], "there is no directory"),
    ],
)
def test_a_command_that_cannot_be_used_says_so(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_report_never_overwrites_a_frame(shots, capsys):
    frame = shots / "bright_60_0.png"
    before = frame.read_bytes()
    assert main(["noise", str(shots), "--report", str(frame)]) == 2
    assert "would overwrite" in capsys.readouterr().err
    assert frame.read_bytes() == before
