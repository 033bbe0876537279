"""A real JupyterHub and its proxy on this machine, what they and all that they start take, and their end."""

from __future__ import annotations

import asyncio
import ctypes
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
from tornado.escape import json_decode, json_encode
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPResponse

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
HOST = "127.0.0.1"
KINDS = {"ipykernel_launcher": "kernels", "jupyterhub.singleuser": "servers", "configurable-http-proxy": "proxy"}
_ADOPT_ORPHANS = 36  # PR_SET_CHILD_SUBREAPER, linux/prctl.h: servers that outlive their hub stay ours to end


class Hub:
    """The hub, its proxy, and the folder in which all of it lives."""

    def __init__(self, folder: Path, proxy: str) -> None:
        self.folder = folder
        self._proxy = proxy
        self._ports = free_ports(3)
        self.token, self._proxy_token = secrets.token_hex(16), secrets.token_hex(16)
        self._log = (folder / "log.txt").open("ab")
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        ctypes.CDLL(None).prctl(_ADOPT_ORPHANS, 1)
        profile = folder / "ipython" / "profile_default"
        profile.mkdir(parents=True)
        shutil.copy(ROOT / "tools" / "deploy" / "ipython_config.py", profile)

    @property
    def address(self) -> str:
        return f"{HOST}:{self._ports[0]}"

    def start_proxy(self) -> None:
        public, api, hub = self._ports
        words = [self._proxy, "--ip", HOST, "--port", public, "--api-ip", HOST, "--api-port", api]
        words += ["--error-target", f"http://{HOST}:{hub}/hub/error", "--log-level", "error"]
        self._start("proxy", words, CONFIGPROXY_AUTH_TOKEN=self._proxy_token)

    def start_hub(self) -> None:
        public, api, hub = (f"http://{HOST}:{port}" for port in self._ports)
        words = [sys.executable, "-m", "jupyterhub", "--config", HERE / "hub_config.py"]
        path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        self._start(
            "hub",
            words,
            CLASSROOM_FOLDER=str(self.folder),
            CLASSROOM_PUBLIC=public,
            CLASSROOM_PROXY=api,
            CLASSROOM_HUB=hub,
            CLASSROOM_TOKEN=self.token,
            CONFIGPROXY_AUTH_TOKEN=self._proxy_token,
            PYTHONPATH=path,
        )

    def _start(self, name: str, words: list[Any], **environment: str) -> None:
        told = {**os.environ, **environment}
        output: dict[str, Any] = {"stdout": self._log, "stderr": self._log, "stdin": subprocess.DEVNULL}
        self.processes[name] = subprocess.Popen(
            [str(word) for word in words], cwd=self.folder, env=told, start_new_session=True, **output
        )

    def stop(self, name: str) -> None:
        """Ask the hub or the proxy to end, and wait."""
        self.processes[name].send_signal(signal.SIGTERM)
        self.processes[name].wait(60)

    async def ready(self, seconds: float = 120) -> None:
        """Wait until the hub answers through its proxy. Raises RuntimeError with the end of the log."""
        for _ in range(int(seconds / 0.2)):
            with suppress(OSError, HTTPClientError):
                await self.ask("hub/api/users")
                return
            if self.processes["hub"].poll() is not None:
                break
            await asyncio.sleep(0.2)
        raise RuntimeError(f"the hub did not start: {self.log()[-3000:]}")

    def log(self) -> str:
        """What hub, proxy and servers have said."""
        return (self.folder / "log.txt").read_text(encoding="utf-8", errors="replace")

    async def ask(self, path: str, told: Any = None, method: str = "") -> Any:
        """The JSON of an answer; None where there is none. Raises HTTPClientError for a refusal, and OSError."""
        return _decoded(await self.fetch(path, told, method))

    async def fetch(self, path: str, told: Any = None, method: str = "") -> HTTPResponse:
        return await AsyncHTTPClient().fetch(
            f"http://{self.address}/{path}",
            method=method or ("GET" if told is None else "POST"),
            headers={"Authorization": f"token {self.token}", "Content-Type": "application/json"},
            body=None if told is None else json_encode(told),
            request_timeout=180,
            allow_nonstandard_methods=True,
        )

    def living(self) -> list[psutil.Process]:
        """All that was started here, by the hub and its servers too."""
        return [each for each in psutil.Process().children(recursive=True) if _lives(each)]

    def memory_mb(self) -> Counter[str]:
        """The proportional set size of kernels, servers, hub and proxy: what two share counts by half for each."""
        sizes: Counter[str] = Counter()
        for process in self.living():
            with suppress(psutil.Error, OSError):
                sizes[_kind(process)] += _pss_kb(process.pid)
        return Counter({kind: round(size / 1024) for kind, size in sizes.items()})

    def counts(self) -> Counter[str]:
        """How many processes there are of each kind."""
        kinds: Counter[str] = Counter()
        for process in self.living():
            with suppress(psutil.Error):
                kinds[_kind(process)] += 1
        return kinds

    def processor_seconds(self) -> float:
        """Seconds that all of it has worked."""
        total = 0.0
        for process in self.living():
            with suppress(psutil.Error):
                times = process.cpu_times()
                total += times.user + times.system
        return total

    def end(self) -> int:
        """End everything, first politely. The number of processes that are left: 0."""
        for ask in (psutil.Process.terminate, psutil.Process.kill):
            for process in self.living():
                with suppress(psutil.Error):
                    ask(process)
            for _ in range(100):
                _bury()
                if not self.living():
                    break
                psutil.wait_procs(self.living(), timeout=0.2)
        self._log.close()
        return len(self.living())


def free_ports(number: int) -> list[int]:
    """Ports of the loopback address that nobody listens on."""
    probes = [socket.socket() for _ in range(number)]
    for probe in probes:
        probe.bind((HOST, 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def _decoded(response: HTTPResponse) -> Any:
    return json_decode(response.body) if response.body else None


def _lives(process: psutil.Process) -> bool:
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False


def _kind(process: psutil.Process) -> str:
    words = " ".join(process.cmdline())
    return next((kind for word, kind in KINDS.items() if word in words), "hub")


def _pss_kb(pid: int) -> int:
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def _bury() -> None:
    """Take note of the orphans that have ended, so that none stays as a zombie."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            continue
