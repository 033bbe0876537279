"""Attack camviz with damaged files, pictures and command lines, and count what gets through.

    python tools/benchmarks/attack.py --files 100000 --pictures 5000 --commands 2000 --processes 100

Every case comes from the seed and its number, so `--only files:123` makes one again and shows what it does. Cases run
in a worker process that is ended and replaced when one of them hangs. A finding is a traceback, more than 10 s, more
than 1 GB beyond what the libraries take, text that commands a terminal, more than 64 kB of it, JSON that is not strict.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import shutil
import subprocess
import sys
import time
import traceback
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterable
from contextlib import redirect_stderr, redirect_stdout
from io import BytesIO, StringIO, TextIOWrapper
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

from hostile import mutated, mutated_picture, mutated_words

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
HANG, SLOW = 20, 10  # seconds of processor time
PATIENCE = 200  # seconds by the clock, for what waits without working
MEMORY = 2**30  # bytes beyond what the libraries take
MOST_TEXT = 64 * 1024
EXITS = (0, 1, 2, 3, 4)
SIZE = (640, 480)
ENCODINGS = ("utf-8", "ascii", "cp1252", "latin-1", "cp437")
COMMANDS = (
    "inspect camera.yml --json",
    "inspect camera.yml --size 640x480 --compare other.xml",
    "inspect corners.yml --board 9x6 --square-mm 25 --at 2m --report page.html",
    "inspect camera.yml --images shots --board 9x6 --square-mm 25",
    "show camera.yml --size 640x480 -o page.html",
    "convert camera.yml out.txt --to kalibr",
    "convert other.xml out.json --to basalt --size 640x480",
    "reproject one.png -o out.png --from equirectangular --to cube:front --size 64x64",
    "reproject one.jpg -o out.jpg --from camera.yml --to perspective --hfov 60 --yaw 10",
    "mtf one.png --roi 10,10,40,40 --json",
    "mtf one.tif --linear --report page.html",
    "noise frames --photons-per-ms 5000 --json",
    "calibrate shots --board 9x6 --square-mm 25 -o out.yaml --workers 1 --megapixels 1",
    "calibrate shots --right shots --board 5x4 --square-mm 25 --model fisheye --workers 1 --fix k3",
    "check camera.yml shots --board 9x6 --square-mm 25 --limit-px 0.5 --json",
    "board --board 9x6 --square-mm 25 -o board.svg",
    "completion bash",
    "doctor --json",
)


# What is attacked -----------------------------------------------------------------------------------------------------


def originals() -> dict[str, bytes]:
    """Good files by name: the tests' samples, an example of every format, and a calibration with all its corners."""
    import numpy as np

    from camviz_clinic.checks.virtual import healthy
    from camviz_clinic.files import formats
    from camviz_clinic.files.writing import write

    found = {str(path.relative_to(DATA)): path.read_bytes() for path in sorted(DATA.rglob("*")) if path.is_file()}
    solved = healthy(np.random.default_rng(0))
    with TemporaryDirectory() as room:
        write(solved, Path(room) / "corners.yml", "opencv")
        found["corners.yml"] = (Path(room) / "corners.yml").read_bytes()
    return found | {f"{name}-{form.file}": form.example for name, form in formats().items() if form.example}


def pictures() -> dict[str, bytes]:
    """A board in a picture of every kind."""
    import cv2
    import numpy as np

    small = np.kron(np.indices((7, 10)).sum(axis=0) % 2 * 255, np.ones((12, 12))).astype(np.uint8)
    board = cv2.cvtColor(cv2.copyMakeBorder(small, 20, 20, 20, 20, cv2.BORDER_CONSTANT, value=255), cv2.COLOR_GRAY2BGR)
    turned = cv2.warpAffine(board, np.array([[1, 0.1, 0], [-0.05, 1, 5.0]]), (170, 130), borderValue=(255, 255, 255))
    kinds = [(kind, turned) for kind in ("png", "jpg", "tif", "bmp", "ppm", "webp", "jp2", "gif")]
    kinds += [("grey.png", turned[..., 0]), ("deep.png", turned.astype(np.uint16) * 256)]
    kinds += [("float.tif", turned[..., 0] / np.float32(255)), ("sky.hdr", turned / np.float32(255))]
    return {f"one.{kind}": cv2.imencode(f".{kind.split('.')[-1]}", each)[1].tobytes() for kind, each in kinds}


class Case:
    """What a worker needs for its cases: good files, and a room to put bad ones into."""

    def __init__(self, room: Path, seed: int) -> None:
        self.room, self.seed = room, seed
        self.files, self.pictures = originals(), pictures()
        self.names, self.picture_names = list(self.files), list(self.pictures)

    def rng(self, kind: str, number: int) -> Random:
        return Random(f"{self.seed}/{kind}/{number}")

    def run(self, kind: str, number: int) -> str:
        """What came of one case: "done", "refused", or what is wrong and where."""
        return {"files": self.file, "pictures": self.picture, "commands": self.command, "processes": self.process}[
            kind
        ](self.rng(kind, number))

    def file(self, rng: Random) -> str:
        """A calibration file through `load`, `inspect_file`, and the JSON and text of what it says."""
        from camviz_clinic.checks import inspect_file
        from camviz_clinic.files import CalibrationError

        name = rng.choice(self.names) if rng.random() < 0.99 else "corners.yml"
        while name == "corners.yml" and rng.random() < 0.9:  # whose checks take a second
            name = rng.choice(self.names)
        path = self.room / "files" / name
        for original in [each for each in self.names if "/" in name and each.startswith(name.split("/")[0])]:
            put(self.room / "files" / original, self.files[original])
        put(path, mutated(rng, self.files[name], self.files[rng.choice(self.names)]))
        try:
            said = inspect_file(path, size=SIZE if rng.random() < 0.5 else None)
        except CalibrationError as error:
            return sentence(str(error))
        text = said.as_text()
        return strict(said.as_json()) or (f"{len(text)} characters of text" if len(text) > MOST_TEXT else "done")

    def picture(self, rng: Random) -> str:
        """A picture through all that read one."""
        from camviz.colour.picture_files import PictureError, picture_size, read_gray, read_picture
        from camviz_clinic.calibration.finding import look
        from camviz_clinic.calibration.types import Board

        name = rng.choice(self.picture_names)
        path = self.room / name
        put(path, mutated_picture(rng, self.pictures[name], self.pictures[rng.choice(self.picture_names)]))
        try:
            width, height = picture_size(path)
            gray, picture = read_gray(path), read_picture(path)
        except PictureError as error:
            return sentence(str(error))
        if rng.random() < 0.2:
            look(str(path), Board(9, 6, 0.025), "auto")
        same = (height, width) == gray.shape and picture.shape[:2] in ((height, width), (width, height))
        return "done" if same else f"a header of {width}×{height} for {gray.shape}, {picture.shape}"

    def laid_out(self, rng: Random) -> tuple[Path, list[str]]:
        """A folder with good and bad files and names, and a command line about them."""
        room = self.room / "commands"
        shutil.rmtree(room, ignore_errors=True)
        for folder in ("shots", "frames"):
            (room / folder).mkdir(parents=True)
        camera = rng.choice(self.names)
        bad = rng.random() < 0.5
        put(room / "camera.yml", mutated(rng, self.files[camera], b"") if bad else self.files["opencv_mono.json"])
        put(room / "other.xml", self.files["opencv_stereo.xml"])
        put(room / "corners.yml", self.files["corners.yml"])
        for name, content in self.pictures.items():
            put(room / name, mutated_picture(rng, content, b"") if rng.random() < 0.2 else content)
        for number in range(4):
            shot = self.pictures[rng.choice(("one.png", "one.jpg", "one.bmp"))]
            put(room / "shots" / f"a{number}.png", mutated_picture(rng, shot, b"") if rng.random() < 0.3 else shot)
            kind = ("bright", "dark")[number // 2]
            put(
                room / "frames" / f"{kind}_10_{number % 2}.png",
                mutated_picture(rng, self.pictures["one.grey.png"], b""),
            )
        os.mkfifo(room / "pipe.png")
        (room / "loop.png").symlink_to("loop.png")
        put(room / "evil\x1b[31m\n.png", b"no picture")
        put(room / os.fsdecode(b"caf\xe9.png"), self.pictures["one.png"])
        words = rng.choice(COMMANDS).split()
        names = [str(path.relative_to(room)) for path in room.rglob("*")]
        return room, mutated_words(rng, words, options_of(words[0]), names)

    def command(self, rng: Random) -> str:
        """A command line, in this process."""
        from camviz_clinic.commands.command import main

        room, words = self.laid_out(rng)
        out, err = StringIO(), StringIO()
        held = sys.stdin
        sys.stdin = TextIOWrapper(BytesIO(self.files["opencv_mono.json"]))
        os.chdir(room)
        try:
            with redirect_stdout(out), redirect_stderr(err):
                status = main(words)
        except SystemExit as end:
            status = end.code or 0
        finally:
            sys.stdin = held
            os.chdir("/")
        return judged(status, out.getvalue(), err.getvalue(), "--json" in words)

    def process(self, rng: Random) -> str:
        """A command line as a process of its own, in one of several encodings."""
        room, words = self.laid_out(rng)
        words = [word.replace("\0", "0") for word in words]
        known = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": rng.choice(ENCODINGS), "LC_ALL": "C.UTF-8"}
        encoding = known["PYTHONIOENCODING"]
        done = subprocess.run(
            [sys.executable, "-m", "camviz", *words],
            cwd=room,
            env=known,
            input=self.files["opencv_mono.json"],
            capture_output=True,
            check=False,
        )
        strictly = "--json" in words
        return judged(done.returncode, done.stdout.decode(encoding), done.stderr.decode(encoding, "replace"), strictly)


def put(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def options_of(command: str) -> list[str]:
    from camviz_clinic.commands.command import parser

    commands = next(action for action in parser()._actions if isinstance(action.choices, dict))
    return list(commands.choices[command]._option_string_actions)  # type: ignore[index]


# What is wrong --------------------------------------------------------------------------------------------------------


def sentence(text: str) -> str:
    """ "refused", unless the refusal is no short line that a terminal can show."""
    if not text.isprintable():
        return f"a refusal with {[c for c in text if not c.isprintable()][:3]}"
    return "refused" if len(text) < 2000 else f"a refusal of {len(text)} characters"


def strict(text: str) -> str:
    """Empty for strict JSON."""

    def refuse(word: str) -> None:
        raise ValueError(word)

    try:
        json.loads(text, parse_constant=refuse)
    except ValueError as error:
        return f"JSON that is not strict: {error}"
    return ""


def judged(status: Any, out: str, err: str, as_json: bool) -> str:
    if status not in EXITS:
        return f"exit status {status}: {err.splitlines()[-1:]}"
    if "Traceback" in err:
        return f"a traceback: {err.splitlines()[-1]}"
    if bad := {c for c in out + err if not c.isprintable() and c != "\n"}:
        return f"text that commands the terminal: {sorted(bad)[:3]}"
    if len(err) > 8192 or (len(out) > MOST_TEXT and not as_json):
        return f"{len(out)} characters of text, {len(err)} of complaints"
    if status == 2 and not err.startswith("camviz: "):
        return f"a refusal without a sentence: {err[:80]!r}"
    if as_json and status in (0, 1, 4) and out.lstrip().startswith(("{", "[")) and strict(out):
        return strict(out)
    return "refused" if status == 2 else "done"


# Workers --------------------------------------------------------------------------------------------------------------


def work(pipe: Any, seed: int) -> None:
    """Cases one after another, as they are asked for, within bounds of memory."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)  # what libraries mutter
    warnings.simplefilter("ignore")  # as the commands do
    with TemporaryDirectory() as room:
        case = Case(Path(room), seed)
        case.run("files", 0)
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY + MEMORY // 4, resource.RLIM_INFINITY))
        while True:
            kind, number = pipe.recv()
            start = used()
            try:
                came = case.run(kind, number)
            except MemoryError:
                came = f"more than {MEMORY >> 20} MB"
            except BaseException as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                own = [frame for frame in traceback.extract_tb(error.__traceback__) if "/camviz" in frame.filename]
                frame = (own or [where])[-1]
                came = f"{type(error).__name__} at {Path(frame.filename).name}:{frame.lineno} {str(error)[:100]!r}"
            pipe.send((came, used() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10))


def used() -> float:
    """Seconds of processor time of this process and of those that it has waited for."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


class Worker:
    """A process that is replaced when a case ends or hangs it."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.start()

    def start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(theirs, self.seed), daemon=False)
        self.process.start()
        theirs.close()

    def run(self, kind: str, number: int) -> tuple[str, float, int]:
        self.pipe.send((kind, number))
        start, before = time.monotonic(), self.seconds()
        try:
            while self.seconds() - before < HANG and time.monotonic() - start < PATIENCE:
                if self.pipe.poll(1):
                    return self.pipe.recv()
            came = f"more than {HANG} s"
        except (EOFError, ConnectionError):
            came = "the process died"
        self.end()
        self.start()
        return came, float(HANG), 0

    def seconds(self) -> float:
        """Of processor time: others may keep this machine busy. 0 when it has died."""
        try:
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            return 0.0
        return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")

    def end(self) -> None:
        self.process.kill()
        self.process.join()


def attacked(kind: str, numbers: Iterable[int], seed: int, until: float) -> dict[str, Any]:
    """The table's row of one kind of cases, and its findings by what came."""
    worker = Worker(seed)
    counts: Counter[str] = Counter()
    found: dict[str, list[int]] = defaultdict(list)
    slowest, peak, start = (0.0, 0), 0, time.monotonic()
    for number in numbers:
        if time.monotonic() > until:
            break
        came, seconds, megabytes = worker.run(kind, number)
        if came in ("done", "refused") and seconds > SLOW:
            came = f"more than {SLOW} s"
        counts[came if came in ("done", "refused") else "found"] += 1
        if came not in ("done", "refused"):
            found[came].append(number)
            print(f"  {kind}:{number} {came}", flush=True)
        slowest, peak = max(slowest, (seconds, number)), max(peak, megabytes)
    worker.end()
    took = time.monotonic() - start
    return {"kind": kind, "counts": counts, "found": found, "slowest": slowest, "peak": peak, "took": took}


def table(rows: list[dict[str, Any]]) -> str:
    lines = [
        "| attacked | cases | done | refused | found | slowest, s | peak, MB | minutes |",
        "|---" * 8 + "|",
    ]
    for row in rows:
        counts = row["counts"]
        seconds, number = row["slowest"]
        lines.append(
            f"| {row['kind']} | {sum(counts.values()):,} | {counts['done']:,} | {counts['refused']:,} | "
            f"{counts['found']} | {seconds:.1f} (number {number}) | {row['peak']} | {row['took'] / 60:.1f} |"
        )
    return "\n".join(lines)


def main() -> int:
    options = arguments()
    if options.only:
        return shown(*options.only.split(":"), options.seed)
    until = time.monotonic() + 60 * options.minutes
    kinds = ("files", "pictures", "commands", "processes")
    wanted = {kind: range(options.first, options.first + getattr(options, kind)) for kind in kinds}
    rows = [attacked(kind, numbers, options.seed, until) for kind, numbers in wanted.items() if getattr(options, kind)]
    print(table(rows))
    for row in rows:
        for came, numbers in sorted(row["found"].items(), key=lambda item: -len(item[1])):
            print(f"{len(numbers):5} × {came} ({row['kind']}:{numbers[0]})")
    return int(any(row["found"] for row in rows))


def shown(kind: str, number: str, seed: int) -> int:
    """One case once more, with its files in ./attacked and whatever traceback it has."""
    room = Path("attacked").resolve()
    case = Case(room, seed)
    if kind in ("commands", "processes"):
        print(case.laid_out(case.rng(kind, int(number)))[1])
    print(case.run(kind, int(number)))
    return 0


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind, count in (("files", 10_000), ("pictures", 2_000), ("commands", 500), ("processes", 40)):
        parser.add_argument(f"--{kind}", type=int, default=count, metavar="N", help=f"(default: {count})")
    parser.add_argument("--first", type=int, default=0, metavar="N", help="the number of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=1e6, help="stop after so many")
    parser.add_argument("--only", metavar="KIND:NUMBER", help="this case alone, again")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
