"""Trains the frame networks for contact force on simulated grasps, from a seed.

    python models/train/force/data.py /tmp/force
    python models/train/force/train.py /tmp/force --network force-tdnn force-lstm force-cnnlstm force-convlstm

FOLDER has train.safetensors and valid.safetensors. Writes NETWORK.SEED.safetensors; what is there already is not trained again, and a
training that was cut off goes on with its next stage. Then `meissner eval force` says what it is worth.

    python models/train/force/train.py /tmp/force --network force-tdnn --folds 92 --share 0.1 --out /tmp/folds

learns from the 92 recordings of test.safetensors instead of train.safetensors, and leaves one of them out each time: NETWORK.SEED.K.safetensors.
"""

import argparse
import copy
import datetime
import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from networks import NETWORKS, PLACES, SIDE
from recordings import read
from safetensors.torch import load_file

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import export_weights

# What counts are divided by: `maximum` of the descriptions.
MAXIMUM = 8.0
ABOUT = "trained on grasps of simulated bolts, whose camera is simulated too"
# Of each network: stages of (every so many pixels, recordings, rate, recordings of a step). A stage begins where the one before ended.
# Every 0 pixels: kernels stay as they are, and what follows them learns.
RECIPES = {
    "force-tdnn": [(1, 180_000, 0.003, 16)],
    "force-lstm": [(1, 45_000, 0.002, 16)],
    "force-cnnlstm": [(0, 45_000, 0.002, 16)],
    "force-convlstm": [(5, 5_400, 0.01, 8), (5, 21_600, 0.01, 8), (1, 64, 0.002, 1)],
}


def main():
    args = arguments()
    torch.set_num_threads(1)
    args.out.mkdir(parents=True, exist_ok=True)
    train, valid = (read(args.data / f"{part}.safetensors") for part in ("test" if args.folds else "train", "valid"))
    for name in args.network:
        own, check = reduced(name, train), reduced(name, valid)
        for fold in range(args.folds or 1):
            held_out = list(range(fold, len(own), args.folds)) if args.folds else []
            path = args.out / f"{name}.{args.seed}{f'.{fold}' if args.folds else ''}.safetensors"
            if not path.exists():
                seen = own.part(np.setdiff1d(np.arange(len(own)), held_out)) if held_out else own
                fit(name, seen, check, held_out, path, args)


def fit(name, train, valid, held_out, path, args):
    """Trains a network and writes its weights, with the recordings that it has not seen."""
    print(path.stem, flush=True)
    torch.manual_seed(args.seed)
    random = np.random.default_rng(args.seed)
    network = NETWORKS[name]()
    stages = [(every, max(int(count * args.share), batch), rate, batch) for every, count, rate, batch in RECIPES[name]]
    if args.start:
        network.load_exported({key: tensor.float() for key, tensor in load_file(args.start).items()})
        network.learn_on()
        stages = stages[-1:]
    first, state_path = 0, path.with_suffix(".state")
    if state_path.exists():
        state = torch.load(state_path, weights_only=False)
        network.load_state_dict(state["network"])
        random.bit_generator.state, first = state["random"], state["stages"]
    for number, stage in list(enumerate(stages))[first:]:
        if stage[0] == 0:
            run(AfterKernels(network), name, *(featured(network, each) for each in (train, valid)), stage, random)
        else:
            run(network, name, train, valid, stage, random)
        torch.save({"network": network.state_dict(), "random": random.bit_generator.state, "stages": number + 1}, state_path)
    error = validated(network, name, valid, 1, args.quick)
    remarks = {
        "network": name,
        "seed": args.seed,
        "trained": "true",
        "date": datetime.date.today().isoformat(),
        "about": ABOUT,
        "recipe": (f"from {args.start.name}: " if args.start else "") + "; ".join(f"{count} recordings of every {every} pixels, batch {batch}, AdamW {rate}" for every, count, rate, batch in stages),
        "recordings": len(train),
        "trained_on": "test, without those held out" if held_out else "train",
        "source": f"simulate grasp --seed {2 if held_out else 1}",
        "sensor": json.dumps([SIDE, SIDE]),
        "ranges": json.dumps([[0, 3.12]]),
        "maximum": MAXIMUM,
        "valid_mse": f"{error:.4f}",
        "licence": "data and weights are this project's own",
    }
    if held_out:
        remarks |= {"held_out": json.dumps([str(recording) for recording in held_out])}
    export_weights.save(network.exported(), path, remarks, half=name != "force-tdnn")
    state_path.unlink()
    print(f"{path}: validation {error:.4f} N^2", flush=True)


def run(network, name, train, valid, stage, random):
    """One stage: mirrored recordings in random order, AdamW on the squared error of every frame, on a cosine."""
    every, count, rate, batch = stage
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=0.001)
    steps, total, started = max(count // batch, 1), 0.0, time.time()
    order = np.concatenate([random.permutation(len(train)) for _ in range(-(-steps * batch // len(train)))])
    best = (math.inf, None)
    # Pictures of all pixels take long to validate.
    check = max(steps // (2 if name in ("force-convlstm", "force-cnnlstm") and every in (1, 2) else 10), 1)
    for step in range(steps):
        done = step / steps
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1.0, 20 * done + 0.05) * (0.02 + 0.98 * (1 + math.cos(math.pi * done)) / 2)
        chosen = np.sort(order[step * batch : (step + 1) * batch])
        frames = inputs(name, train.counts[chosen], every, random)
        loss = F.mse_loss(network(frames), torch.from_numpy(train.force[chosen]))
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        total += loss.item()
        if (step + 1) % check == 0:
            error = validated(network, name, valid, every, 12 if every in (1, 2) and name == "force-convlstm" else 100)
            print(f"  {step + 1}/{steps}  loss {total / check:.4f}  valid {error:.4f}  {time.time() - started:.0f} s", flush=True)
            best, total = min(best, (error, copy.deepcopy(network.state_dict())), key=lambda item: item[0]), 0.0
    network.load_state_dict(best[1])


@torch.no_grad()
def validated(network, name, valid, every, most):
    """Mean squared error over all frames of at most `most` recordings for validation."""
    squares = []
    for first in range(0, min(len(valid), most), 4):
        chosen = slice(first, min(first + 4, most))
        found = network(inputs(name, valid.counts[chosen], every, None))
        squares.append(((found.numpy() - valid.force[chosen]) ** 2).ravel())
    return float(np.concatenate(squares).mean())


class AfterKernels(torch.nn.Module):
    """A network over what its kernels make of frames."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, features):
        return self.network.over(features)


@torch.no_grad()
def featured(network, recordings):
    """The recordings with what the kernels make of their frames instead of the counts."""
    frames = (torch.from_numpy(counts[None].astype(np.float32) / MAXIMUM) for counts in recordings.counts)
    return replace(recordings, counts=np.concatenate([network.features(frame).numpy() for frame in frames]))


def reduced(name, recordings):
    """The recordings with what the network reads of their counts, where that is less: totals, or means of 5 x 5 pixels."""
    counts = recordings.counts
    if name == "force-tdnn":
        counts = np.stack([each.sum((2, 3), dtype=np.float32) for each in counts])
    elif name == "force-lstm":
        blocks = [each.reshape(*each.shape[:2], PLACES, 5, PLACES, 5).mean((3, 5), dtype=np.float32) for each in counts]
        counts = np.stack(blocks)
    return replace(recordings, counts=counts)


def inputs(name, counts, every, random):
    """Frames of `counts` (recordings, frames, 2, rows, columns): of every so many pixels from a random one on, mirrored at random."""
    if name == "force-tdnn":
        return torch.from_numpy(counts / np.float32(MAXIMUM))
    if every == 0:
        return torch.from_numpy(counts)
    row, column = (0, 0) if random is None or every == 1 else random.integers(every, size=2)
    counts = counts[..., row::every, column::every]
    if random is not None:
        for axis in (3, 4):
            if random.random() < 0.5:
                counts = np.flip(counts, axis)
    return torch.from_numpy(counts.astype(np.float32) / MAXIMUM)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="FOLDER")
    parser.add_argument("--network", nargs="+", choices=NETWORKS, default=list(reversed(NETWORKS)), help="default: all")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--start", type=Path, help="weights to start from, with the last stage alone; default: drawn from the seed")
    parser.add_argument("--share", type=float, default=1.0, help="of each recipe's recordings; default: 1")
    parser.add_argument("--folds", type=int, default=0, help="parts of the test that are left out in turn; default: none")
    parser.add_argument("--quick", type=int, default=100, help="recordings of the last validation; default: 100")
    parser.add_argument("--out", type=Path, default=Path("models/weights/force"), help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
