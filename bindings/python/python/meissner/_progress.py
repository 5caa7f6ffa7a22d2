"""Progress of long work: a bar on a terminal or in a notebook, a callback, or nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

Callback = Callable[[int, int, str], Any]

# Shorter work has no bar.
_PATIENCE_S = 1.0


def ticks(progress: bool | Callback | None, unit: str) -> _Silent:
    """An object that is called with (done, total, name) during long work; total is 0 while it is unknown.

    `progress` is a callback with these arguments, True or False; None is True on a terminal and in a notebook.
    """
    if callable(progress):
        return _Called(progress)
    if progress is None:
        progress = sys.stderr.isatty() or _in_notebook()
    if not progress:
        return _Silent()
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return _Line(unit)
    return _Tqdm(tqdm, unit)


def _in_notebook() -> bool:
    get_ipython = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)
    return hasattr(get_ipython(), "kernel")


class _Silent:
    def __call__(self, done: int, total: int, name: str) -> None:
        pass

    def __enter__(self) -> _Silent:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        pass


class _Called(_Silent):
    def __init__(self, callback: Callback) -> None:
        self.callback, self.last = callback, None

    def __call__(self, done: int, total: int, name: str) -> None:
        if self.last != (done, total, name):
            self.last = (done, total, name)
            self.callback(done, total, name)


class _Bar(_Silent):
    def __init__(self, unit: str) -> None:
        self.unit, self.begin = unit, time.monotonic()

    def __call__(self, done: int, total: int, name: str) -> None:
        if total and time.monotonic() - self.begin > _PATIENCE_S:
            self.draw(done, total, name)

    def draw(self, done: int, total: int, name: str) -> None:
        raise NotImplementedError


class _Tqdm(_Bar):
    def __init__(self, tqdm: Any, unit: str) -> None:
        super().__init__(unit)
        self.tqdm, self.bar = tqdm, None

    def draw(self, done: int, total: int, name: str) -> None:
        if self.bar is None:
            self.bar = self.tqdm(total=total, unit=f" {self.unit}", leave=False)
        self.bar.set_postfix_str(name, refresh=False)
        self.bar.update(done - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()


class _Line(_Bar):
    drawn = False

    def draw(self, done: int, total: int, name: str) -> None:
        filled = 30 * done // total
        left = (time.monotonic() - self.begin) * (total - done) / done if done else float("nan")
        bar = "#" * filled + "." * (30 - filled)
        print(f"\r\x1b[K{bar} {done} of {total} {self.unit}, {left:.0f} s left {name[:40]}", end="", file=sys.stderr, flush=True)
        self.drawn = True

    def close(self) -> None:
        if self.drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
