"""What every test runs under."""

import hashlib
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from camviz_clinic.calibration import chessboards

# Two cores shared by several workers: no deadlines. The same examples on every run, so that a red run can be repeated.
settings.register_profile(
    "camviz", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("camviz")


def pytest_configure(config):
    """Without --all, a property that does not say how often is tried on 25 examples in place of Hypothesis' 100.

    What is done to files at random is done to each of them a third as often.
    """
    examples, damages = (100, 60) if config.option.all else (25, 20)
    settings.register_profile("camviz", settings.get_profile("camviz"), max_examples=examples)
    settings.load_profile("camviz")
    settings.register_profile("damage", settings.get_profile("camviz"), max_examples=damages)


@pytest.fixture(scope="session")
def thorough(request):
    """Whether --all was given: what is drawn at random is drawn more often."""
    return request.config.getoption("--all")


@pytest.fixture
def room(tmp_path, monkeypatch):
    """An empty current folder, apart from the files the tests read."""
    (tmp_path / "room").mkdir()
    monkeypatch.chdir(tmp_path / "room")
    return tmp_path / "room"


@pytest.fixture(scope="session", autouse=True)
def each_photograph_is_searched_once():
    """The search for a chessboard, 0.3 s a photograph, answers at once when it is asked the same again.

    So that it is asked in this process, `detect` takes one process unless it is given `workers`.
    """
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(chessboards, "find_chessboard", remembered(chessboards.find_chessboard))
        patched.setattr("camviz_clinic.calibration.detection.processors", lambda: 1)
        yield


def remembered(search):
    """`find_chessboard` with its answers kept, by the picture's pixels and what is looked for."""
    answers = {}

    def asked(gray, board, finder="auto"):
        pixels = hashlib.sha256(np.ascontiguousarray(gray)).digest()
        key = (pixels, gray.shape, str(gray.dtype), astuple(board), finder)
        if key not in answers:
            answers[key] = search(gray, board, finder)
        return None if answers[key] is None else answers[key].copy()

    return asked
