"""Times the peers on an exported window: `measure.py WINDOW [--runs N] [--with-pyg]`, called by run.py.

Prints one JSON object per line: the computation, the peer, the median in milliseconds, and which of our figures
it is compared with.
"""
import argparse
import json
import statistics
import time

import numpy as np
import scipy
import torch
from scipy.spatial import cKDTree

from window import Window, agree


def measure(call, runs):
    for _ in range(3):
        call()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        times.append((time.perf_counter() - start) * 1e3)
    return statistics.median(times)


def report(what, peer, ms, ours):
    print(json.dumps(dict(what=what, peer=peer, ms=ms, ours=ours)), flush=True)


def neighbours(window, runs):
    """The k nearest others of every event by a k-d tree. Ties may be in another order, so distances are compared."""
    positions, k = window.positions.astype(np.float64), window.near.shape[1]

    def search():
        # The first of k + 1 is the event itself, or another one at exactly its position.
        return cKDTree(positions).query(positions, k=k + 1)

    farthest = np.linalg.norm(positions[window.near[:, -1]] - positions, axis=1)
    agree("distance of the k-th neighbour", search()[0][:, -1], farthest)
    report("neighbour graph, 16 of all", f"SciPy {scipy.__version__} cKDTree", measure(search, runs), "graph_ms")


class EventLayers:
    """The five event-level blocks for a k-regular graph: the neighbours' rows are gathered and summed into the eight
    kernel slots by one batched product with the edges' basis, then one matrix product applies the weights to all
    slots. Batch norm is folded to a product and a sum, like ours."""

    WIDTHS = [1, 8, 16, 16, 16, 32]

    def __init__(self, window):
        self.near = torch.from_numpy(window.near)
        self.polarity = torch.from_numpy(window.polarity)
        self.positions = torch.from_numpy(window.positions)
        self.scale = window.scale
        self.blocks = []
        for i, outputs in enumerate(self.WIDTHS[1:]):
            weight, gamma, beta, mean, variance = (
                torch.from_numpy(window.tensors[f"blocks.{i}.{part}"])
                for part in ("conv.weight", "norm.weight", "norm.bias", "norm.running_mean", "norm.running_var"))
            factor = gamma / torch.sqrt(variance + 1e-5)
            self.blocks.append((weight.reshape(-1, outputs), factor, beta - mean * factor))

    def basis(self):
        """(n, 8, k): the share of edge e that enters slot x + 2 y + 4 t, divided by the number of edges."""
        offset = self.positions[self.near] - self.positions[:, None, :]
        u = (offset / (2 * self.scale) + 0.5).clamp_(0, 1)
        x, y, t = (torch.stack((1 - u[..., d], u[..., d]), 1) for d in range(3))
        corners = t[:, :, None, None] * y[:, None, :, None] * x[:, None, None, :]
        n, k = self.near.shape
        return corners.reshape(n, 8, k) / k

    def forward(self, basis):
        features = self.polarity
        for i, (weight, factor, shift) in enumerate(self.blocks):
            slots = torch.bmm(basis, features[self.near])
            after = torch.addcmul(shift, torch.nn.functional.elu(slots.flatten(1) @ weight), factor)
            if i == 1:
                kept = after
            features = after + kept if i == 3 else after
        return features


def vectorised(window, runs):
    layers = EventLayers(window)
    basis = layers.basis()
    agree("conv5", layers.forward(basis).numpy(), window.conv5)
    peer = f"PyTorch {torch.__version__.split('+')[0]}, vectorised by hand"
    report("event-level layers, their basis at hand", peer, measure(lambda: layers.forward(basis), runs),
           "event_layers_ms")
    report("event-level layers, basis included", peer, measure(lambda: layers.forward(layers.basis()), runs),
           "event_layers_ms")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("window")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--with-pyg", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(1)
    window = Window(args.window)
    with torch.inference_mode():
        neighbours(window, args.runs)
        vectorised(window, args.runs)
        if args.with_pyg:
            try:
                import pyg
            except ImportError as error:
                raise SystemExit(f"PyTorch Geometric is not in this environment: {error}")
            network = pyg.GraphRes(window)
            agree("prediction", network.forward().numpy(), window.prediction, 1e-4)
            # Every run takes seconds.
            runs = max(3, args.runs // 5)
            report("whole forward", pyg.NAME, measure(network.whole, runs), "forward_ms")


if __name__ == "__main__":
    main()
