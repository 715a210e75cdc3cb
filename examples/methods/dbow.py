"""Bags of binary words (Gálvez-López & Tardós 2012) for place recognition: the package pydbow, its words learned on other towns.

pip install pydbow
hippodrome render scenarios/towns/rural.yaml --out out/words
hippodrome eval my-town.yaml --out out/dbow      # with this in my-town.yaml:

    methods:
      DBoW:
        class: examples.methods.dbow:BagOfBinaryWords
        config: {learn_on: [out/words/recordings/rural-mapping-0123456789abcdef]}
"""

from pathlib import Path

import cv2
import dbow
import numpy as np
from pydantic import BaseModel

from examples.methods.learning import frames_to_learn_on


class BagOfBinaryWords:
    """A vector of word frequencies, weighted by how rare a word is."""

    class Config(BaseModel):
        """Where the words are from, and how many there are: branching to the power of depth."""

        learn_on: list[Path]
        branching: int = 8
        depth: int = 2
        frames: int = 12  # learning takes a second for each

    def __init__(self, config):
        np.random.seed(1)  # noqa: NPY002 - pydbow draws its first clusters with it
        views = frames_to_learn_on(config.learn_on, config.frames)
        seen = [view for view in views if cv2.ORB_create().detect(view)]
        self.vocabulary = dbow.Vocabulary(seen, config.branching, config.depth)

    def describe(self, frame):
        """Vector (words,) of a frame, of length one; zeros if it has no corner."""
        _, found = cv2.ORB_create().detectAndCompute(frame, None)
        if found is None:
            return np.zeros(len(self.vocabulary.words))
        bag = self.vocabulary.descs_to_bow([dbow.ORB.from_cv_descriptor(one) for one in found]).data
        return bag / max(np.linalg.norm(bag), 1e-9)
