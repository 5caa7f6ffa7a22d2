"""Kept graphs against those of the engine: `python -m unittest discover models/train/angle`, after `cargo build --release`."""

import argparse
import tempfile
import unittest
from pathlib import Path

import numpy as np
import presses
import sums
import torch
from graphs import Graphs, inspected
from kept import KeptGraphs
from network import Network

SENSOR = [346, 260]
MEISSNER = Path(__file__).resolve().parents[3] / "target/release/meissner"


def streams_of_events():
    """A sparse stream, a dense one on few pixels, a silent one, one longer than the window, and one with more events than it holds."""
    random = np.random.default_rng(0)

    def stream(events, side, duration_us):
        t_us = np.sort(random.integers(0, duration_us, events))
        x, y = random.integers(0, [side, min(side, SENSOR[1])], (events, 2)).T
        return np.stack([t_us, x, y, random.integers(0, 2, events)], 1).astype(np.int32)

    plans = (40, 346, 100_000), (1500, 12, 90_000), (0, 346, 1000), (3000, 346, 400_000), (33_000, 346, 120_000)
    return [stream(*plan) for plan in plans]


class Film:
    """Streams as a film of presses has them."""

    def __init__(self, streams):
        self.data, self.sensor = argparse.Namespace(events=streams), SENSOR

    def __len__(self):
        return len(self.data.events)


class Kept(unittest.TestCase):
    def both(self, network, streams, ends, moves=None):
        """The batch of the engine's graphs of the events until `ends`, and that of kept graphs."""
        with tempfile.TemporaryDirectory() as folder:
            settings = argparse.Namespace(meissner=MEISSNER, network=network, said=inspected(MEISSNER, network), folder=folder)
            cut = [stream[stream[:, 0] <= end] for stream, end in zip(streams, ends)]
            # Where rows read earlier rows only, whole streams are kept.
            whole = settings.said["graph"]["candidates"] == "past"
            kept = KeptGraphs(settings, SENSOR, streams if whole else cut, "cpu")
            mirrors, shifts = moves or ([[]] * len(cut), np.zeros((len(cut), 2), int))
            moved = [presses.moved(stream, SENSOR, *move) for stream, *move in zip(cut, mirrors, shifts)]
            part = Graphs(MEISSNER, network, settings.said, SENSOR, moved, folder).part(range(len(cut)))
            return part.read_pooled(), kept.read(range(len(cut)), ends, mirrors, shifts)

    def test_graphs_of_streams_as_they_are_equal_the_engines(self):
        streams = streams_of_events()
        for network in "tactigraph", "tactigraph-frozen", "graphres":
            for share in 1, 0.7:
                ends = [int(share * end) for end in ends_of(streams)]
                engine, kept = self.both(network, streams, ends)
                self.assertTrue(torch.equal(engine.input, kept.input))
                self.assertTrue(torch.equal(engine.place, kept.place))
                for number, (a, b) in enumerate(zip(engine.levels, kept.levels, strict=True)):
                    self.assertTrue(torch.equal(a.in_edges, b.in_edges))
                    self.assertLess(rows_that_differ(a, b), 1, (network, share, number))
                    if number > 0:
                        self.assertTrue(torch.equal(a.row, b.row) and torch.equal(a.place, b.place))

    def test_readings_at_any_time_equal_those_of_the_events_until_then(self):
        streams = streams_of_events()[:4]
        t_us = np.array([[end, end // 2] for end in ends_of(streams)])
        for name in "tactigraph", "tactigraph-frozen":
            settings = argparse.Namespace(meissner=MEISSNER, network=name, said=inspected(MEISSNER, name), folder=None)
            network = Network(settings.said, [1.0, 1.0], 0.0).eval()
            with torch.no_grad():
                ((some, found),) = sums.pooled(network, settings, Film(streams), t_us, [[], ["rows"]])
                self.assertEqual((some, found.shape[:2]), (slice(0, 4), (4, 4)))
                for age in range(2):
                    cut = [stream[stream[:, 0] <= end] for stream, end in zip(streams, t_us[:, age])]
                    with tempfile.TemporaryDirectory() as folder:
                        part = Graphs(MEISSNER, name, settings.said, SENSOR, cut, folder).part(range(4))
                        torch.testing.assert_close(network.readout(part.read_pooled()), found[:, age], rtol=1e-4, atol=1e-4)

    def test_mirrors_and_shifts_keep_cells_and_almost_all_edges(self):
        streams = [stream[(stream[:, 1:3] > 3).all(1) & (stream[:, 1] < 342) & (stream[:, 2] < 256)] for stream in streams_of_events()]
        moves = [["columns"], ["rows"], [], ["columns", "rows"], []], np.array([[2, 0], [-1, 1], [0, 0], [0, -2], [2, 2]])
        for network in "tactigraph", "tactigraph-frozen", "graphres":
            engine, kept = self.both(network, streams, ends_of(streams), moves)
            self.assertTrue(torch.equal(engine.input, kept.input))
            self.assertTrue(torch.equal(engine.place, kept.place))
            for a, b in zip(engine.levels, kept.levels, strict=True):
                self.assertLess(rows_that_differ(a, b), 0.02 * len(a.source))
                self.assertTrue(a.row is None or (torch.equal(a.row, b.row) and torch.equal(a.place, b.place)))


def ends_of(streams):
    return [stream[:, 0].max(initial=0) for stream in streams]


def rows_that_differ(a, b):
    """The number of rows whose sum of all in-edges' bases differs by more than rounding."""
    return int(((a.basis.sum(2) - b.basis.sum(2)).abs().amax(1) > 1e-4).sum())


if __name__ == "__main__":
    unittest.main()
