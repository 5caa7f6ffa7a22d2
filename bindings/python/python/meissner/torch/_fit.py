"""The training loop."""

from __future__ import annotations

import contextlib
import json
import math
import os
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

from .. import InputError
from ._presses import errors


@dataclass
class History:
    """The course of a training: the mean loss of each epoch, and the error of each validation, by epoch."""

    losses: list[float] = field(default_factory=list)
    valid: dict[int, float] = field(default_factory=dict)
    best: int | None = None
    """The epoch whose weights are kept, with `keep="best"`."""


def constant(_):
    """A constant rate."""
    return 1.0


def cosine(done, rise=0.05, low=0.01):
    """The factor of the rate when the share `done` of the training is over: it rises, then falls as a cosine to almost 0."""
    if done < rise:
        return 0.1 + 0.9 * done / rise
    return low + (1 - low) * (1 + math.cos(math.pi * (done - rise) / (1 - rise))) / 2


def loss_of(module, given, target):
    """Smooth L1 in units of the outputs, linear from an error of 0.1; for classes cross-entropy."""
    if target.dtype == torch.int64:
        return F.cross_entropy(module(given), target)
    return F.smooth_l1_loss(module(given) / module.unit, target / module.unit, beta=0.1)


def fit(
    module, presses, *, epochs, rate=0.003, decay=0.001, optimiser=torch.optim.AdamW, schedule=cosine, clip=1.0, loss=loss_of,
    valid=None, check=5, keep="last", statistics=None, patience=None, learn=None, seed=0, device=None, precision=None, checkpoint=None,
    log=print,
):  # fmt: skip
    """Trains all layers of `module` in place, or the parameters whose names begin with one of `learn`. Returns a `History`.

    `presses` is a `Presses`, `Readouts`, or any object whose `epoch(module, random)` yields (done share of the epoch, given, target), the
    last two for `loss(module, given, target)`. `valid` gives an error every `check` epochs and at the end: a `Presses` or `Readouts`, or a
    dict of some, by its mean error in units of the outputs (or share of wrong classes), or a function of the module that returns an error,
    or an error and a text. `keep` selects the weights that are kept: those of the "last" epoch, of the "best" validation, or the "mean"
    over the second half of all epochs. For the mean, the statistics of batch norm are gathered again from `statistics`, by default
    `presses`. The training ends after `patience` validations without a better one. `schedule` maps the done share of the training to a
    factor of the rate, `clip` is the maximum norm of a gradient (None: no limit). `device` is that of PyTorch, by default the module's;
    `precision` is a type for autocast. `checkpoint` is a file that is written after each epoch: an interrupted training continues from it
    as if it had not been interrupted. It must be the same training.

    A training depends on `seed`, and on the processor and the version of PyTorch. Raises `InputError`, and `KeyboardInterrupt` after
    Ctrl-C; the checkpoint of the last epoch then stays."""
    if keep not in ("last", "best", "mean") or (valid is None and (keep == "best" or patience)):
        raise InputError(f'keep: expected "last", "mean", or with `valid` "best", found {keep!r}')
    torch.manual_seed(seed)
    random, history, score = np.random.default_rng(seed), History(), _score(valid)
    if device:
        module.to(device)
    device = next(module.parameters()).device
    learnt = [p for name, p in module.named_parameters() if learn is None or name.startswith(tuple(learn))]
    if not learnt:
        raise InputError(f"learn: expected the beginning of names of parameters, found {learn!r}")
    steps = optimiser(learnt, rate, weight_decay=decay)
    first, kept, count = 0, None, 0
    if checkpoint and Path(checkpoint).exists():
        state = torch.load(checkpoint, map_location=device, weights_only=True)
        said = json.loads(state["said"])
        if [tensor.shape for tensor in state["tensors"]] != [tensor.shape for tensor in _tensors(module)] or said["seed"] != seed:
            raise InputError(f"checkpoint {checkpoint}: expected one of this training, found one of another module or seed")
        _restore(module, state["tensors"])
        steps.load_state_dict({"state": state["moments"], "param_groups": said["groups"]})
        random.bit_generator.state, first, kept, count = said["random"], said["epochs"], state["kept"], said["count"]
        torch.set_rng_state(state["torch"].cpu())
        if state["cuda"] is not None and device.type == "cuda":
            torch.cuda.set_rng_state(state["cuda"].cpu(), device)
        history = History(said["losses"], {int(epoch): error for epoch, error in said["valid"].items()}, said["best"])
    for epoch in range(first, epochs):
        if patience and history.valid and len([e for e in history.valid if e > history.best]) >= patience:
            break
        started, total, seen = time.time(), 0.0, 0
        module.train()
        for done, given, target in presses.epoch(module, random):
            for group in steps.param_groups:
                group["lr"] = rate * schedule((epoch + done) / epochs)
            with _autocast(device, precision):
                found = loss(module, _to(given, device), target.to(device))
            if not math.isfinite(found.item()):
                raise InputError(f"epoch {epoch + 1}: expected a finite loss, found {found.item()}: a lower rate may help")
            steps.zero_grad()
            found.backward()
            if clip:
                torch.nn.utils.clip_grad_norm_(learnt, clip)
            steps.step()
            total, seen = total + found.item() * len(target), seen + len(target)
        if not seen:
            raise InputError("presses: expected some, found none")
        history.losses.append(total / seen)
        line = f"epoch {epoch + 1:3}  loss {total / seen:.5f}  {time.time() - started:.1f} s"
        if score and ((epoch + 1) % check == 0 or epoch + 1 == epochs):
            module.eval()
            history.valid[epoch + 1], text = score(module)
            line += f"  valid {text}"
            if history.best is None or history.valid[epoch + 1] < history.valid[history.best]:
                history.best = epoch + 1
                kept = _tensors(module) if keep == "best" else kept
        if keep == "mean" and epoch >= epochs // 2:
            count += 1
            now = _tensors(module)
            kept = now if kept is None else [old + (new - old) / count if new.is_floating_point() else new for old, new in zip(kept, now)]
        log(line)
        if checkpoint:
            said = {"groups": steps.state_dict()["param_groups"], "random": random.bit_generator.state, "epochs": epoch + 1, "count": count}
            said |= {"losses": history.losses, "valid": history.valid, "best": history.best, "seed": seed}
            state = {"tensors": _tensors(module), "kept": kept, "moments": steps.state_dict()["state"], "torch": torch.get_rng_state()}
            state |= {"said": json.dumps(said), "cuda": torch.cuda.get_rng_state(device) if device.type == "cuda" else None}
            part = Path(f"{checkpoint}.part")
            part.parent.mkdir(parents=True, exist_ok=True)
            torch.save(state, part)
            os.replace(part, checkpoint)
    if kept is not None:
        _restore(module, kept)
    if keep == "mean":
        gather_statistics(module, statistics or presses, random, device, loss)
    module.eval()
    return history


@torch.no_grad()
def gather_statistics(module, presses, random, device="cpu", loss=loss_of):
    """Sets means and variances of batch norm to their plain means over the batches of an epoch; `loss` runs the module, without dropout."""
    dropout, module.dropout, module.batches = module.dropout, {}, 0
    if any(name.endswith("running_mean") for name, _ in module.named_buffers()):
        module.train()
        for _, given, target in presses.epoch(module, random):
            module.batches += 1
            loss(module, _to(given, device), target.to(device))
    module.dropout, module.batches = dropout, None
    module.eval()


def _score(valid):
    if valid is None or callable(valid):
        return valid and (lambda module: found if isinstance(found := valid(module), tuple) else (found, f"{found:.5f}"))
    parts = valid if isinstance(valid, dict) else {"": valid}

    def score(module):
        means, texts = [], []
        for name, presses in parts.items():
            found = np.abs(errors(module, presses)).mean((0, 1))
            if module.description.classes is None:
                named = zip(module.said["outputs"], found, module.said["units"])
                texts.append(f"{name} {', '.join(f'{output} {error:.4g} {unit}' for output, error, unit in named)}")
                found = found / module.unit.cpu().numpy()
            else:
                texts.append(f"{name} {100 * (1 - found[0]):.1f} % right")
            means.append(float(found.mean()))
        return float(np.mean(means)), "; ".join(texts).strip()

    return score


def _to(given, device):
    return {name: value.to(device) for name, value in given.items()} if isinstance(given, dict) else given.to(device)


def _autocast(device, precision):
    return torch.autocast(device.type, precision) if precision else contextlib.nullcontext()


def _tensors(module):
    """Copies of all parameters and statistics, in the units of the training."""
    return [tensor.detach().clone() for tensor in (*module.parameters(), *module.buffers())]


@torch.no_grad()
def _restore(module, tensors):
    for tensor, value in zip((*module.parameters(), *module.buffers()), tensors):
        tensor.copy_(value)
