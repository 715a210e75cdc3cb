"""What moves along with the camera: the bonnet, a frame's black margins, a date drawn into the picture. It tells of no motion."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from hippodrome.core.types import Float32Array
from hippodrome.core.views.egomotion.tracks import Grey

CELL_PX: Final = 6  # pixels of a cell, each side
MEMORY: Final = 40.0  # pairs of frames that the averages reach back
LEAST_PAIRS: Final = 4.0  # pairs of frames before anything is taken to stand
STILL_PX: Final = 0.15  # change of grey over slope of grey, that is about the pixels moved, below which a cell stands
PLAIN: Final = 1.0  # slope, grey levels a pixel, below which a cell says nothing


class StaticMap:
    """Averages, per cell of the frame, how much it changes while the rest moves."""

    def __init__(self, image: Grey) -> None:
        self._size = max(1, image.shape[1] // CELL_PX), max(1, image.shape[0] // CELL_PX)
        self._change = np.zeros(self._size[::-1], np.float32)
        self._slope = np.zeros(self._size[::-1], np.float32)
        self._pairs = 0.0
        self.mask: Grey = np.zeros(image.shape, np.uint8)  # 255 where the picture stands

    def learn(self, before: Grey, after: Grey) -> None:
        """Take in two frames between which the vehicle moved."""
        self._pairs = min(self._pairs + 1.0, MEMORY)
        self._change += (self._small(cv2.absdiff(before, after)) - self._change) / self._pairs
        across, down = (cv2.Sobel(before, cv2.CV_16S, axis, 1 - axis, ksize=3, scale=1) for axis in (1, 0))
        slope = cv2.addWeighted(cv2.convertScaleAbs(across, alpha=0.125), 1.0, cv2.convertScaleAbs(down, alpha=0.125), 1.0, 0.0)
        self._slope += (self._small(slope) - self._slope) / self._pairs
        if self._pairs >= LEAST_PAIRS:
            stands = (self._change < STILL_PX * self._slope) & (self._slope > PLAIN)
            wide = cv2.dilate(stands.astype(np.uint8) * 255, np.ones((3, 3), np.uint8))
            self.mask = cv2.resize(wide, self.mask.shape[::-1], interpolation=cv2.INTER_NEAREST)

    def _small(self, values: Grey) -> Float32Array:
        small: Float32Array = cv2.resize(values, self._size, interpolation=cv2.INTER_AREA).astype(np.float32)
        return small
