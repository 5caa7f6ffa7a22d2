"""Which windows a training sees, and which it is judged by.

Cross-validation is over the Basic objects. Grouped by recording, fold k holds the k-th, (k + 4)-th ... recording of each
class and object out, so that every fold has every class and object and no recording stands on both sides. The paper's
way draws windows at random: neighbours of nearly every held-out window are trained on.
"""

import json
from dataclasses import dataclass, field

import torch

FOLDS = 4
SCHEMES = ("recordings", "windows")


@dataclass
class Part:
    """A training: what it sees, and what the header of its weights says about that."""

    seen: torch.Tensor
    held_out: torch.Tensor
    remarks: dict = field(default_factory=dict)
    suffix: str = ""


def whole(prepared):
    """All windows of the Basic objects."""
    return Part(prepared.of_set("Basic"), torch.tensor([], dtype=torch.long))


def split(prepared, scheme):
    """The folds of `scheme`."""
    basic = prepared.of_set("Basic")
    fold = (by_recording if scheme == "recordings" else by_window)(prepared, basic)
    for k in range(FOLDS):
        seen, held_out = basic[fold != k], basic[fold == k]
        remarks = {"scheme": scheme, "fold": str(k)} | named(prepared, scheme, held_out)
        yield Part(seen, held_out, remarks, f".{scheme}.{k}")


def by_recording(prepared, windows):
    """The fold of each window."""
    met, folds = {}, {}
    for i in windows.tolist():
        recording = int(prepared.recording[i])
        if recording not in folds:
            kind = (int(prepared.label[i]), prepared.object[i])
            folds[recording] = met.get(kind, 0) % FOLDS
            met[kind] = met.get(kind, 0) + 1
    return torch.tensor([folds[int(prepared.recording[i])] for i in windows.tolist()])


def by_window(_, windows):
    """The fold of each window, drawn once for all seeds."""
    drawn = torch.randperm(len(windows), generator=torch.Generator().manual_seed(0))
    return drawn % FOLDS


def named(prepared, scheme, held_out):
    """The names of what is held out."""
    if scheme == "recordings":
        recordings = sorted({int(prepared.recording[i]) for i in held_out.tolist()})
        return {"held_out": json.dumps([prepared.recordings[r] for r in recordings])}
    # A recording's windows follow each other: its first one is where its number first stands.
    first = {}
    for i, recording in enumerate(prepared.recording.tolist()):
        first.setdefault(recording, i)
    places = []
    for i in held_out.tolist():
        recording = int(prepared.recording[i])
        places.append([prepared.recordings[recording], i - first[recording]])
    return {"held_out_windows": json.dumps(places)}
