"""Linear classifiers of values of recordings, one for each age of a contact.

A discriminant assumes that recordings differ from the mean of their class in the same way in every class (Fisher 1936, "The use of multiple
measurements in taxonomic problems"); a multiple of the identity replaces a share of the covariance (Friedman 1989, "Regularized
discriminant analysis"). A classifier by margins depends only on the recordings that are hard to distinguish (Crammer and Singer 2001, "On
the algorithmic implementation of multiclass kernel-based vector machines", here with squares of the missing part of a margin).
"""

import torch
import torch.nn.functional as F

SHIFT, CLOSED, LARGEST = 32.0, 128.0, 16.0  # logits are above -SHIFT; a classifier for another age is closed; the largest logit
LEAST_SPREAD, STEPS = 0.05, 100  # of a value, as a share of the largest; of the fit of margins


def classify(module, group, ages, features, label, share, recipe, margin):
    """Fits the classifier of age `group` to `features` (recordings, values) of the classes `label`, each with its `share`: a linear
    discriminant or, with `margin`, the strength of the fit of margins, the sum of it and of a classifier by margins."""
    classes, found = len(module["out.bias"]), features[:, :-ages].double()
    share = share.double() / share.sum()
    mean = share @ found
    parts = [discriminant(found - mean, label, share, classes, recipe["shrinkage"])]
    if margin is not None:
        parts.append(margins(found - mean, label, share, classes, margin))
        # Each counts as much as the other.
        sizes = [((found - mean) @ weight.T + bias).std() for weight, bias in parts]
        parts = [[sum(part / size for part, size in zip(both, sizes)) for both in zip(*parts)]]
    weight, bias = parts[0][0], parts[0][1] - parts[0][0] @ mean
    scale, rows = LARGEST / (found @ weight.T + bias).abs().max(), slice(group * classes, (group + 1) * classes)
    experts, biases = module["experts.weight"], module["experts.bias"]
    experts[rows, :-ages] = (scale * weight).float()
    biases[rows] = (scale * bias).float() + SHIFT - (CLOSED if group else 0)
    if group > 0:  # open from its age on
        experts[rows, group - 1 - ages] = CLOSED
    if group < ages:  # until the next
        experts[rows, group - ages] = -CLOSED
    module["out.weight"][:, rows] = torch.eye(classes)
    module["out.bias"].fill_(-SHIFT)


def discriminant(values, label, share, classes, shrinkage):
    """Weights and biases of the linear discriminants of `values`, whose mean is 0."""
    # Computed in the span of the recordings, whose dimension is smaller than that of the values.
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


@torch.enable_grad()
def margins(values, label, share, classes, margin):
    """Weights and biases that leave margins between the right class and all others. A value with more variation counts less than
    its size, by the root of its spread."""
    spread = (share @ values.square()).sqrt()
    factor = (spread + LEAST_SPREAD * spread.max()).rsqrt()
    factor = factor / (share @ (values * factor).square().sum(1)).sqrt()
    # Computed in the span of the recordings.
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
