"""Trains what is behind the readout of a network on presses, from a seed, with layers of events that are trained already.

    python train/tactip/head.py /tmp/shear/0 /tmp/shear/1 --network tactip-shear --start models/weights/angle/tactip-past.0.safetensors

Each FOLDER has train.safetensors, with the tracks of the pins beside it, and the first valid.safetensors too, as `presses.py` writes them.
The network has a dense layer `pins`: it is told how the pins have moved, in principal modes, and the layers behind it what that says.
These learn from the true motion first, with noise. Writes NETWORK.SEED.safetensors.
"""

import argparse
import datetime
import json
import sys
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.torch import load_file

# Both lie beside this folder.
sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "angle"), str(Path(__file__).resolve().parents[1])]
import export_weights
import sums
from fit import DECAY, share
from graphs import inspected
from network import Network
from safetensors.numpy import load_file as load_arrays
from train import SHARE

ABOUT = "trained on presses of a real TacTip with a sideways move, whose camera is modelled (data of no stated licence)"
UNIT = 1.0, 10.0, 10.0  # of the outputs, in mm and degrees
BETA = 0.1  # error at which the loss becomes linear, in units
# Of the motion: the noise that the last layers learn with at first, in modes, and their steps.
NOISE, STEPS, PRESSES = 0.04, 6000, 64


def main():
    args = arguments()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    random = np.random.default_rng(args.seed)
    args.said = inspected(args.meissner, args.network)
    network = Network(args.said, UNIT, args.dropout, SHARE)
    names = {name for layer in network.events for name in network.tensors.get(layer["name"], [])}
    files = [load_file(path) for path in args.start]
    started = {name: sum(file[name].float() for file in files) / len(files) for name in files[0]}
    network.load(network.exported() | {name: started[name] for name in (names if not args.all else started)})
    modes = sums.Modes(load_arrays(args.valid / "train.tracks.safetensors"))
    train = [sums.read(folder / "train.safetensors", modes, network, args) for folder in args.data]
    valid = sums.read(args.valid / "valid.safetensors", modes, network, args)
    path = args.out / f"{args.said['name']}.{args.seed}.safetensors"
    args.out.mkdir(parents=True, exist_ok=True)
    head = Head(network)
    if not args.all:
        head.warm_up(train, args.rate)
    print("pins as they are:", head.errors(valid, of_pins=True), flush=True)
    loss = fit(head, train, valid, args, random, path.with_suffix(".state"))
    found = head.errors(valid)
    remarks = {
        "network": args.said["name"],
        "seed": args.seed,
        "date": datetime.date.today().isoformat(),
        "about": ABOUT,
        "recipe": recipe(args),
        "presses": len(train[0]),
        "trained_on": "train",
        "stride": 1,
        "sensor": json.dumps(train[0].sensor),
        "preparation": args.said["preparation"],
        "licence": "the data of the training states none",
        "valid": json.dumps({args.valid.name: [found]}),
    }
    if args.epochs:
        remarks["loss"] = f"{loss:.5f}"
    export_weights.save(network.exported(), path, remarks)
    print(path, remarks["valid"])


class Head:
    """The layers behind the readout: up to `pins`, and what reads them."""

    def __init__(self, network):
        self.network = network
        cut = 1 + [layer["name"] for layer in network.head].index("pins")
        self.seen, self.told = network.head[:cut], network.head[cut:]

    def pins(self, read, press, age):
        """The modes of the motion of the pins that some readings show."""
        x = torch.from_numpy(read.sums[press, age].astype(np.float32)).contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=self.network.training):
            x = self.network.values(x, self.seen[:-1])
        return self.network.values(x.float(), self.seen[-1:])

    def parameters(self, layers):
        """The parameters of some layers."""
        return [each for layer in layers if layer["name"] in self.network.part for each in self.network.part[layer["name"]].parameters()]

    def warm_up(self, train, rate):
        """The layers behind `pins` learn from the motion of the pins, with noise."""
        pins = torch.from_numpy(np.concatenate([read.pins.reshape(-1, sums.MODES) for read in train]))
        labels = torch.from_numpy(np.concatenate([read.labels.reshape(-1, len(UNIT)) for read in train])) / torch.tensor(UNIT)
        learnt = self.parameters(self.told)
        optimiser = torch.optim.AdamW(learnt, rate, weight_decay=DECAY)
        for step in range(STEPS):
            optimiser.param_groups[0]["lr"] = rate * share(step / STEPS)
            some = torch.randint(len(pins), (PRESSES,))
            found = self.network.values(pins[some] + NOISE * torch.randn(PRESSES, sums.MODES), self.told)
            optimise(optimiser, F.smooth_l1_loss(found, labels[some], beta=BETA), learnt)

    @torch.no_grad()
    def errors(self, read, of_pins=False):
        """Mean absolute error of each output at the ends of presses, with the pins as they are or as the readings show them."""
        self.network.eval()
        ends = [slice(first, first + 100) for first in range(0, len(read), 100)]
        pins = torch.from_numpy(read.pins[:, 0]) if of_pins else torch.cat([self.pins(read, some, 0) for some in ends])
        found = self.network.values(pins, self.told).numpy() * np.float32(UNIT)
        return np.abs(found - read.labels[:, 0]).mean(0).astype(float).round(3).tolist()


def fit(head, train, valid, args, random, resume):
    """Trains `head` on readings of films of the same presses. `resume` is a file with the state, which is written after an epoch."""
    learnt = head.parameters([*head.seen, *head.told])
    optimiser = torch.optim.AdamW(learnt, args.rate, weight_decay=DECAY)
    films, presses, ages = len(train), len(train[0]), train[0].labels.shape[1]
    unit, first, mean = torch.tensor(UNIT), 0, [float("nan")]
    if resume.exists():
        state = torch.load(resume, weights_only=False)
        head.network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        random.bit_generator.state, first, mean = state["random"], state["epochs"], state["loss"]
    for epoch in range(first, args.epochs):
        started, losses = time.time(), []
        head.network.train()
        order = random.permutation(films * presses)
        # A step reads one film, so that its readings are one array.
        steps = [some for film in range(films) for some in np.array_split(order[order // presses == film], presses // args.batch)]
        for step in random.permutation(len(steps)):
            optimiser.param_groups[0]["lr"] = args.rate * share((epoch + len(losses) / len(steps)) / args.epochs)
            read, press = train[steps[step][0] // presses], steps[step] % presses
            age = np.where(random.random(len(press)) < 0.5, 0, random.integers(1, ages, len(press)))
            pins = head.pins(read, press, age)
            found = head.network.values(pins, head.told)
            loss = F.smooth_l1_loss(found, torch.from_numpy(read.labels[press, age]) / unit, beta=BETA)
            moved = F.smooth_l1_loss(pins * sums.UNIT, torch.from_numpy(read.pins[press, age]) * sums.UNIT)
            optimise(optimiser, loss + args.pins * moved, learnt)
            losses.append((loss.item(), moved.item()))
        mean = np.mean(losses, 0)
        said = f"  valid {head.errors(valid)}" if (epoch + 1) % 3 == 0 else ""
        print(f"epoch {epoch + 1:3}  loss {mean.round(5)}  {time.time() - started:.1f} s{said}", flush=True)
        state = {"network": head.network.state_dict(), "optimiser": optimiser.state_dict()}
        torch.save(state | {"random": random.bit_generator.state, "epochs": epoch + 1, "loss": mean}, resume)
    return mean[0]


def optimise(optimiser, loss, learnt):
    """A step down `loss`."""
    optimiser.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(learnt, 1.0)
    optimiser.step()


def recipe(args):
    """What was done, in one line."""
    layers = "all layers" if args.all else "layers of events"
    begin = f"{layers} from {' and '.join(path.name for path in args.start)}: {args.epochs} epochs of what is behind the readout"
    readings = f"{len(args.data)} films, read at the end and at one of {args.ages - 1} ages, batch {args.batch}"
    return f"{begin}, {readings}, AdamW {args.rate} on a cosine, decay {DECAY}, dropout {args.dropout}, smooth L1, {args.pins} of the pins"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--network", default="tactip-shear", help="name or description; default: %(default)s")
    parser.add_argument("--valid", type=Path, help="folder of the validation and of the modes of the pins; default: the first")
    parser.add_argument("--start", type=Path, nargs="+", required=True, help="weights with the layers of events; of several, their mean")
    parser.add_argument("--all", action="store_true", help="start from all layers of these weights")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--epochs", type=int, default=60, help="default: 60")
    parser.add_argument("--ages", type=int, default=5, help="readings of a press; default: 5")
    parser.add_argument("--rate", type=float, default=0.003, help="default: 0.003")
    parser.add_argument("--batch", type=int, default=32, help="presses of a step; default: 32")
    parser.add_argument("--dropout", type=float, default=0.0, help="of what the layer `pins` reads; default: 0")
    parser.add_argument("--pins", type=float, default=0.05, help="weight of the motion of the pins, in pixels, in the loss; default: 0.05")
    parser.add_argument("--out", type=Path, default=Path("models/weights/angle"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    args = parser.parse_args()
    args.valid = args.valid or args.data[0]
    return args


if __name__ == "__main__":
    main()
