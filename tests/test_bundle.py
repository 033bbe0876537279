"""A bundle installs from itself alone, and where it cannot be made there is one sentence and nothing else."""

import base64
import hashlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from zipfile import ZipFile

import pytest
from commandline import ROOT, refused

from camviz_clinic.commands.command import main
from camviz_school.commands import packing
from camviz_school.commands.packing import BundleError, this_machine, write_bundle
from camviz_school.course import material
from camviz_school.samples import SampleUnavailable
from camviz_school.teaching.platforms import PLATFORMS, wanted

PROJECT = """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "camviz"
version = "0.1.0"
[tool.hatch.build.targets.wheel]
packages = ["camviz"]
"""
PROGRAM = "import lantern, os, sys\nprint(lantern.LIGHT, sys.argv[1:], os.path.basename(os.environ['CAMVIZ_SAMPLES']))"
NOWHERE = "http://127.0.0.1:9/"


def tiny_wheel(folder):
    """A wheel of one module, written by hand, and its sha256."""
    info = "lantern-1.0.dist-info"
    contents = {
        "lantern.py": "LIGHT = 'lit'\n",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: lantern\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: hand\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    digests = {
        name: base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()) for name, text in contents.items()
    }
    record = "".join(f"{name},sha256={digest.decode().rstrip('=')},\n" for name, digest in digests.items())
    path = folder / "lantern-1.0-py3-none-any.whl"
    with ZipFile(path, "w") as made:
        for name, text in (contents | {f"{info}/RECORD": f"{record}{info}/RECORD,,\n"}).items():
            made.writestr(name, text)
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with the real start.py, a camviz that says what it was asked, and a lock of one tiny wheel.

    pip looks for wheels in the folder `links` and nowhere else.
    """
    root, links = tmp_path / "checkout", tmp_path / "links"
    for folder in (root / "camviz", root / "lessons", root / "tools/locks", links):
        folder.mkdir(parents=True)
    for name in ("start.py", "LICENSE", "lessons/LICENSE"):
        shutil.copyfile(ROOT / name, root / name)
    (root / "pyproject.toml").write_text(PROJECT)
    (root / "camviz" / "__main__.py").write_text(PROGRAM)
    (root / "lessons" / "05_distortion.ipynb").write_text("a lesson")
    lock = f"lantern==1.0 \\\n    --hash=sha256:{tiny_wheel(links)}\n"
    elsewhere = f"absent==1.0 ; sys_platform == 'plan9' \\\n    --hash=sha256:{'0' * 64}"
    (root / "tools/locks/requirements.lock").write_text(lock + elsewhere)
    (tmp_path / "photograph.jpg").write_text("a photograph")
    monkeypatch.setattr(packing, "sample", lambda name: tmp_path / "photograph.jpg")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(links))
    return root


def made(checkout, target, **options):
    """Write a bundle for this machine; what was said."""
    name, python = this_machine(checkout)
    said = []
    write_bundle(checkout, target, [name], [python], site=options.get("site"), say=said.append)
    return said


def started(folder, *words):
    """A student's `python start.py`, where pip finds no index."""
    names = {name for name in os.environ if name.startswith(("PIP_", "CAMVIZ_", "PYTHONPATH"))}
    environment = {name: value for name, value in os.environ.items() if name not in names}
    environment |= {
        "PIP_INDEX_URL": NOWHERE,
        "PIP_CONFIG_FILE": os.devnull,
        "HTTPS_PROXY": NOWHERE,
        "HTTP_PROXY": NOWHERE,
    }
    command = [sys.executable, "start.py", *words]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=3000)


@pytest.mark.thorough
def test_a_bundle_installs_and_starts_with_no_network(checkout, tmp_path):
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "index.html").write_text("the site")
    said = made(checkout, tmp_path / "b.zip", site=tmp_path / "site")
    assert len(said) == 1
    assert said[0].startswith("fetching 1 wheels")
    with ZipFile(tmp_path / "b.zip") as packed:
        packed.extractall(tmp_path / "student")
    (unpacked,) = (tmp_path / "student").iterdir()
    assert {path.name for path in unpacked.iterdir()} == {
        *("README.txt", "start.py", "tools", "LICENSE"),
        *("wheels", "camviz-lessons", "site", "samples"),
    }
    assert "CC BY 4.0" in (unpacked / "camviz-lessons" / "LICENSE").read_text()
    assert (unpacked / "camviz-lessons" / "05_distortion.ipynb").read_text() == "a lesson"
    result = started(unpacked, "lab", "--lesson", "05")
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "lit ['lab', '--lesson', '05'] samples"
    assert "Setting up" not in started(unpacked, "doctor").stdout  # the second time there is nothing to do


def test_without_its_photographs_there_is_a_bundle_and_a_sentence(checkout, tmp_path, monkeypatch):
    def unavailable(name):
        raise SampleUnavailable(f"No {name} here.")

    monkeypatch.setattr(packing, "sample", unavailable)
    assert made(checkout, tmp_path / "b.zip")[-1].startswith("No left01.jpg here. Without it, lessons in the bundle")
    assert (tmp_path / "b.zip").is_file()


def test_a_bundle_tells_another_machine_that_it_is_not_for_it(checkout, tmp_path):
    made(checkout, tmp_path / "b.zip")
    with ZipFile(tmp_path / "b.zip") as packed:
        packed.extractall(tmp_path)
    (unpacked,) = tmp_path.glob("camviz-*")
    (unpacked / "wheels" / "machines.txt").write_text("windows-x86_64 3.2\n")
    name, python = this_machine(checkout)
    said = f"This bundle is for windows-x86_64 with Python 3.2; this is {name} with Python {python}.\n"
    assert started(unpacked).stderr == said
    assert not (unpacked / ".venv").exists()
    assert "take the repository for that" in started(unpacked, "test").stderr


def damage(path):
    path.write_bytes(path.read_bytes() + b"more")


def remove(path):
    path.unlink()


@pytest.mark.parametrize(
    ("do", "said"), [(remove, "No matching distribution found for lantern==1.0"), (damage, "HASH")]
)
def test_a_wheel_that_cannot_be_had_leaves_one_sentence_and_no_zip(checkout, tmp_path, do, said):
    do(tmp_path / "links" / "lantern-1.0-py3-none-any.whl")
    (tmp_path / "out").mkdir()
    with pytest.raises(BundleError) as told:
        made(checkout, tmp_path / "out" / "b.zip")
    assert said in str(told.value)
    assert str(told.value).endswith("nothing was written")
    assert "\n" not in str(told.value)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.thorough
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGTERM")
def test_a_bundle_that_is_ended_while_it_fetches_leaves_nothing_and_pip_ends_too(tmp_path):
    """The index is a server that never answers."""
    with socket.create_server(("127.0.0.1", 0)) as index:
        index.settimeout(300)
        address = f"http://127.0.0.1:{index.getsockname()[1]}/"
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PIP_INDEX_URL": address, "PIP_CONFIG_FILE": os.devnull}
        environment |= {"PIP_FIND_LINKS": "", "NO_PROXY": "127.0.0.1"}
        words = [sys.executable, "-m", "camviz", "bundle", str(tmp_path)]
        with subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True) as ended:
            asked, _ = index.accept()
            with asked:
                asked.settimeout(300)
                assert asked.recv(3) == b"GET"
                ended.send_signal(signal.SIGTERM)
                while asked.recv(65536):  # until pip's end of the connection is closed
                    pass
            _, said = ended.communicate(timeout=300)
    assert ended.returncode == 143
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["out.zip", "--platform", "windows-x86"], "did you mean windows-x86_64?"),
        (["out.zip", "--python", "3.10"], "expected a Python from 3.11 on, such as 3.12, got '3.10'"),
        (["out.tar"], "expected a folder that is there, or a name that ends in .zip"),
        (["nowhere/out.zip"], "there is no directory"),
        (["out.zip", "--site", "nowhere"], "there is no index.html in it"),
    ],
)
def test_a_mistaken_bundle_gets_one_sentence(capsys, room, words, said):
    assert said in refused(capsys, room, "bundle", *words)


def test_an_installed_camviz_says_that_a_bundle_is_made_in_a_checkout(capsys, room, monkeypatch):
    monkeypatch.setattr(material, "checkout_lessons", lambda: None)
    assert main(["bundle", "out.zip"]) == 3
    assert "a bundle is made in a checkout of the repository" in capsys.readouterr().err
    assert list(room.iterdir()) == []


def test_a_machine_that_no_bundle_is_made_for_is_named(capsys, room, monkeypatch):
    monkeypatch.setattr(packing, "this_machine", lambda root: ("plan9-mips", "3.12"))
    assert "no bundle is made for plan9-mips; --platform takes linux-x86_64" in refused(
        capsys, room, "bundle", "out.zip"
    )


def test_the_lock_is_read_as_another_machine_reads_it():
    """The markers of the real lock, by what each package is for."""
    entries = re.split(r"\n(?=\S)", (ROOT / "tools/locks/requirements.lock").read_text())

    def names(platform, release):
        return {one.split("==")[0] for one in wanted(entries, PLATFORMS[platform], release)}

    def pins(release):
        return {one.split(" ")[0] for one in wanted(entries, PLATFORMS["linux-x86_64"], release)}

    windows, linux, mac = (names(one, "3.12.4") for one in ("windows-x86_64", "linux-x86_64", "macos-arm64"))
    assert windows - linux == {"colorama", "pywinpty"}
    assert linux - windows == {"pexpect", "ptyprocess"}
    assert "appnope" in mac - linux
    assert pins("3.11.2") ^ pins("3.11.9") == {"soupsieve==2.10", "soupsieve==4.1.1"}
