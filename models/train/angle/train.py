"""Trains the networks for the contact angle on presses of `dome.py`, in the stages that the shipped weights had.

    python models/train/angle/dome.py /tmp/dome --cameras 4
    python models/train/angle/train.py /tmp/dome --network tactigraph-past

An interrupted training continues. Then `meissner eval angle` prints its errors.
"""

import sys
from pathlib import Path

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
import stages

LAMPS, ALL = ["on", "off"], ["on", "off", "off-used", "on-used"]
PLANES = ["on-planes", "off-planes"]
MIRRORS = ["columns", "rows"]


def stage(epochs, rate=0.003, start=(), films=LAMPS, stride=1, blocks=False, decay=0.001, **presses):
    """All layers: in each epoch every press once, mirrored and shifted, read at random ages and at its end."""
    presses = {"mirrors": MIRRORS, "strides": [stride, stride]} | presses
    said = {"films": films, "unit": 0.1, "stride": stride, "blocks": blocks, "start": list(start)}
    return said | {"presses": presses, "fit": {"epochs": epochs, "rate": rate, "decay": decay}}


def head(epochs, rate, decay, start, films, valid, ages, ends, seed=0, mirrors=MIRRORS):
    """The layers behind the readout, on stored readouts."""
    readouts = {"mirrors": mirrors, "ages": ages, "ends": ends, "batch": 64}
    said = {"films": films, "valid": valid, "unit": 0.1, "start": list(start), "seed": seed}
    return said | {"readouts": readouts, "fit": {"epochs": epochs, "rate": rate, "decay": decay, "check": 30}}


def dense(epochs, rate, decay, start, seed=0):
    return head(epochs, rate, decay, start, [*ALL, "o*-[23]", "off*-4"], ALL, 7, 0.15, seed)


POOLED = {"youngest": 0.5, "batch": 8}
STAGES = {
    "tactigraph-past": {
        "first": stage(12, stride=2),
        "second": stage(5, 0.001, ["first"]),
        "third": stage(10, 0.0015, ["second"], times=3, youngest=0.3),
        "fourth": stage(22, 0.003, ["third"], times=4, youngest=0.3),
        "fifth": stage(14, 0.002, ["fourth"], ALL, times=3, youngest=0.3),
        "sixth": stage(21, 0.002, ["fifth"], ALL, times=3, youngest=0.3),
        **{f"dense{seed}": dense(500, 0.0005, 0.03, ["sixth"], seed) for seed in range(3)},
        "mean": dense(90, 0.0002, 0.1, ["dense0", "dense1", "dense2"]),
    },
    "tactigraph": {
        "first": stage(58, stride=4, **POOLED),
        "second": stage(6, 0.001, ["first"], **POOLED),
        "third": stage(30, 0.002, ["second"], **POOLED),
        "head": head(400, 0.002, 0.1, ["third"], LAMPS, LAMPS, 1, 1.0, mirrors=()) | {"blocks": True},
        "fourth": stage(9, 0.002, ["head"], decay=0.01, passes=3, **POOLED),
        "planes": stage(9, 0.002, ["fourth"], PLANES, decay=0.01, passes=3, **POOLED) | {"valid": LAMPS},
    },
    "tactigraph-frozen": {
        "first": stage(4, 0.001, ["/tactigraph.second"], blocks=True, **POOLED),
        "second": stage(12, 0.0015, ["first"], **POOLED),
        "third": stage(31, 0.002, ["second"], **POOLED),
        "fourth": stage(15, 0.002, ["third"], **POOLED),
        "head": head(300, 0.001, 0.1, ["fourth"], [*LAMPS, "off-4"], LAMPS, 2, 0.7) | {"blocks": True},
    },
    "graphres": {
        "first": stage(46, stride=4, **POOLED),
        "second": stage(5, 0.001, ["first"], **POOLED),
        "third": stage(39, 0.002, ["second"], **POOLED),
    },
    "graphres-published": {"first": stage(3, 0.001, ["/graphres.second"], **POOLED)},
    "event-frame-cnn": {
        "first": stage(12, 0.001),
        "second": stage(160, 0.001, ["first"]),
        "third": stage(12, 0.0005, ["second"], ALL),
    },
}
REMARKS = {
    "about": "trained on presses of a simulated dome, whose camera is simulated too",
    "ranges": "[[-0.15708,0.15708],[-0.15708,0.15708]]",
}


if __name__ == "__main__":
    args = shared.arguments(__doc__, STAGES, "angle", "folder of folders of films", work=Path("/tmp/stages"), device="cpu")
    for network in args.network:
        stages.run(network, STAGES[network], args, REMARKS)
