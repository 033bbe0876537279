"""The command line `camviz`: open the lessons, look at a machine, look at a calibration."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import camviz
from camviz.working_copy import checkout_lessons, edition, lay_out, lessons_source

if TYPE_CHECKING:
    from camviz.files import Calibration

OK, LACKING, REFUSED, INTERRUPTED = 0, 1, 2, 130

DESCRIPTION = """\
camviz is one virtual camera, taken apart piece by piece: lessons to do in JupyterLab,
and pictures of what a calibration file says about a real camera.
"""
EXAMPLES = """\
examples:
  camviz lab                                 do the lessons, in ./camviz-lessons
  camviz doctor                              see what this machine can do, and how to mend it
  camviz show camera.yml                     write camera.html: open it in a browser, no network needed
  camviz show intrinsics.yml --size 640x480  the same, for a file that does not hold the image size
  camviz convert cam.yml model --to colmap   write the same camera for another program
  camviz teacher for-me                      write the lessons with solutions and timings into ./for-me

exit status:
  0    done
  1    something is missing on this machine (camviz doctor says what, and how to mend it)
  2    the command or the file it names cannot be used; one sentence on stderr says why
  130  interrupted
"""
LAB = """\
Opens the lessons in JupyterLab. In a checkout of the repository these are the lessons there. Otherwise they are
laid out in DIR, and laid out again only where you have not changed them: what you wrote is never overwritten. A new
version of a lesson you did change is put beside it.
"""
DOCTOR = """\
Says what camviz finds on this machine, line by line: what works, what works less well, what is missing, and what to
do about it. Solid 3D is tried in a process of its own, so that asking cannot do harm.
"""
SHOW = """\
Writes one HTML page that shows the cameras of a calibration: where they stand and what they see, how their lenses
bend straight lines, and how their pictures are tied together. The page holds everything it needs and opens offline.

Reads OpenCV FileStorage (one camera or a pair), ROS CameraInfo, Kalibr camchains, COLMAP models (their folder too),
mrcal, nerfstudio, EuRoC, Basalt, KITTI, MATLAB (as JSON) and Metashape files; the content tells which it is. The file
is only read: nothing in it is run, and it is not changed.
"""


CONVERT = """\
Writes a calibration for another program. Pixels, lens and poses are carried from one set of conventions to the other
(half pixels, axes, order of coefficients, which way a transform goes), and what is written is read back and compared
before it takes its name: it says the same, or it is not written. A format that has no place for something in the
cameras is refused with the reason; what it cannot hold beside them (corners, board poses, names) is named and left
out. The format of IN is told by its content. A COLMAP model is a folder.
"""

FORMATS = """\
formats:
  opencv      OpenCV FileStorage, by the ending of OUT: .yml, .xml or .json; one camera or a pair
  ros         ROS CameraInfo (camera.yaml), one camera
  kalibr      Kalibr camchain (camchain.yaml)
  colmap      COLMAP model as text, a folder
  colmap-bin  the same, binary
  mrcal       mrcal (camera.cameramodel), one camera
  nerfstudio  nerfstudio and instant-ngp (transforms.json)
  euroc       EuRoC (sensor.yaml), one camera
  basalt      Basalt (calibration.json), cameras around an IMU
  kitti       KITTI (calib.txt), rectified cameras
  kitti-raw   KITTI (calib_cam_to_cam.txt), the cameras before rectification
  matlab      MATLAB's cameraParameters as JSON, one camera
  metashape   Metashape XML

examples:
  camviz convert camera.yml camera.cameramodel --to mrcal
  camviz convert stereo.yml chain.yaml --to kalibr --size 640x480
  camviz convert sparse/0 left.yml --to opencv --camera left.jpg --first-as-world
"""

TEACHER = """\
Writes the lessons with the solutions in their places, timings and prompts for discussion, made from the very
notebooks that students get. The solutions carry nbgrader's marks, so that exercises can be handed out and graded.
"""


class Refusal(Exception):  # noqa: N818 - said to a person, not raised at a programmer
    """What a command cannot do, in one sentence."""

    def __init__(self, sentence: str, status: int = REFUSED) -> None:
        super().__init__(sentence)
        self.status = status


def main(words: Sequence[str] | None = None) -> int:
    """Run `camviz` with these words (default: those it was started with) and return its exit status."""
    words, beyond = _split(sys.argv[1:] if words is None else list(words))
    try:
        options = parser().parse_args(words)
        if beyond and options.run is not lab:
            raise Refusal("only `camviz lab` passes on what follows --.")
        return int(options.run(options, beyond) if options.run is lab else options.run(options))
    except Refusal as refusal:
        return _say(str(refusal), refusal.status)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - for the interpreter's last flush
        return OK
    except OSError as error:
        return _say(f"{error.filename}: {error.strerror}" if error.filename else str(error), REFUSED)
    except KeyboardInterrupt:
        return INTERRUPTED


def parser() -> argparse.ArgumentParser:
    """All of the command line. A new subcommand is one function here and one that does it."""
    everything = _Parser(
        "camviz", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    everything.add_argument("--version", action="version", version=f"camviz {camviz.__version__}")
    commands = everything.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=_Parser)
    for add in (_add_lab, _add_doctor, _add_show, _add_convert, _add_teacher):
        add(commands)
    return everything


def _add_lab(commands: Any) -> None:
    command = _add(commands, "lab", lab, "open the lessons in JupyterLab", LAB)
    command.usage = "camviz lab [-h] [--no-browser] [DIR] [-- JUPYTER-OPTIONS]"
    command.add_argument("directory", metavar="DIR", nargs="?", type=Path, help="where (default: ./camviz-lessons)")
    command.add_argument("--no-browser", action="store_true", help="only serve them and print the address")


def _add_doctor(commands: Any) -> None:
    command = _add(commands, "doctor", doctor, "say what this machine can do, and how to mend it", DOCTOR)
    command.add_argument("--json", action="store_true", help="the same for programs")


def _add_show(commands: Any) -> None:
    command = _add(commands, "show", show, "write a page that shows a calibration", SHOW)
    command.add_argument("file", metavar="FILE", type=Path, help="the calibration")
    command.add_argument("-o", "--output", metavar="OUT.html", type=Path, help="the page (default: FILE's name, .html)")
    command.add_argument("--size", metavar="WxH", type=_size, help="image size in pixels, where FILE does not hold it")


def _add_convert(commands: Any) -> None:
    command = _add(commands, "convert", convert, "write a calibration for another program", CONVERT)
    command.epilog = FORMATS
    command.add_argument("file", metavar="IN", type=Path, help="the calibration, or the folder of a COLMAP model")
    command.add_argument("output", metavar="OUT", type=Path, help="the file to write; for COLMAP a new folder")
    command.add_argument("--to", metavar="FORMAT", required=True, help="one of the formats below")
    command.add_argument("--size", metavar="WxH", type=_size, help="image size in pixels, where IN does not hold it")
    command.add_argument("--camera", metavar="NAME", help="only this one of the cameras")
    command.add_argument(
        "--first-as-world", action="store_true", help="make the first camera's frame the world, as some formats must"
    )


def _add_teacher(commands: Any) -> None:
    command = _add(commands, "teacher", teacher, "write the teacher's edition of the lessons", TEACHER)
    command.add_argument("out", metavar="OUT_DIR", type=Path, help="where to; made when it is not there")


def lab(options: argparse.Namespace, beyond: list[str]) -> int:
    """Open JupyterLab on the checkout's lessons, or on a working copy."""
    if find_spec("jupyterlab") is None:
        raise Refusal("JupyterLab is not installed; `pip install 'camviz[lab]'` brings it.", LACKING)
    source = lessons_source()
    if source is None:
        raise Refusal("the lessons are not part of this installation; `pip install camviz` brings them.", LACKING)
    folder = options.directory or checkout_lessons() or Path("camviz-lessons")
    if folder.exists() and not folder.is_dir():
        raise Refusal(f"{folder}: expected a folder for the lessons, this is a file.")
    if not (folder.exists() and folder.samefile(source)) and edition(folder) != "teacher":
        for sentence in lay_out(source, folder, camviz.__version__):
            print(sentence)
    return _start_jupyter(folder.resolve(), ["--no-browser"] * options.no_browser + beyond)


def doctor(options: argparse.Namespace) -> int:
    """Print what was found; the status tells whether something that is needed is missing."""
    from camviz import doctor as examination

    findings = examination.examine()
    print(examination.as_json(findings) if options.json else examination.as_text(findings))
    return LACKING if any(finding.status == "missing" for finding in findings) else OK


def show(options: argparse.Namespace) -> int:
    """Write the page of a calibration, whole or not at all."""
    _refuse_renderer()
    calibration = _loaded(options.file, options.size)
    output = options.output or Path(options.file.stem + ".html")
    _refuse_output(output, options.file)
    from camviz.page import write_page

    write_whole(output, lambda path: write_page(calibration, path))
    for note in calibration.notes:
        print(note)
    print(f"{output}: open it in a browser.")
    return OK


def convert(options: argparse.Namespace) -> int:
    """Write a calibration in another format, whole or not at all."""
    calibration = _loaded(options.file, options.size)
    if options.output.exists() and options.output.samefile(options.file):
        raise Refusal(f"{options.output}: this would overwrite the calibration; choose another name.")
    from camviz.files import CalibrationError
    from camviz.files.writing import alone, from_first_camera, write

    try:
        if options.camera is not None:
            calibration = alone(calibration, options.camera)
        if options.first_as_world:
            calibration = from_first_camera(calibration)
        left_out = write(calibration, options.output, options.to)
    except CalibrationError as error:
        raise Refusal(str(error)) from error
    for sentence in (*calibration.notes, *left_out):
        print(sentence)
    print(f"{options.output}: written from {calibration.format}, read back and found the same.")
    return OK


def teacher(options: argparse.Namespace) -> int:
    """Write the teacher's edition, and never over what a teacher has changed in it."""
    from camviz.lessons import lessons_folder, write_teacher_edition

    if options.out.exists() and (not options.out.is_dir() or options.out.samefile(lessons_folder())):
        raise Refusal(f"{options.out}: expected a folder of its own for the teacher's edition.")
    if edition(options.out) == "student":
        raise Refusal(f"{options.out}: expected a folder of its own, the students' lessons are in this one.")
    with TemporaryDirectory() as made:
        write_teacher_edition(lessons_folder(), Path(made))
        for sentence in lay_out(Path(made), options.out, camviz.__version__, "teacher"):
            print(sentence)
    return OK


def _loaded(path: Path, size: tuple[int, int] | None) -> Calibration:
    from camviz.files import CalibrationError, load

    try:
        return load(path, size=size)
    except CalibrationError as error:
        raise Refusal(str(error)) from error


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file by way of another beside it, so that there is never half a file under its name."""
    target = path.resolve()  # a link is followed, not replaced
    try:
        with TemporaryDirectory(dir=target.parent, prefix=".camviz-") as beside:
            temporary = Path(beside) / "page.part"
            write(temporary)
            os.replace(temporary, target)
    except OSError as error:  # whose file name is that of the part
        raise Refusal(f"{path}: cannot be written ({error.strerror or error}).") from error


def _refuse_renderer() -> None:
    from camviz.doctor import renderer

    finding = renderer()
    if finding.status != "ok":
        raise Refusal(f"{finding.name}: {finding.detail}; {finding.remedy}.")


def _refuse_output(output: Path, source: Path) -> None:
    if "\0" in str(output):
        raise Refusal(f"{str(output)!r} is not a file name.")
    if output.is_dir():
        raise Refusal(f"{output}: expected the name of a page to write, this is a directory.")
    if output.exists() and not output.is_file():  # a device or a pipe, which the page would take the place of
        raise Refusal(f"{output}: expected the name of a page to write, this is not a regular file.")
    parent = (output.resolve() if output.is_symlink() else output).parent
    if not parent.is_dir():
        raise Refusal(f"{output}: there is no directory {parent} to write into.")
    if output.exists() and output.samefile(source):
        raise Refusal(f"{output}: the page would overwrite the calibration; choose another name with -o.")


def _start_jupyter(folder: Path, extra: list[str]) -> int:
    """JupyterLab in this process, so that Ctrl-C and the terminal are its own."""
    from jupyterlab.labapp import LabApp

    if lessons := checkout_lessons():  # which need not be installed for its lessons to import it
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(lessons.parent), os.environ.get("PYTHONPATH")]))
    first = sorted(folder.glob("00*.ipynb"))[:1]
    LabApp.launch_instance([f"--ServerApp.root_dir={folder}", *extra, *map(str, first)])
    return OK


def _size(text: str) -> tuple[int, int]:
    """640x480 as (640, 480)."""
    match = re.fullmatch(r"([0-9]{1,6})\s*[xX×*,]\s*([0-9]{1,6})", text.strip())
    if not match:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT in pixels, such as 640x480, got {text!r}")
    return int(match[1]), int(match[2])


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are one sentence."""

    def error(self, message: str) -> Any:
        raise Refusal(f"{message}; see `{self.prog} --help`.")


def _add(commands: Any, name: str, run: Callable[..., int], what: str, description: str) -> argparse.ArgumentParser:
    command = commands.add_parser(
        name, help=what, description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    command.set_defaults(run=run)
    return command


def _split(words: list[str]) -> tuple[list[str], list[str]]:
    """What comes before -- and what comes after it."""
    at = words.index("--") if "--" in words else len(words)
    return words[:at], words[at + 1 :]


def _say(sentence: str, status: int) -> int:
    """One line on stderr, whatever a file name or a key may hold."""
    printable = "".join(c if c.isprintable() else " " for c in sentence)
    with suppress(OSError):
        print(f"camviz: {' '.join(printable.split())}", file=sys.stderr)
    return status
