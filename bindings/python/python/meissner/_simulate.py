"""Films of images: `Camera` takes their images one by one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ._errors import InputError
from ._meissner import SIMULATED_DTYPE, Camera


def film_images(images: Iterable[Any], t_us: Iterable[int], *, seed: int = 0, ideal: bool = False, **settings: Any) -> np.ndarray:
    """Events of a camera that sees grey images: `SIMULATED_DTYPE`, in order of time.

    `images` has shape (times, height, width), or yields one image after the other; values are shares of the light of a white surface.
    `t_us` are their times in microseconds, ascending. The other arguments are those of `Camera`. Fast motion needs many images: at
    most one pixel of motion from one image to the next.
    """
    camera, parts = None, []
    for image, at in zip(images, t_us, strict=True):
        image = np.asarray(image)
        if camera is None:
            if image.ndim != 2:
                raise InputError(f"images: expected shape (times, height, width), found images of shape {image.shape}")
            camera = Camera(image.shape[::-1], seed=seed, ideal=ideal, **settings)
        parts.append(camera.push(int(at), image))
    if camera is None:
        return np.zeros(0, SIMULATED_DTYPE)
    return np.concatenate([*parts, camera.finish()])
