"""A synthetic street front, shared by the tests of descriptors and of their scores."""

import numpy as np


def panorama(seed, width=4000):
    """A skyline of boxes, 120 px high: structure at the scale of buildings."""
    rng = np.random.default_rng(seed)
    image = np.full((120, width), 200, dtype=np.uint8)
    x = 0
    while x < width:
        step = int(rng.integers(6, 30))
        image[int(rng.integers(20, 80)) : 90, x : x + step] = rng.integers(30, 230)
        x += step
    return image
