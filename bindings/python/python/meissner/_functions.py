"""Functions over whole arrays and recordings, based on the classes that take events as they arrive."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ._durations import microseconds
from ._errors import InputError
from ._meissner import _TIME_FIELDS, Batch, Engine, EventFrames, Prediction, Recording, TimeSurface, VoxelGrid
from ._meissner import open as open_recording


def predictions(engine: Engine | Batch, recording: Any, every_us: int) -> Iterator[tuple[int, Prediction]]:
    """Pairs (t_us, prediction) every `every_us` microseconds of a recording.

    `recording` is a `Recording`, a path, or an array of events as for `Engine.push`. An event at t_us belongs to the window of
    that prediction. The first pair is `every_us` after the first event, the last one at or after the last event.
    """
    if every_us < 1:
        raise InputError(f"every_us: expected at least 1 us, found {every_us}")
    if isinstance(recording, np.ndarray):
        windows = _windows(recording, every_us)
    else:
        opened = recording if isinstance(recording, Recording) else open_recording(recording)
        windows = opened.windows(every_us)
    for t_us, events in windows:
        engine.push(events)
        engine.advance(t_us)
        yield t_us, engine.predict()


def _windows(events: np.ndarray, every_us: int) -> Iterator[tuple[int, np.ndarray]]:
    times = _times(events)
    start, size = 0, len(times)
    due = int(times[0]) + every_us if size else 0
    newest = np.maximum.accumulate(times) if size else times
    while start < size:
        end = start + int(np.searchsorted(newest[start:], due, side="right"))
        yield due, events[start:end]
        start, due = end, due + every_us


def _times(events: np.ndarray) -> np.ndarray:
    """The times of an array of events, in microseconds."""
    names = events.dtype.names or ()
    for name in _TIME_FIELDS:
        for found in names:
            if found.lower() == name:
                times = events[found]
                return microseconds(times) if times.dtype.kind == "m" else times
    raise InputError(f"events: expected a field t, found {', '.join(names) or 'none'}")


def event_frames(
    events: Any,
    sensor: tuple[int, int],
    *,
    rule: str = "counts",
    period_us: int = 10_000,
    maximum: float = 1.0,
    crop: tuple[int, int, int, int] | None = None,
    start_us: int | None = None,
    most: int = 100_000,
) -> tuple[np.ndarray, np.ndarray]:
    """Frames over consecutive windows: float32 (frames, channels, height, width), and the start of each in microseconds, int64.

    The last window is part of the result although it is still open. `rule` and the other arguments are those of `EventFrames`.
    More than `most` frames, for example from a recording with a long silence, raise `InputError`: use `EventFrames` there.
    """
    makes = EventFrames(sensor, rule=rule, period_us=period_us, maximum=maximum, crop=crop, start_us=start_us)
    done = makes.push(events)
    last = makes.open()
    if last is not None:
        done.append(last)
    count = sum(frame.count for frame in done)
    if count > most:
        raise InputError(f"events: expected at most {most} frames of {period_us} us, found {count}")
    values = np.zeros((count, *makes.shape), np.float32)
    starts = np.zeros(count, np.int64)
    at = 0
    for frame in done:
        values[at : at + frame.count] = frame.values
        starts[at : at + frame.count] = frame.start_us + period_us * np.arange(frame.count)
        at += frame.count
    return values, starts


def voxel_grid(
    events: Any,
    sensor: tuple[int, int],
    bins: int,
    *,
    window_us: tuple[int, int] | None = None,
    time: str = "bins",
    crop: tuple[int, int, int, int] | None = None,
) -> np.ndarray:
    """The voxel grid of events: float32 (bins, height, width). By default the window is the time range of the events.

    Without a window, `events` is an array with a field t or a `Recording`. The other arguments are those of `VoxelGrid`.
    """
    if window_us is None:
        array = np.asarray(events)
        times = _times(array)
        window_us = (int(times.min()), int(times.max())) if len(times) else (0, 0)
    grid = VoxelGrid(sensor, bins, window_us, time=time, crop=crop)
    grid.push(events)
    return grid.frame()


def time_surface(
    events: Any,
    sensor: tuple[int, int],
    *,
    tau_us: float | None = None,
    span_us: float | None = None,
    at_us: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
) -> np.ndarray:
    """The time surface after all events, or at a later time `at_us`: float32 (2, height, width). Arguments as for `TimeSurface`."""
    surface = TimeSurface(sensor, tau_us=tau_us, span_us=span_us, crop=crop)
    surface.push(events)
    if at_us is not None:
        surface.advance(at_us)
    return surface.frame()
