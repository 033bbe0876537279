"""The recipes for hubs hold together, as far as that can be seen without Docker, Kubernetes and a network."""

import os
import re
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
import yaml
from IPython.core.interactiveshell import InteractiveShell
from jsonschema import Draft7Validator
from traitlets.config import Config, Configurable

ROOT = Path(__file__).resolve().parent.parent
SCHEMA = os.environ.get("CAMVIZ_CHART_SCHEMA")  # jupyterhub/values.schema.yaml of the chart's release


def text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def values() -> dict:
    return yaml.safe_load(text("tools/deploy/kubernetes/values.yaml"))


def configured(path: str) -> Config:
    """What a configuration file asks for."""
    config = Config()
    exec(compile(text(path), path, "exec"), {"get_config": lambda: config})
    return config


def asked(config: Config, section: str) -> dict:
    """The environment or arguments of spawners, as the hub will see them."""
    found = config[section]
    return {
        "environment": found.environment.get_value({}),
        "args": found.args.get_value([]),
    }


def megabytes(size: str) -> int:
    return int(re.fullmatch(r"(\d+)M", size)[1])


@pytest.mark.skipif(SCHEMA is None, reason="CAMVIZ_CHART_SCHEMA names no schema of the chart")
def test_the_chart_knows_every_value_and_takes_its_type() -> None:
    schema = yaml.safe_load(Path(SCHEMA).read_text(encoding="utf-8"))
    errors = [one for one in Draft7Validator(schema).iter_errors(values()) if one.validator != "required"]
    assert [f"{list(one.path)}: {one.message}" for one in errors] == []  # what is missing, the chart's defaults give


def test_both_recipes_start_the_same_server_with_the_same_environment() -> None:
    config = asked(configured("tools/deploy/jupyterhub_config.py"), "Spawner")
    chart = values()["singleuser"]
    assert set(chart["cmd"][1:]) == {each for each in config["args"] if "no_activity" not in each}
    assert {name: word for name, word in chart["extraEnv"].items() if name != "CAMVIZ_KERNEL_MB"} == config[
        "environment"
    ]


def test_a_kernel_at_its_limit_and_its_server_fit_into_a_students_container() -> None:
    memory, environment = values()["singleuser"]["memory"], values()["singleuser"]["extraEnv"]
    assert f'"CAMVIZ_KERNEL_MB", "{environment["CAMVIZ_KERNEL_MB"]}"' in text("tools/deploy/ipython_config.py")
    assert int(environment["CAMVIZ_KERNEL_MB"]) < megabytes(memory["limit"])
    assert megabytes(memory["guarantee"]) < megabytes(memory["limit"])
    assert f"limits.memory {memory['limit']}" in text("tools/deploy/README.md")


def test_what_is_guaranteed_is_what_was_measured_and_at_most_half_more() -> None:
    (row,) = re.findall(
        r"^\| 60 \|.*$", text("docs/performance.md").partition("## A class on one hub")[2], re.MULTILINE
    )
    measured = int(re.split(r"\s*\|\s*", row.strip("| "))[7])
    assert measured * 1.1 <= megabytes(values()["singleuser"]["memory"]["guarantee"]) <= measured * 1.5
    assert f"{measured} MB" in text("docs/teaching.md").partition("## From a laptop to 600 students")[2]


@pytest.mark.skipif(
    find_spec("jupyterhub") is None, reason="jupyterhub is not installed here: its traits are not known"
)
def test_the_hub_knows_every_trait_that_the_recipe_names() -> None:
    from jupyterhub.app import JupyterHub
    from jupyterhub.spawner import Spawner

    config = configured("tools/deploy/jupyterhub_config.py")
    kinds: dict[str, type[Configurable]] = {"JupyterHub": JupyterHub, "Spawner": Spawner}
    assert {
        section: sorted(set(config[section]) - set(kinds[section].class_trait_names(config=True))) for section in config
    } == {
        "JupyterHub": [],
        "Spawner": [],
    }


def test_the_servers_know_every_option_that_they_are_started_with() -> None:
    from jupyter_server.serverapp import ServerApp
    from jupyter_server.services.kernels.kernelmanager import MappingKernelManager

    kinds = {"ServerApp": ServerApp, "MappingKernelManager": MappingKernelManager}
    options = re.findall(r"--(\w+)\.(\w+)=", text("tools/deploy/jupyterhub_config.py"))
    assert len(options) == 5
    assert [name for kind, name in options if name not in kinds[kind].class_trait_names(config=True)] == []


def test_a_kernel_beyond_its_limit_gets_a_memory_error_and_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource", reason="this system has no limits of a process")
    asked_for: list[tuple[int, tuple[int, int]]] = []
    monkeypatch.setattr(resource, "setrlimit", lambda kind, both: asked_for.append((kind, both)))
    monkeypatch.setenv("CAMVIZ_KERNEL_MB", "900")
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)  # IPython warns where another one than this Python's is active
    (line,) = configured("tools/deploy/ipython_config.py").InteractiveShellApp.exec_lines
    shell = InteractiveShell.instance()
    before = set(shell.user_ns)
    assert shell.run_cell(line).success
    assert asked_for == [(resource.RLIMIT_DATA, (900 << 20, 900 << 20))]
    assert {name for name in set(shell.user_ns) - before if not re.fullmatch(r"_i*\d*", name)} == set()


def test_the_image_is_the_readers_with_the_charts_hub_and_the_kernels_limit() -> None:
    steps = text("tools/deploy/hub.Dockerfile")
    assert steps.split("\n")[3].startswith("FROM camviz") or "\nFROM camviz\n" in steps
    assert "docker build -t camviz -f tools/deploy/Dockerfile ." in text("tools/deploy/Dockerfile")
    hub = re.search(r"jupyterhub==([\d.]+)\.\*", steps)[1]
    assert f"JupyterHub {hub})" in text("tools/deploy/kubernetes/values.yaml").partition("\n\n")[0]
    assert "COPY tools/deploy/ipython_config.py" in steps
    assert "USER reader" in steps.partition("FROM")[2]
    assert values()["singleuser"]["storage"]["homeMountPath"] == "/home/reader"


def test_the_link_for_students_pulls_this_repository_and_opens_a_lesson_of_it() -> None:
    links = re.findall(r"https://hub\.example\.org/hub/user-redirect/git-pull\S+", text("tools/deploy/README.md"))
    assert links
    for link in links:
        asks = parse_qs(urlsplit(link).query, strict_parsing=True)
        assert asks["repo"] == ["https://github.com/camviz/camviz"]
        (opened,) = asks["urlpath"]
        assert opened.startswith("lab/tree/camviz/lessons/")
        assert (ROOT / opened.removeprefix("lab/tree/camviz/")).exists()
