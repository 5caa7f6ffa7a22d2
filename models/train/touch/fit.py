"""The values of the network: all but the last two layers follow from what they are to measure; these are linear classifiers.

A discriminant assumes that recordings differ from the mean of their class in the same way in every class. It weighs each
direction by how little it differs there (Fisher 1936, "The use of multiple measurements in taxonomic problems"); a share of
the covariance is replaced by a multiple of the identity (Friedman 1989, "Regularized discriminant analysis").

A classifier by margins looks at the recordings that are hard to tell apart alone (Crammer and Singer 2001, "On the algorithmic
implementation of multiclass kernel-based vector machines", here with squares of what a margin is too small by).
"""

import torch
import torch.nn.functional as F
from network import CHANNELS, CLOSED, KNOTS, LAGS, SHIFT, TIMES, WINDOWS

LARGEST = 16.0  # of the logits of the training
LEAST_SPREAD = 0.05  # of a value, as a share of the largest
STEPS = 100  # of the fit of margins


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
    for i, age in enumerate(network.ages):
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


def classify(network, group, features, label, share, shrinkage, margin=None):
    """Fits the classifier of age `group` to `features` (recordings, values) of the classes `label`, each with its `share`: a linear
    discriminant, or, where `margin` says how far margins are fitted, the sum of it and of a classifier by margins."""
    t, classes, ages = network.tensors, network.shapes["out.bias"][0], len(network.ages)
    values, share = features[:, :-ages].double(), share.double() / share.sum()
    mean = share @ values
    found = discriminant(values - mean, label, share, classes, shrinkage)
    if margin is not None:
        both = [found, margins(values - mean, label, share, classes, margin)]
        # Each counts as much as the other.
        sizes = [((values - mean) @ weight.T + bias).std() for weight, bias in both]
        found = [sum(part / size for part, size in zip(parts, sizes)) for parts in zip(*both)]
    weight, bias = found[0], found[1] - found[0] @ mean
    logits = values @ weight.T + bias
    scale = LARGEST / logits.abs().max()
    rows = slice(group * classes, (group + 1) * classes)
    t["experts.weight"][rows, :-ages] = (scale * weight).float()
    t["experts.bias"][rows] = (scale * bias).float() + SHIFT
    if group > 0:  # open from its age on
        t["experts.weight"][rows, group - 1 - ages] = CLOSED
        t["experts.bias"][rows] -= CLOSED
    if group < ages:  # until the next
        t["experts.weight"][rows, group - ages] = -CLOSED
    t["out.weight"][:, rows] = torch.eye(classes)
    t["out.bias"].fill_(-SHIFT)


def discriminant(values, label, share, classes, shrinkage):
    """Weights and biases of the linear discriminants of `values`, whose mean is 0."""
    # In the span of the recordings, whose dimension is smaller than that of the values.
    scaled = share.sqrt()[:, None] * values
    power, rotation = torch.linalg.eigh(scaled @ scaled.T)
    kept = power > 1e-6 * power.max()
    basis = scaled.T @ (rotation[:, kept] / power[kept].sqrt())
    inside = values @ basis
    of = [label == i for i in range(classes)]
    means = torch.stack([share[i] @ inside[i] / share[i].sum() for i in of])
    spread = inside - means[label]
    covariance = (share[:, None] * spread).T @ spread
    identity = torch.eye(len(covariance), dtype=torch.float64)
    covariance = (1 - shrinkage) * covariance + shrinkage * covariance.trace() / len(covariance) * identity
    inner = torch.linalg.solve(covariance, means.T)
    return (basis @ inner).T, -0.5 * (means.T * inner).sum(0)


def margins(values, label, share, classes, margin):
    """Weights and biases that leave margins between the right class and all others. A value that varies more counts for less than
    its size, by the root of its spread."""
    spread = (share @ values.square()).sqrt()
    factor = (spread + LEAST_SPREAD * spread.max()).rsqrt()
    factor = factor / (share @ (values * factor).square().sum(1)).sqrt()
    # In the span of the recordings.
    basis = torch.linalg.qr((values * factor).T)[0]
    inside = (values * factor) @ basis
    weight = torch.zeros(classes, basis.shape[1], dtype=torch.float64, requires_grad=True)
    bias = torch.zeros(classes, dtype=torch.float64, requires_grad=True)
    own = F.one_hot(label, classes).bool()
    optimiser = torch.optim.LBFGS([weight, bias], max_iter=STEPS, line_search_fn="strong_wolfe")

    def loss():
        optimiser.zero_grad()
        logits = inside @ weight.T + bias
        short = F.relu(1 + logits - logits[own][:, None]).square().masked_fill(own, 0)
        found = share @ short.sum(1) + weight.square().sum() / margin
        found.backward()
        return found

    optimiser.step(loss)
    return (weight.detach() @ basis.T) * factor, bias.detach()
