"""A VLAD descriptor of views, for place recognition alone; its visual words are learned on other towns' recordings.

hippodrome render scenarios/towns/rural.yaml --out out/words
hippodrome eval my-town.yaml --out out/vlad      # with this in my-town.yaml:

    methods:
      VLAD:
        class: examples.methods.vlad:Vlad
        config: {learn_on: [out/words/recordings/rural-mapping-0123456789abcdef]}
"""

from pathlib import Path

import cv2
import numpy as np
from pydantic import BaseModel

from examples.methods.learning import frames_to_learn_on


class Vlad:
    """Jégou et al. 2010: residuals of local descriptors to their nearest words, summed and normalised."""

    class Config(BaseModel):
        """Where the words are from, and how many there are."""

        learn_on: list[Path]
        words: int = 16
        frames: int = 200

    def __init__(self, config):
        self.sift = cv2.SIFT_create(200)
        views = frames_to_learn_on(config.learn_on, config.frames)
        found = np.concatenate([self.local(view) for view in views])
        cv2.setRNGSeed(1)
        criteria = (cv2.TERM_CRITERIA_MAX_ITER, 30, 0.0)
        _, _, self.words = cv2.kmeans(found, config.words, None, criteria, 1, cv2.KMEANS_PP_CENTERS)

    def describe(self, frame):
        """Vector (words x 128,) of a frame."""
        local = self.local(frame)
        nearest = ((local[:, None] - self.words[None]) ** 2).sum(axis=2).argmin(axis=1)
        sums = np.stack([(local[nearest == word] - centre).sum(axis=0) for word, centre in enumerate(self.words)])
        signed = np.sign(sums) * np.sqrt(np.abs(sums))
        return signed.ravel() / max(np.linalg.norm(signed), 1e-9)

    def local(self, frame):
        """RootSIFT descriptors (N, 128); a frame without corners has one, of zeros."""
        grey = frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY)
        _, found = self.sift.detectAndCompute(grey, None)
        if found is None:
            return np.zeros((1, 128), np.float32)
        return np.sqrt(found / np.maximum(found.sum(axis=1, keepdims=True), 1e-9))
