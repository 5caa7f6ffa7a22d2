"""Trainings on presses in stages: the start of a stage, its data, and the metadata of its weights.

A stage is a dict: `films` and `valid`, patterns of folders with train.safetensors and valid.safetensors; `start`, the stages with whose
mean it begins (after a slash, a file in WORK), `blocks`, whether only with their layers of events; `stride`, the thinning for which its
weights are meant; `presses` or `readouts`, settings of `meissner.torch.Presses` or `Readouts`; `fit`, settings of `meissner.torch.fit`;
`dropout` of the input of the first dense layer; `cells`, the share of a readout's cells that are left out; `centre`, whether outputs
are moved so that their median difference on the presses for validation is 0; `unit` and `seed`.
"""

import numpy as np
import torch
from meissner import Weights
from meissner.torch import Module, Presses, Readouts, errors, fit, loss_of, save

DEFAULT = {"start": [], "blocks": False, "stride": 1, "presses": {}, "fit": {}, "dropout": 0.0, "cells": 0.0, "centre": False, "seed": 0}
# A sum over the events of a cell, times this and the stride, has the size of an event's features.
SHARE = 0.01


def run(network, stages, args, remarks, told=None, loss=loss_of, warm_up=None):
    """Runs the unfinished stages, to WORK/NETWORK.STAGE.safetensors, the last to OUT/NETWORK.SEED.safetensors. `told(film folder)` gives
    the additional targets beside the outputs; `warm_up(module, presses)` comes before stages that start from layers of events alone."""
    for name, stage in stages.items():
        path = args.work / f"{network}.{name}.safetensors"
        if name == list(stages)[-1]:
            path = args.out / f"{network}.{args.seed}.safetensors"
        if not path.exists():
            print(path.stem, flush=True)
            train(network, DEFAULT | stage, args, path, remarks, told, loss, warm_up)


def train(network, stage, args, path, remarks, told, loss, warm_up):
    module, readout, head = begun(network, stage, args)
    films, told = files(args.data, stage["films"], "train"), told and told(args.data)
    valid = {path.parent.name: path for path in files(args.data, stage.get("valid", stage["films"]), "valid")}
    settings = stage["fit"] | {"seed": stage["seed"] + args.seed, "device": args.device, "checkpoint": path.with_suffix(".state")}
    if args.quick:
        settings["epochs"] = min(settings["epochs"], 2)
    if "readouts" in stage:
        kept = {"folder": args.work / "readouts", "told": told}
        presses = Readouts(module, *films, **stage["readouts"], **kept)
        valid = {name: Readouts(module, path, **stage["readouts"] | {"ages": 1, "mirrors": ()}, **kept) for name, path in valid.items()}
        settings["learn"] = module.names(*head)
    else:
        presses = Presses(*films, **stage["presses"] | ({"limit": args.quick} if args.quick else {}), told=told)
        valid = {name: Presses(path, **stage["presses"]) for name, path in valid.items()}
    if warm_up and stage["blocks"]:
        warm_up(module, presses)

    def learn(module, given, target):
        if stage["cells"] and isinstance(given, dict):
            image = given[readout]
            left = torch.rand(len(image), 1, *image.shape[2:], device=image.device) >= stage["cells"]
            given = {readout: image * left / (1 - stage["cells"])}
        return loss(module, given, target)

    history = fit(module, presses, loss=learn, valid=valid, **settings) if settings["epochs"] else None
    if stage["centre"]:
        with torch.no_grad():
            found = np.concatenate([errors(module, each)[:, -1] for each in valid.values()])
            module[module.parts[module.last]["bias"]].sub_(torch.from_numpy(np.median(found, 0)).float() / module.unit)
    found = {name: np.abs(errors(module, each)).mean((0, 1)).round(5).tolist() for name, each in valid.items()}
    recipe = {key: value for key, value in stage.items() if value != DEFAULT.get(key)}
    said = {"seed": args.seed, "recipe": recipe, "presses": len(presses), "trained_on": "train", "stride": stage["stride"]}
    said |= {"valid": found, "sensor": list(presses.sensor)} | ({"loss": f"{history.losses[-1]:.5f}"} if history else {})
    save(module, path, said | remarks, half=True)
    path.with_suffix(".state").unlink(missing_ok=True)


def begun(network, stage, args):
    """The module that a stage begins with, its readout, and the layers behind that: drawn, or the mean of stages before."""
    module = Module(network, unit=stage["unit"])
    names = list(module.layers)
    readout = next((name for name in names if module.layers[name]["kind"] == "readout"), None)
    head = names[names.index(readout) + 1 if readout else 0 :]
    sums = readout and module.layers[readout]["aggregation"] == "sum"
    module.gain = {head[0]: SHARE * stage["stride"]} if sums else {}
    module.dropout = {next(name for name in head if module.layers[name]["kind"] == "dense"): stage["dropout"]}
    # A frame network is deep and has no norms: with smaller weights an image has hardly any effect at the end.
    module.draw(args.seed, he=not module.over_events)
    paths = [args.work / (f"{network}.{start}.safetensors" if start[0] != "/" else f"{start[1:]}.safetensors") for start in stage["start"]]
    if paths:
        begins, state = [Weights(path) for path in paths], module.state_dict()
        for name in module.names(*(names if not stage["blocks"] else module.up_to(readout))):
            # In double precision, so that layers that are the same in all files stay as they are.
            mean = torch.from_numpy(sum(each[name].astype(np.float64) for each in begins) / len(begins)).float()
            if sums and name == module.parts[head[0]]["weight"]:
                mean *= stage["stride"] / begins[0].card.stride  # sums of as many times fewer events
            state[name] = mean
        module.load(state)
    return module, readout, head


def files(data, patterns, part):
    """The files PART.safetensors in the folders of `data` that match some patterns, in the order of the patterns."""
    found = [path / f"{part}.safetensors" for pattern in patterns for path in ([data] if pattern == "." else sorted(data.glob(pattern)))]
    return list(dict.fromkeys(path for path in found if path.exists()))
