"""Ray on this machine: nothing listens beyond loopback, nothing is reported, nothing is left behind.

A program that starts Ray, or joins a cluster, before it calls this package keeps that Ray.
"""

from __future__ import annotations

import logging
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from .errors import ClusterError, SettingsError

_MIB = 2**20
_FOLDER = "meissner-ray-"

# One for all sessions of a process, because Ray keeps the first.
_TOKEN = secrets.token_hex(32)

# Ray uses loopback as its address only if clusters are disabled. Otherwise, it replaces a loopback address.
_LOCAL = "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"


@contextmanager
def started(workers: int | None) -> Iterator[int]:
    """Starts Ray with `workers` workers, by default the number of cores, and yields their number."""
    ray: Any = import_module("ray")
    if ray.is_initialized():
        if workers is not None:
            raise SettingsError("workers: expected None, because Ray runs already and has a number of its own")
        yield max(1, int(ray.cluster_resources().get("CPU", 1)))
        return
    workers = len(os.sched_getaffinity(0)) if workers is None else workers
    if workers < 1:
        raise SettingsError(f"workers: expected at least 1, found {workers}")
    # Sockets are in this folder, and their paths must be short.
    _sweep()
    folder = Path(tempfile.mkdtemp(prefix=f"{_FOLDER}{os.getpid()}-"))
    try:
        with _loopback():
            ray.init(
                address="local",
                num_cpus=workers,
                include_dashboard=False,
                object_store_memory=80 * _MIB,
                log_to_driver=False,
                logging_level=logging.ERROR,
                _temp_dir=str(folder),
            )
        address = ray.util.get_node_ip_address()
        if address not in ("127.0.0.1", "::1"):
            raise ClusterError(f"address of Ray: expected loopback, found {address}")
        yield workers
    finally:
        ray.shutdown()
        shutil.rmtree(folder, ignore_errors=True)


def _sweep() -> None:
    """Removes the folders of programs that were killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_FOLDER}[0-9]*-*"):
        program = int(folder.name.removeprefix(_FOLDER).partition("-")[0])
        try:
            os.kill(program, 0)
        except ProcessLookupError:
            shutil.rmtree(folder, ignore_errors=True)
        except PermissionError:
            continue


@contextmanager
def _loopback() -> Iterator[None]:
    """The environment in which Ray starts."""
    from ray._private import ray_constants

    ours = {_LOCAL: "0", "RAY_USAGE_STATS_ENABLED": "0"}
    if not {"RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & os.environ.keys():
        # Other users of the machine reach loopback, too. Ray asks for a token by default, and sets the mode.
        ours |= {"RAY_AUTH_TOKEN": _TOKEN}
    before = {name: os.environ.get(name) for name in (*ours, "RAY_AUTH_MODE")}
    clusters = ray_constants.ENABLE_RAY_CLUSTER
    os.environ.update(ours)
    # Ray reads the variable when it is imported, which may have been long ago.
    ray_constants.ENABLE_RAY_CLUSTER = False
    try:
        yield
    finally:
        ray_constants.ENABLE_RAY_CLUSTER = clusters
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
