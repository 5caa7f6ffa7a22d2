"""The lights of a GelSight-like sensor, fitted to pictures of balls pressed on it.

    python lights.py BALLS.npz [--out lights.json] [--pictures FOLDER] [--test TEST.npz]

BALLS.npz has `background` (height, width, 3) in grey levels, `difference` (n, height, width, 3), a picture minus the background, and
`circle` (n, 3), the middle and the radius of the contact in pixels, marked by hand. 20 pictures, drawn by a fixed seed, are fitted; the
others are the test.

The surface is an elastic half-space under a ball (Johnson 1985, Eq. 3.42a for the outside, scaled to the slope of the ball at its rim).
Each light has a position, a colour and a width: its part of a pixel is its colour over the squared distance, times the cosine c between
normal and light, smoothed to (c + sqrt(c^2 + width^2)) / 2, since a wide light sets little by little. The sum and an even light become
grey levels by a power. Between a picture and the background the light of the whole sensor drifts: a quadratic in the position, the same
in all pictures, absorbs that, and is not a part of the model.
"""

import argparse
import json
import pathlib

import numpy as np
from scipy.optimize import least_squares

LIGHTS = 3
FITTED = 20
UNIT = 100.0  # pixels, of the positions of lights
# Ball radius, gamma, even light (3), width of the lights, then position (3) and colour (3) of each light.
START = [30.0, 2.0, *[0.2] * 3, 0.1, -3, 0.8, 0.7, 8, 1, 1, 0.6, 5, 0.7, 1, 8, 1, 0.6, -3, 0.7, 1, 1, 8]
LOW = [24.0, 1.0, *[0] * 3, 0, *[-8, -8, 0.05, 0, 0, 0] * LIGHTS]
HIGH = [90.0, 8.0, *[4] * 3, 2, *[8, 8, 8, 200, 200, 200] * LIGHTS]


def slope(away, contact, ball):
    """The slope of the surface at distances `away` from the middle of a contact, in pixels per pixel; it falls outwards."""
    inside = away / np.sqrt(np.maximum(ball**2 - away**2, 1e-3 * ball**2))
    ratio = contact / np.maximum(away, contact)
    outside = 2 * (away * np.arcsin(ratio) - contact * np.sqrt(1 - ratio**2)) / (np.pi * contact)
    return np.where(away < contact, inside, outside * contact / np.sqrt(ball**2 - contact**2))


def lit(settings, slopes, x, y):
    """Grey levels (n, 3) where the surface has the slopes (2, n) at columns x and rows y."""
    _, gamma, *even, wide = settings[:6]
    light = np.tile(even, (len(x), 1))
    length = np.sqrt(1 + (slopes**2).sum(0))
    for place, colour in np.reshape(settings[6:], (LIGHTS, 2, 3)):
        to = np.stack([place[0] * UNIT - x, place[1] * UNIT - y, np.full(len(x), place[2] * UNIT)])
        distance = np.sqrt((to**2).sum(0))
        cosine = (to[2] - (slopes * to[:2]).sum(0)) / (length * distance)
        part = (cosine + np.sqrt(cosine**2 + wide**2)) / 2
        light += (part * (UNIT / distance) ** 2)[:, None] * colour
    return 255 * light ** (1 / gamma)


def picture(settings, circle, x, y):
    """The difference (n, 3) from the flat gel's picture for a contact with this circle."""
    offset = np.stack([x - circle[0], y - circle[1]])
    away = np.maximum(np.hypot(*offset), 1e-6)
    slopes = -slope(away, circle[2], settings[0]) * offset / away
    return lit(settings, slopes, x, y) - lit(settings, 0 * slopes, x, y)


def drift(x, y, size):
    """Quadratics (n, 6) in the position."""
    u, v = 2 * x / size[1] - 1, 2 * y / size[0] - 1
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], 1)


def parts(pictures):
    """The indices of the fitted pictures, and of the test pictures."""
    order = np.random.default_rng(0).permutation(pictures)
    return order[:FITTED], order[FITTED:]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("balls", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--pictures", type=pathlib.Path, help="a folder for real and fitted pictures side by side")
    parser.add_argument("--test", type=pathlib.Path, help="a file for the pictures of the test; nothing is fitted then")
    arguments = parser.parse_args()
    with np.load(arguments.balls) as file:
        background, difference, circle = (file[name].astype(float) for name in ("background", "difference", "circle"))
    size = difference.shape[1:3]
    flat = background.reshape(-1, 3)[::7]
    row, column = (grid.ravel().astype(float) for grid in np.mgrid[: size[0], : size[1]])
    train, test = parts(len(circle))
    if arguments.test:
        chosen = {"background": "u1", "difference": "i2", "circle": "f8"}
        test_only = (background, difference[test], circle[test])
        np.savez(arguments.test, **{name: value.astype(chosen[name]) for name, value in zip(chosen, test_only)})
        return

    def sample(i):
        """Every fourth pixel in both directions, and every second one around the contact."""
        near = np.hypot(column - circle[i, 0], row - circle[i, 1]) < 1.6 * circle[i, 2]
        chosen = np.where(near, (column + row) % 2 == 0, (column % 4 == 0) & (row % 4 == 0))
        return column[chosen], row[chosen], difference[i].reshape(-1, 3)[chosen]

    samples = {i: sample(i) for i in train}
    settings_end = len(START)

    def residual(values):
        settings, shift = values[:settings_end], values[settings_end:].reshape(6, 3)
        parts = [picture(settings, circle[i], x, y) + drift(x, y, size) @ shift - seen for i, (x, y, seen) in samples.items()]
        parts.append(lit(settings, np.zeros((2, len(flat))), column[::7], row[::7]) - flat)
        return np.concatenate(parts).ravel()

    free = np.full(18, 100.0)
    fit = least_squares(
        residual, [*START, *np.zeros(18)], bounds=([*LOW, *-free], [*HIGH, *free]), loss="soft_l1", f_scale=8, max_nfev=100
    )
    settings, shift = fit.x[:settings_end], fit.x[settings_end:].reshape(6, 3)

    def error(pictures):
        """Root mean squares in grey levels: nothing fitted, without and with the drift, and also with an offset of each picture."""
        found = []
        for i in pictures:
            seen = difference[i].reshape(-1, 3)
            model = seen - picture(settings, circle[i], column, row)
            drifted = model - drift(column, row, size) @ shift
            found.append([(part**2).mean() for part in (seen, model, drifted, drifted - drifted.mean(0))])
        return np.sqrt(np.mean(found, 0)).round(2).tolist()

    result = {
        "rms_flat": float(np.sqrt(((lit(settings, np.zeros((2, len(flat))), column[::7], row[::7]) - flat) ** 2).mean())),
        "ball_pixels": settings[0],
        "gamma": settings[1],
        "even": settings[2:5].tolist(),
        "wide": settings[5],
        "lights": [
            {"place_pixels": (UNIT * place).tolist(), "colour": colour.tolist()}
            for place, colour in settings[6:].reshape(LIGHTS, 2, 3)
        ],
        "rms_fitted": error(train),
        "rms_test": error(test),
    }
    print(json.dumps(result, indent=1))
    if arguments.out:
        arguments.out.write_text(json.dumps(result) + "\n")
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
        for i in test:
            model = picture(settings, circle[i], column, row) + drift(column, row, size) @ shift
            pair = np.concatenate([difference[i], model.reshape(difference[i].shape)], 1)
            header = f"P6 {pair.shape[1]} {pair.shape[0]} 255\n".encode()
            (arguments.pictures / f"{i:02}.ppm").write_bytes(header + np.clip(pair + 128, 0, 255).astype("u1").tobytes())


if __name__ == "__main__":
    main()
