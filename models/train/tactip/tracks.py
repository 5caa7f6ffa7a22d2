"""Tracks of the pins of presses, as `meissner simulate markers` reads them, with labels over time. `presses.py` describes a press."""

import numpy as np
from pins import SHALLOW

# The rest varies, so that a press begins anywhere within a cell in time.
REST_US, HOLD_US = (10_000, 60_000), 20_000
DURATION_US = 100_000, 200_000
# Durations of a press before a move, and of the move: both together fit into the 300 ms that the networks look back.
PART_US = 60_000, 130_000
STEPS = 12  # of the motion; markers move along straight lines between them


def risen(shares):
    """Depth at shares of the duration, as shares of its end."""
    return shares * shares * (3 - 2 * shares)


def taps(field, pose, residual, random):
    """The tracks of presses without a move, at whose end the pins deviate from the field by `residual`. On the way they deviate by as much
    as in another image: from rest on growing with the depth until images begin, and from the middle on turning into `residual`. Weights
    whose squares sum to 1 keep the mean square of the deviation."""
    times = knots(random, len(pose), DURATION_US)
    other = random.permutation(residual)
    states = []
    for share in np.linspace(0, 1, STEPS + 1):
        at = pose * (risen(share), 1, 1)
        turned = np.pi / 2 * risen(max(2 * share - 1, 0))
        off = np.cos(turned) * other + np.sin(turned) * residual
        states.append((at, field(at) + np.minimum(at[:, :1, None] / SHALLOW, 1) * off))
    return tracks(times, states)


def shears(field, pose, move, residual, random):
    """The tracks of presses that are followed by a move, at whose end the pins deviate from the field by `residual`."""
    times = knots(random, len(pose), PART_US, PART_US)
    other = random.permutation(residual)
    pressed = pose - np.column_stack([np.zeros(len(pose)), move[:, 2:4]])
    states = []
    for rise in risen(np.linspace(0, 1, STEPS + 1)):
        at = pressed * (rise, 1, 1)
        states.append((at, field(at, 0 * move) + rise * other))
    for done in risen(np.linspace(0, 1, STEPS + 1)[1:]):
        at = pressed + done * (pose - pressed)
        states.append((at, field(at, done * move) + (1 - done) * other + done * residual))
    return tracks(times, states)


def knots(random, presses, *durations):
    """Times (press, knot) of the states of presses whose parts take random durations, after a rest and before a hold."""
    rest, *durations = (random.integers(*limits, presses, endpoint=True) for limits in (REST_US, *durations))
    times = [np.zeros_like(rest), rest]
    for duration in durations:
        times += [times[-1] + np.rint(share * duration).astype(np.int64) for share in np.linspace(0, 1, STEPS + 1)[1:]]
    return np.column_stack([*times, times[-1] + HOLD_US])


def tracks(times, states):
    """The tracks of presses as `meissner simulate markers` reads them, with the labels along time. A state has poses (press, 3) and
    positions (press, pin, 2); the first rests, the last is held."""
    poses, positions = ([np.float32(value) for value in values] for values in zip(states[0], *states, states[-1]))
    depth, tilt_x, tilt_y = np.stack(poses, 1).reshape(-1, 3).T.copy()
    start = np.arange(len(times) + 1) * times.shape[1]
    flat = np.stack(positions, 1).reshape(-1, *positions[0].shape[1:])
    return {"t_us": times.ravel(), "start": start, "position": flat, "depth": depth, "tilt_x": tilt_x, "tilt_y": tilt_y}
