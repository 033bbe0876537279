"""What holds for every format that a module of `camviz_clinic.files` declares, and what one more file adds."""

import subprocess
import sys
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from house import examples
from scipy.spatial.transform import RigidTransform, Rotation

import camviz_clinic.files
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Perspective
from camviz_clinic.commands import command
from camviz_clinic.files import Calibration, CalibrationError, File, Format, format_of, formats, write
from camviz_clinic.files.models import same_camera
from camviz_clinic.files.parameter_layouts import LAYOUTS
from camviz_clinic.files.registry import written

PAGE = Path(__file__).parents[1] / "docs" / "formats.md"
renewed = run_path(str(PAGE.parents[1] / "tools/docs/formats.py"))["renewed"]
SIZE = (640, 480)
IMU = RigidTransform.from_components([0.05, 0.02, -0.01], Rotation.from_rotvec([-0.2, 0.1, 1.4]))
CAMERA = Camera(Intrinsics(*SIZE, 500.0, 500.0, 321.25, 239.5), Perspective())
MADE = Calibration({"camera": CAMERA}, Path("made.yml"), "made", world_from_imu=IMU)


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The format of docs/recipes.md as the one file of a folder in which formats are looked for."""
    folder = tmp_path / "more"
    folder.mkdir()
    (code,) = examples("A calibration format").values()
    (folder / "toy.py").write_text(code, encoding="utf-8")
    monkeypatch.setattr(camviz_clinic.files, "__path__", [*camviz_clinic.files.__path__, str(folder)])
    yield folder
    sys.modules.pop("camviz_clinic.files.toy", None)
    vars(camviz_clinic.files).pop("toy", None)


def example(name, folder):
    """A small file of a format: its own example, or what it writes of one camera."""
    path = folder / "example"
    if held := formats()[name].example:
        path.write_bytes(held)
    else:
        write(MADE, path, name)
    return path


def loaded(path):
    """The calibration of a file, whose size is given where it asks for one."""
    try:
        return camviz_clinic.load(path)
    except CalibrationError as error:
        if "--size" not in str(error):
            raise
    return camviz_clinic.load(path, size=SIZE)


def check_example_is_read(name, folder):
    path = example(name, folder)
    assert format_of(File(path)).name == name
    cameras = list(loaded(path).cameras.values())
    if formats()[name].write:
        assert len(cameras) == 1
        assert same_camera(cameras[0], CAMERA)
    for camera in cameras:
        ahead = camera.world_from_cam.apply(np.array([0.1, 0.2, 1.0]))
        assert np.isfinite(camera.project(ahead)).all()


def complaint(path):
    """What `load` refuses a file with; empty where it reads it."""
    try:
        loaded(path)
    except CalibrationError as error:
        return str(error)
    return ""


def check_damage_is_read_or_refused(name, folder):
    """Whatever half of it is missing or doubled, what comes is a calibration or one sentence."""
    path = example(name, folder)
    said = []
    for part in sorted(path.iterdir()) if path.is_dir() else [path]:
        content = part.read_bytes()
        for at in np.linspace(0, len(content), 12).astype(int):
            head, tail = content[:at], content[at:]
            for damaged in (head, tail, head + b"[9" + tail[2:], content + head):
                part.write_bytes(damaged)
                said.append(complaint(path))
        part.write_bytes(content)
    refused = [sentence for sentence in said if sentence]
    assert len(refused) > 5
    assert [sentence for sentence in refused if not sentence.startswith(str(path)) or "\n" in sentence] == []


@pytest.mark.parametrize("name", formats())
def test_an_example_is_known_for_what_it_is_and_read_back_the_same(tmp_path, name):
    check_example_is_read(name, tmp_path)


@pytest.mark.sampled(12)
@pytest.mark.parametrize("name", formats())
def test_a_damaged_example_is_read_or_refused_in_one_sentence(tmp_path, name):
    check_damage_is_read_or_refused(name, tmp_path)


@pytest.mark.parametrize("name", formats())
def test_a_format_says_what_it_is(name):
    format = formats()[name]
    assert isinstance(format, Format)
    assert name == format.name == name.strip().lower().replace(" ", "-")
    assert all([format.title, format.file, format.models, format.says])
    assert "|" not in format.models + format.says + format.lacks
    assert bool(format.write) != bool(format.example)


def test_each_recogniser_tells_its_own_files_from_those_of_the_others(tmp_path):
    """Whichever is asked first, the first that knows a file is the format that it was written in."""
    found = {}
    for name in formats():
        (tmp_path / name).mkdir()
        found[name] = format_of(File(example(name, tmp_path / name))).name
    assert found == {name: name for name in formats()}


def test_the_documentations_table_is_made_from_the_formats():
    text = PAGE.read_text(encoding="utf-8")
    assert renewed(text) == text
    assert renewed(text.replace("| `basalt` |", "| `old` |")) == text


def test_the_help_lists_every_format(capsys):
    with pytest.raises(SystemExit):
        command.main(["convert", "--help"])
    text = capsys.readouterr().out
    listed = text.split("formats:\n")[1].split("\n\n")[0].splitlines()
    assert [line.split()[0] for line in listed] == list(written())
    with pytest.raises(SystemExit):
        command.main(["show", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert [format.title for format in formats().values() if format.title not in text] == []


def test_the_help_of_other_commands_loads_no_format(capsys):
    code = "import sys; from camviz_clinic.commands import command\n"
    code += "try: command.main(['--help'])\nexcept SystemExit: pass\n"
    code += "print('camviz_clinic.files.kalibr' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"


def test_a_format_is_one_file(tmp_path, toy, capsys):
    """One file more, and it is loaded, written, converted to, listed in the help and in the documentation."""
    assert len(list(toy.iterdir())) == 1
    (tmp_path / "a.toy").write_text("toy 640 480 500 321.25 239.5\n")
    (camera,) = camviz_clinic.load(tmp_path / "a.toy").cameras.values()
    assert same_camera(camera, CAMERA)
    assert command.main(["convert", str(tmp_path / "a.toy"), str(tmp_path / "b.yml"), "--to", "opencv"]) == 0
    assert command.main(["convert", str(tmp_path / "b.yml"), str(tmp_path / "c.toy"), "--to", "toy"]) == 0
    assert (tmp_path / "c.toy").read_text() == "toy 640 480 500.0 321.25 239.5\n"
    with pytest.raises(SystemExit):
        command.main(["convert", "--help"])
    assert "  toy         Toy (camera.toy), one camera\n" in capsys.readouterr().out
    row = "| `toy` | Toy: camera.toy | pinhole | one line | skew, several cameras, a world of its own |\n"
    assert row in renewed(PAGE.read_text(encoding="utf-8"))
    (tmp_path / "c.toy").write_text("toy 1\n")
    assert complaint(tmp_path / "c.toy").endswith("c.toy: expected toy WIDTH HEIGHT F CX CY, got 1 numbers")


def test_the_added_format_keeps_the_contract(tmp_path, toy):
    check_example_is_read("toy", tmp_path)
    check_damage_is_read_or_refused("toy", tmp_path)


def test_what_was_added_is_gone_with_its_file():
    assert "toy" not in formats()


def test_two_formats_of_one_name_are_refused(toy):
    path = toy / "toy.py"
    path.write_text(path.read_text().replace('name="toy"', 'name="ros"'))
    with pytest.raises(ValueError, match="two formats are named ros"):
        formats()


@pytest.mark.parametrize("program", LAYOUTS)
def test_layouts_name_parameters_that_their_lenses_have(program):
    """A program's list and what it fixes are of the lens's parameters and a camera's, none of them twice."""
    for model in LAYOUTS[program]:
        names = [*model.names, *model.fixed]
        assert len(names) == len(set(names)), model
        assert {"cx", "cy"} <= set(names) <= {"f", "fx", "fy", "cx", "cy", "skew", *model.lens.parameters()}, model
