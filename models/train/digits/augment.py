"""Other recordings of the same digits: turned, sheared, stretched, moved, thinned, cut short. Pixels stay integers, times
stay as they are: what comes out is what a sensor could have sent."""

import numpy as np

TURN = 0.2  # radians
SHEAR = 0.2
STRETCH = 0.12  # of the logarithm, for each axis
SHIFT = 2.0  # pixels
MOST_STRIDE = 6  # thinning, uniform in the logarithm


def augment(events, side, random, share, shortest_us):
    """Another recording like `events` (events, 4), on a sensor of `side` by `side` pixels. A `share` of the recordings ends
    early, at `shortest_us` or later."""
    events = cut(thinned(events, random), random, share, shortest_us)
    turn, shear = random.uniform(-TURN, TURN), random.uniform(-SHEAR, SHEAR)
    stretch = np.exp(random.uniform(-STRETCH, STRETCH, 2))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    matrix = rotation @ np.array([[stretch[0], shear], [0, stretch[1]]])
    centre = (side - 1) / 2
    pixels = (events[:, 1:3] - centre) @ matrix.T + centre + random.uniform(-SHIFT, SHIFT, 2)
    pixels = np.rint(pixels).astype(np.int64)
    on_sensor = ((pixels >= 0) & (pixels < side)).all(axis=1)
    moved = np.concatenate([events[:, :1], pixels, events[:, 3:]], axis=1)
    return moved[on_sensor]


def thinned(events, random):
    """Every nth event from a random one on for whole n, or each with a chance: the network is to see any density."""
    stride = np.exp(random.uniform(0, np.log(MOST_STRIDE)))
    if random.random() < 0.5:
        stride = int(round(stride))
        return events[random.integers(stride) :: stride]
    return events[random.random(len(events)) < 1 / stride]


def cut(events, random, share, shortest_us):
    """The events up to some time, where the recording is to end early."""
    if random.random() >= share:
        return events
    end = events[0, 0] + random.uniform(shortest_us, events[-1, 0] - events[0, 0])
    return events[events[:, 0] <= end]
