"""Other recordings of the same grasps: shorter, with spikes that nothing caused or without some. Times stay multiples of a bin."""

import numpy as np

BIN_US = 20_000
LATER = 12  # bins by which a recording can begin later
NOISE = 3  # most spikes that nothing caused
LOST = 0.1  # largest share of spikes that are lost


def augment(events, random, ages=None):
    """Another recording like `events` (events, 4). With `ages`, its end lies between these two, in microseconds."""
    places = np.unique(events[:, 1:3], axis=0)
    events = events[random.random(len(events)) >= random.uniform(0, LOST)]
    events = events[events[:, 0] >= events[0, 0] + BIN_US * random.integers(LATER + 1)]
    first, last = events[0, 0], events[-1, 0]
    if ages is not None:
        events = events[events[:, 0] <= first + random.uniform(*ages)]
        last = events[-1, 0]
    count = random.integers(NOISE + 1)
    times = BIN_US * random.integers(first // BIN_US, last // BIN_US + 1, count)
    noise = np.column_stack([times, places[random.integers(len(places), size=count)], random.integers(2, size=count)])
    events = np.concatenate([events, noise])
    return events[np.argsort(events[:, 0], kind="stable")]
