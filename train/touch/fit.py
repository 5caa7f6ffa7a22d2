"""The values of the network: all but the last two layers follow from what they are to measure; these are linear discriminants.

A discriminant assumes that recordings differ from the mean of their class in the same way in every class. It weighs each
direction by how little it differs there (Fisher 1936, "The use of multiple measurements in taxonomic problems"); a share of
the covariance is replaced by a multiple of the identity (Friedman 1989, "Regularized discriminant analysis").
"""

import torch
from network import AGES, CHANNELS, CLOSED, KNOTS, LAGS, SHIFT, TIMES, WINDOWS

LARGEST = 16.0  # of the logits of the training


def lay_out(network, lags, spikes):
    """Fills in every layer up to the sums and their bending, and the gates of the classifiers. In a sum, a spike has the weight
    `spikes`, and the lags of its neighbours `lags`."""
    t = network.tensors
    for value in t.values():
        value.zero_()
    # Rising spikes are (1, 0), falling ones (0, 1).
    t["sides.conv.lin.weight"][:, 0] = torch.tensor([0.5, -0.5])
    t["sides.conv.bias"].fill_(0.5)
    for sign in range(2):
        for lag in range(LAGS):
            t["lags.conv.weight"][lag, sign, sign * LAGS + lag] = 1
        t["lags.conv.lin.weight"][2 * LAGS + sign, sign] = 1
    ages = torch.arange(TIMES, dtype=torch.float32)
    centres = torch.linspace(0, TIMES - 1, WINDOWS)
    hats = (1 - (ages - centres[:, None]).abs() / (centres[1] - centres[0])).clamp(min=0)
    weight = torch.full((CHANNELS,), lags)
    weight[2 * LAGS :] = spikes
    # A cell lasts two bins.
    sums = 2 * hats[:, None, :, None] * torch.diag(weight)[None, :, None, :]
    t["sums.weight"].copy_(sums.reshape(t["sums.weight"].shape))
    count = WINDOWS * CHANNELS
    for i, knot in enumerate(KNOTS):
        t["steps.weight"][i * count : (i + 1) * count, :, 0, 0] = torch.eye(count)
        t["steps.bias"][i * count : (i + 1) * count] = -knot
    # Whether there is a spike as old as each of the ages: min(number, 1) = relu(number) - relu(number - 1).
    present = torch.zeros(TIMES, CHANNELS)
    present[:, 2 * LAGS :] = 1
    for i, age in enumerate(AGES):
        old = present.clone()
        old[:age] = 0
        t["old.weight"][i, :, 0, 0] = old.flatten()
        t["past.weight"][2 * i : 2 * i + 2, i] = 1
        t["past.bias"][2 * i + 1] = -1
        t["age.weight"][i, 2 * i : 2 * i + 2] = torch.tensor([1.0, -1.0])


def bend(curve):
    """The change of slope of the chords of `curve` at each knot."""
    ends = torch.tensor([*KNOTS, 8.0])
    slope = curve(ends).diff() / ends.diff()
    return torch.cat([slope[:1], slope.diff()])


def encode(network, curve, images):
    """The code of a cell: the principal components of its bent sums over the cells of `images` with a spike."""
    t, directions = network.tensors, network.shapes["code.weight"][0]
    count = WINDOWS * CHANNELS
    square = torch.zeros(count, count, dtype=torch.float64)
    slopes = bend(curve)
    for image in images:
        bent = network.bent(image).unflatten(1, (len(KNOTS), -1))
        cells = torch.einsum("k,bkcp->bpc", slopes, bent).flatten(0, 1).double()
        square += cells.T @ cells
    axes = torch.linalg.eigh(square).eigenvectors[:, -directions:].T.float()
    code = slopes[None, :, None] * axes[:, None, :]
    t["code.weight"].copy_(code.reshape(t["code.weight"].shape))


def discriminate(network, group, features, label, share, shrinkage):
    """Fits the classifier of age `group` to `features` (recordings, values) of the classes `label`, each with its `share`."""
    t, classes = network.tensors, network.shapes["out.bias"][0]
    values, share = features[:, : -len(AGES)].double(), share[:, None].double() / share.sum()
    mean = (share * values).sum(0)
    # In the span of the recordings, whose dimension is smaller than that of the values.
    scaled = share.sqrt() * (values - mean)
    power, rotation = torch.linalg.eigh(scaled @ scaled.T)
    kept = power > 1e-6 * power.max()
    basis = scaled.T @ (rotation[:, kept] / power[kept].sqrt())
    inside = (values - mean) @ basis
    of = [label == i for i in range(classes)]
    means = torch.stack([(share[i] * inside[i]).sum(0) / share[i].sum() for i in of])
    spread = inside - means[label]
    covariance = (share * spread).T @ spread
    identity = torch.eye(len(covariance), dtype=torch.float64)
    covariance = (1 - shrinkage) * covariance + shrinkage * covariance.trace() / len(covariance) * identity
    inner = torch.linalg.solve(covariance, means.T)
    weight = (basis @ inner).T
    bias = -0.5 * (means.T * inner).sum(0) - weight @ mean
    logits = values @ weight.T + bias
    scale = LARGEST / logits.abs().max()
    rows = slice(group * classes, (group + 1) * classes)
    t["experts.weight"][rows, : -len(AGES)] = (scale * weight).float()
    t["experts.bias"][rows] = (scale * bias).float() + SHIFT
    if group > 0:  # open from its age on
        t["experts.weight"][rows, -len(AGES) + group - 1] = CLOSED
        t["experts.bias"][rows] -= CLOSED
    if group < len(AGES):  # until the next
        t["experts.weight"][rows, group - len(AGES)] = -CLOSED
    t["out.weight"][:, rows] = torch.eye(classes)
    t["out.bias"].fill_(-SHIFT)
