"""Incremental inference for event cameras and event-based touch.

An `Engine` keeps the graph of the events of the last fraction of a second. When an event enters or leaves, it recomputes only
what this event affects, and its predictions equal those of a full recomputation (`Batch`) in every bit.

| you want | look at |
|---|---|
| predictions from events | `Engine`; `predictions` runs one over a recording |
| the same from scratch, as an oracle | `Batch` |
| predictions by a deadline, while events arrive | `Live` |
| predictions from frames | `FrameEngine`, `frames_for` |
| frames, voxel grids, time surfaces | `EventFrames`, `SlidingFrame`, `VoxelGrid`, `TimeSurface`, and functions over whole arrays |
| fewer events | `Filters` |
| networks and weights | `networks`, `Description`, `Weights` |
| recordings | `open`, `write` |
| simulated events, with their causes | `Camera`, `film_images`, `film_markers`, `Press` |
| labelled data sets | `meissner.datasets` |
| figures of networks on data sets | `evaluate`, `pareto`, `meissner.metrics` |
| a model of PyTorch Geometric | `meissner.export` |
| to train a network in PyTorch | `meissner.torch` |

Times are microseconds. Events are NumPy arrays with the fields t, x, y, p (`EVENT_DTYPE`), or with the fields of other libraries.
"""

from . import datasets, metrics
from ._errors import (
    DescriptionError,
    DtypeError,
    Error,
    EvaluationError,
    FileError,
    InputError,
    LiveError,
    MeissnerWarning,
    MemoryLimitError,
    NotANumberError,
    NotIncrementalError,
    RecordingError,
    SnapshotError,
    WeightsError,
)
from ._evaluate import Evaluation, Pareto, evaluate, pareto
from ._functions import event_frames, predictions, time_surface, voxel_grid
from ._meissner import (
    CAUSES,
    EVENT_DTYPE,
    SIMULATED_DTYPE,
    Batch,
    Camera,
    Card,
    Description,
    Engine,
    EventFrame,
    EventFrames,
    Filters,
    FrameEngine,
    Graph,
    Live,
    Prediction,
    Press,
    Recording,
    SlidingFrame,
    TimeSurface,
    Timely,
    VoxelGrid,
    Weights,
    __version__,
    film_markers,
    frames_for,
    networks,
    open,  # noqa: A004
    write,
)
from ._simulate import film_images

__all__ = [
    "CAUSES",
    "EVENT_DTYPE",
    "SIMULATED_DTYPE",
    "Batch",
    "Camera",
    "Card",
    "Description",
    "DescriptionError",
    "DtypeError",
    "Engine",
    "Error",
    "Evaluation",
    "EvaluationError",
    "EventFrame",
    "EventFrames",
    "FileError",
    "Filters",
    "FrameEngine",
    "Graph",
    "InputError",
    "Live",
    "LiveError",
    "MeissnerWarning",
    "MemoryLimitError",
    "NotANumberError",
    "NotIncrementalError",
    "Pareto",
    "Prediction",
    "Press",
    "Recording",
    "RecordingError",
    "SlidingFrame",
    "SnapshotError",
    "TimeSurface",
    "Timely",
    "VoxelGrid",
    "Weights",
    "WeightsError",
    "__version__",
    "datasets",
    "evaluate",
    "event_frames",
    "film_images",
    "film_markers",
    "frames_for",
    "metrics",
    "networks",
    "open",
    "pareto",
    "predictions",
    "time_surface",
    "voxel_grid",
    "write",
]
