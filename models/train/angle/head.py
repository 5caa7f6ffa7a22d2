"""Trains a network on presses from a seed: what is behind its readout, or all of it.

    python models/train/angle/head.py /tmp/dome/on /tmp/dome/off --unit 0.1 --start models/weights/angle/tactigraph-past.0.safetensors --all

Each FOLDER has train.safetensors, the same presses filmed by different cameras, and that of the validation also valid.safetensors. The
layers of events are trained already; with `--events` they learn too. If the network has a dense layer `pins`, its first values are told how
the pins of a TacTip have moved, in principal modes, and the layers behind it what that says. These learn from the true motion first,
with noise; the tracks of the pins are beside the films, as `models/train/tactip/presses.py` writes them. Writes NETWORK.SEED.safetensors.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.torch import load_file

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import export_weights
import sums
from fit import DECAY, share
from graphs import inspected
from network import Network
from safetensors.numpy import load_file as load_arrays
from train import SHARE, mean_errors, remarks_of, written

BETA = 0.1  # error at which the loss becomes linear, in units
# Of the motion: the noise that the last layers learn with at first, in modes, and their steps.
NOISE, STEPS, PRESSES = 0.04, 6000, 64


def main():
    args = arguments()
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    random = np.random.default_rng(args.seed)
    args.said = inspected(args.meissner, args.network)
    args.unit = np.broadcast_to(args.unit, len(args.said["outputs"])).astype(np.float64)
    network = Network(args.said, args.unit, args.dropout, SHARE)
    begin(network, args)
    head = Head(network, args)
    modes = sums.Modes(load_arrays(args.valid[0] / "train.tracks.safetensors")) if head.told else None
    paths = [folder / "train.safetensors" for folder in args.data]
    train = sums.Films(paths, modes, network, args) if args.events else sums.Readings(paths, modes, network, args, args.mirrors)
    kind = sums.Films if args.events else sums.Readings
    valid = {folder.name: kind([folder / "valid.safetensors"], modes, network, args) for folder in args.valid}
    path = args.out / f"{args.said['name']}.{args.seed}.safetensors"
    args.out.mkdir(parents=True, exist_ok=True)
    if head.told:
        if not args.all:
            head.warm_up(train, args.rate)
        print("pins as they are:", head.errors(valid, of_pins=True), flush=True)
    loss = fit(head, train, valid, args, random, path.with_suffix(".state"))
    if args.centre:
        head.centre(valid)
    found = {name: [each] for name, each in head.errors(valid).items()}
    remarks = written(args, recipe(args), train, 1, loss, found, remarks_of(args.start[0]))
    export_weights.save(network.exported(), path, remarks)
    print(path, remarks["valid"])


def begin(network, args):
    """Loads the weights that the training starts from: the layers of events, or all."""
    files, fresh = [load_file(path) for path in args.start], network.exported()
    for name in files[0] if args.all else network.names(network.events):
        # In double precision, so that layers that are the same in all files stay as they are.
        started = (sum(file[name].double() for file in files) / len(files)).float()
        # A start whose layer `pins` had fewer values fills the corner of a fresh tensor.
        fresh[name][tuple(map(slice, started.shape))] = started
    network.load(fresh)


class Head:
    """The layers behind the readout: up to `pins`, or all where there is no such layer, and what reads them."""

    def __init__(self, network, settings):
        self.network, self.settings = network, settings
        names = [layer["name"] for layer in network.head]
        cut = 1 + names.index("pins") if "pins" in names else len(names)
        self.seen, self.told = network.head[:cut], network.head[cut:]

    def pins(self, x):
        """What the last of the layers up to `pins` says of some sums: the modes of the motion of the pins first, if it is `pins`."""
        left_out = self.settings.cells
        if self.network.training and left_out:
            x = x * (torch.rand(len(x), 1, *x.shape[2:]) >= left_out) / (1 - left_out)
        image = x.dim() == 4
        if image:
            x = x.contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=self.network.training and image):
            x = self.network.values(x, self.seen[:-1])
        return self.network.values(x.float(), self.seen[-1:])

    def parameters(self, layers):
        """The parameters of some layers."""
        return [each for layer in layers if layer["name"] in self.network.part for each in self.network.part[layer["name"]].parameters()]

    def warm_up(self, train, rate):
        """The layers behind `pins` learn from the motion of the pins, with noise."""
        pins = self.padded(torch.from_numpy(np.concatenate([read.reshape(-1, sums.MODES) for read in train.pins])))
        labels = torch.from_numpy(np.concatenate([read.reshape(-1, len(self.network.unit)) for read in train.labels])) / self.network.unit
        learnt = self.parameters(self.told)
        optimiser = torch.optim.AdamW(learnt, rate, weight_decay=DECAY)
        for step in range(STEPS):
            optimiser.param_groups[0]["lr"] = rate * share(step / STEPS)
            some = torch.randint(len(pins), (PRESSES,))
            found = self.network.values(pins[some] + NOISE * torch.randn(PRESSES, pins.shape[1]), self.told)
            optimise(optimiser, F.smooth_l1_loss(found, labels[some], beta=BETA), learnt)

    def padded(self, pins):
        """The motion of the pins as the layer `pins` gives it, 0 beyond."""
        return F.pad(pins, (0, self.seen[-1]["outputs"] - sums.MODES))

    def errors(self, valid, of_pins=False):
        """Mean absolute errors of all outputs at the ends of presses, for each folder."""
        return {name: mean_errors(self.settings, self.differences(each, of_pins)) for name, each in valid.items()}

    @torch.no_grad()
    def differences(self, valid, of_pins=False):
        """Outputs less labels (press, output) at the ends of presses, with the pins as they are or as the sums show them."""
        self.network.eval()
        found = []
        for x, labels, pins in valid.ends():
            pins = self.padded(torch.from_numpy(pins)) if of_pins else self.pins(x)
            found.append(self.network.values(pins, self.told).mul(self.network.unit).numpy() - labels)
        return np.concatenate(found)

    @torch.no_grad()
    def centre(self, valid):
        """Moves the outputs so that their median difference from the labels is 0."""
        last = self.network.part[[*self.seen, *self.told][-1]["name"]]
        found = np.concatenate([self.differences(each) for each in valid.values()])
        last.bias -= torch.from_numpy(np.median(found, 0)) / self.network.unit


def fit(head, train, valid, args, random, resume):
    """Trains `head`, and what it reads if that learns. `resume` is a file with the state, which is written after an epoch."""
    learnt = [*head.network.parameters()] if args.events else head.parameters([*head.seen, *head.told])
    optimiser = torch.optim.AdamW(learnt, args.rate, weight_decay=args.decay)
    unit, first, mean = head.network.unit, 0, float("nan")
    if resume.exists():
        state = torch.load(resume, weights_only=False)
        head.network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        random.bit_generator.state, first, mean = state["random"], state["epochs"], state["loss"]
    for epoch in range(first, args.epochs):
        started, losses = time.time(), []
        head.network.train()
        for done, x, labels, motion in train.epoch(random):
            optimiser.param_groups[0]["lr"] = args.rate * share((epoch + done) / args.epochs)
            pins = head.pins(x)
            found = head.network.values(pins, head.told)
            loss = F.smooth_l1_loss(found, torch.from_numpy(labels) / unit, beta=BETA)
            losses.append(loss.item())
            if head.told:
                moved = F.smooth_l1_loss(pins[:, : sums.MODES] * sums.UNIT, torch.from_numpy(motion) * sums.UNIT)
                loss = loss + args.pins * moved
            optimise(optimiser, loss, learnt)
        mean = np.mean(losses)
        said = f"  valid {head.errors(valid)}" if args.events or (epoch + 1) % 3 == 0 else ""
        print(f"epoch {epoch + 1:3}  loss {mean:.5f}  {time.time() - started:.1f} s{said}", flush=True)
        state = {"network": head.network.state_dict(), "optimiser": optimiser.state_dict()}
        torch.save(state | {"random": random.bit_generator.state, "epochs": epoch + 1, "loss": mean}, resume)
    return mean


def optimise(optimiser, loss, learnt):
    """A step down `loss`."""
    optimiser.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(learnt, 1.0)
    optimiser.step()


def recipe(args):
    """What was done, in one line."""
    layers = "all layers" if args.all else "layers of events"
    learnt = "all layers" if args.events else "what is behind the readout"
    start = f"{layers} from {' and '.join(path.name for path in args.start)}: {args.epochs} epochs of {learnt}"
    ages = f"{args.ages - 1} random ages" if args.events else f"one of {args.ages - 1} ages"
    mirrors = f", mirrored along {' and '.join(args.mirrors)}" if args.mirrors else ""
    readings = f"{len(args.data)} films{mirrors}, read at the end ({args.ends} of the readings) and at {ages}, batch {args.batch}"
    line = f"{start}, {readings}, AdamW {args.rate} on a cosine, decay {args.decay}, dropout {args.dropout} and {args.cells} of the cells"
    line = f"{line}, smooth L1, {args.pins} of the pins, outputs in units of {args.unit.tolist()}"
    return f"{line}, then moved so that the median difference on the validation presses is 0" if args.centre else line


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--network", default="tactigraph-past", help="name or description; default: %(default)s")
    parser.add_argument("--valid", type=Path, nargs="+", help="folders of the validation; default: the first")
    parser.add_argument("--start", type=Path, nargs="+", required=True, help="weights with the layers of events; of several, their mean")
    parser.add_argument("--all", action="store_true", help="start from all layers of these weights")
    parser.add_argument("--events", action="store_true", help="the layers of events learn too")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--epochs", type=int, default=60, help="default: 60")
    parser.add_argument("--ages", type=int, default=5, help="readings of a press; default: 5")
    parser.add_argument("--ends", type=float, default=0.5, help="share of the readings at the end of a press; default: 0.5")
    parser.add_argument("--mirrors", nargs="*", default=[], choices=["columns", "rows"], help="axes of symmetry; default: none")
    parser.add_argument("--rate", type=float, default=0.003, help="default: 0.003")
    parser.add_argument("--batch", type=int, default=32, help="presses of a step; default: 32")
    parser.add_argument("--dropout", type=float, default=0.0, help="of what the first dense layer reads; default: 0")
    parser.add_argument("--cells", type=float, default=0.0, help="share of the cells that are left out at random; default: 0")
    parser.add_argument("--decay", type=float, default=DECAY, help="of the weights; default: %(default)s")
    parser.add_argument("--unit", type=float, nargs="+", default=[1.0, 10.0, 10.0], help="of each output; default: 1 10 10")
    parser.add_argument("--centre", action="store_true", help="move the outputs to a median difference of 0 on the validation presses")
    parser.add_argument("--pins", type=float, default=0.05, help="weight of the motion of the pins, in pixels, in the loss; default: 0.05")
    parser.add_argument("--ranges", help="JSON: [low, high] of the labels of each output, in its unit; default: those of the weights to start from")
    parser.add_argument("--about", help="remark about the data; default: that of the weights to start from")
    parser.add_argument("--out", type=Path, default=Path("models/weights/angle"), help="default: %(default)s")
    parser.add_argument("--threads", type=int, default=1, help="default: 1")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    args = parser.parse_args()
    if args.events and not args.all:
        parser.error("--events: expected --all")
    if args.events and args.mirrors:
        parser.error("--mirrors: expected no --events")
    args.valid, args.folder = args.valid or args.data[:1], None
    return args


if __name__ == "__main__":
    main()
