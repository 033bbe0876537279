"""What every test runs under."""

import pytest
from hypothesis import HealthCheck, settings

# Two cores shared by several workers: no deadlines. The same examples on every run, so that a red run can be repeated.
settings.register_profile(
    "camviz", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("camviz")


def pytest_configure(config):
    """Without --all, what is done to files at random is done to each of them a third as often."""
    settings.register_profile("damage", settings.get_profile("camviz"), max_examples=60 if config.option.all else 20)


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
