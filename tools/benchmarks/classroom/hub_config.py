"""A hub on this machine alone, without passwords: the recipe of `tools/deploy/`, and what only the benchmark needs."""

import os
import sys
from pathlib import Path

c = get_config()  # noqa: F821  # JupyterHub gives this name to the files that it loads

FOLDER = Path(os.environ["CLASSROOM_FOLDER"])
RECIPE = Path(__file__).resolve().parents[2] / "deploy" / "jupyterhub_config.py"

load_subconfig(str(RECIPE))  # noqa: F821

c.JupyterHub.bind_url = os.environ["CLASSROOM_PUBLIC"]
c.JupyterHub.hub_bind_url = os.environ["CLASSROOM_HUB"]
c.JupyterHub.db_url = f"sqlite:///{FOLDER / 'hub.sqlite'}"
c.JupyterHub.cookie_secret_file = str(FOLDER / "cookie_secret")
c.JupyterHub.cleanup_proxy = False
c.JupyterHub.log_level = "WARN"
c.ConfigurableHTTPProxy.should_start = False
c.ConfigurableHTTPProxy.api_url = os.environ["CLASSROOM_PROXY"]

c.JupyterHub.authenticator_class = "dummy"
c.Authenticator.allow_all = True
c.JupyterHub.spawner_class = "simple"
c.SimpleLocalProcessSpawner.home_dir_template = str(FOLDER / "homes" / "{username}")
c.Spawner.cmd = [sys.executable, "-m", "jupyterhub.singleuser"]
if os.geteuid() == 0:
    c.Spawner.args.append("--allow-root")
HANDED_ON = ("CAMVIZ_SAMPLES", "JUPYTER_CONFIG_PATH", "JUPYTER_PATH", "PYTHONPATH")
c.Spawner.environment.update(
    {
        **{name: os.environ[name] for name in HANDED_ON if name in os.environ},
        "IPYTHONDIR": str(FOLDER / "ipython"),
        "JUPYTER_RUNTIME_DIR": str(FOLDER / "runtime"),
    }
)

c.JupyterHub.services = [{"name": "classroom", "api_token": os.environ["CLASSROOM_TOKEN"]}]
c.JupyterHub.load_roles = [
    {
        "name": "classroom",
        "scopes": ["admin:users", "admin:servers", "access:servers"],
        "services": ["classroom"],
    }
]
