"""A visual vocabulary for ORB-SLAM3 of our own: hierarchical k-majority over ORB descriptors, in DBoW2's text format.

The tracker needs one; the published file is 145 MB and trained on photographs, ours on frames of other generated towns.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from hippodrome.core.types import FloatArray, Frame, HippodromeError, IntArray, UInt8Array

BRANCHING, DEPTH = 10, 5  # the published vocabulary has 10 and 6; a depth of four is too shallow to tell places apart
DESCRIPTOR_BYTES = 32
FEATURES_PER_IMAGE = 500
SWEEPS = 12  # iterations of k-majority per node at most; assignments hardly change after ten
FEW = 8  # up to so many descriptors per cluster, equal ones are looked for: there may be fewer distinct ones than clusters
LEAST_WEIGHT = 1e-3  # of a word that all images have; it tells nothing, but DBoW2 takes a weight of zero for a stopped word

Bits: TypeAlias = NDArray[np.float32]
Members: TypeAlias = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Vocabulary:
    """A tree of K nodes without its root, breadth first; node ``i`` of these arrays has DBoW2's number ``i + 1``."""

    branching: int
    depth: int
    parent: IntArray  # (K,) DBoW2's number of the parent; 0 is the root
    is_leaf: NDArray[np.bool_]  # (K,)
    descriptor: UInt8Array  # (K, 32)
    weight: FloatArray  # (K,) ln(images / images with the word) of leaves


def orb_descriptors(frames: Iterable[Frame]) -> tuple[UInt8Array, IntArray]:
    """ORB descriptors of RGB frames.

    Returns:
        Descriptors (N, 32), and for each (N,) the number of the frame that it is from.

    Raises:
        HippodromeError: No frame has a corner.
    """
    extractor = cv2.ORB.create(FEATURES_PER_IMAGE)
    found, image = [], []
    for number, frame in enumerate(frames):
        _, descriptors = extractor.detectAndCompute(cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY), None)
        if descriptors is not None:
            found.append(descriptors)
            image.append(np.full(len(descriptors), number, dtype=np.int32))
    if not found:
        raise HippodromeError("vocabulary: no training frame has a corner; train on frames that show something")
    return np.concatenate(found), np.concatenate(image)


def train(
    descriptors: UInt8Array, image: IntArray, rng: np.random.Generator, branching: int = BRANCHING, depth: int = DEPTH
) -> Vocabulary:
    """Hierarchical clustering into a vocabulary tree, Nister & Stewenius 2006: clusters are split again, level by level.

    Args:
        descriptors: Training descriptors (N, 32).
        image: The number of the image that each is from (N,), ascending.
        rng: Chooses the first centres.
        branching: Clusters that a node is split into.
        depth: Levels of the tree.
    """
    parent, leaf, centre, weight = [], [], [], []
    everything: Members = np.arange(len(descriptors))
    waiting = deque([(0, 0, everything)])
    while waiting:
        node, level, members = waiting.popleft()
        for group, middle in _split(descriptors, members, branching, rng):
            ends = level + 1 == depth or bool(np.all(descriptors[group] == descriptors[group[0]]))
            parent.append(node)
            leaf.append(ends)
            centre.append(middle)
            weight.append(_weight(image, group) if ends else 0.0)
            if not ends:
                waiting.append((len(parent), level + 1, group))
    arrays = np.array(parent, dtype=np.int32), np.array(leaf), np.array(centre, dtype=np.uint8), np.array(weight)
    return Vocabulary(branching, depth, *arrays)


def to_text(vocabulary: Vocabulary) -> str:
    """DBoW2's text format: ``k L 0 0`` (L1 norm, TF-IDF), then ``parent isLeaf b0 ... b31 weight`` per node.

    There is no newline at the end, as DBoW2 would read another node after it.
    """
    lines = [f"{vocabulary.branching} {vocabulary.depth} 0 0"]
    nodes = zip(vocabulary.parent, vocabulary.is_leaf, vocabulary.descriptor, vocabulary.weight, strict=True)
    lines += [f"{parent} {int(leaf)} {' '.join(map(str, bytes_))} {weight:.6g}" for parent, leaf, bytes_, weight in nodes]
    return "\n".join(lines)


def _weight(image: IntArray, members: Members) -> float:
    """Inverse document frequency of a word."""
    return max(LEAST_WEIGHT, float(np.log((int(image[-1]) + 1) / len(set(image[members].tolist())))))


def _split(
    descriptors: UInt8Array, members: Members, branching: int, rng: np.random.Generator
) -> list[tuple[Members, UInt8Array]]:
    """Clusters of ``members`` and their centres (32,); if there are few distinct descriptors, each is a cluster of its own."""
    bits = _bits(descriptors[members])
    distinct = _bits(_distinct(descriptors[members])) if len(members) <= FEW * branching else bits
    centres = distinct if len(distinct) <= branching else _k_majority(bits, distinct, branching, rng)
    nearest = _nearest(bits, centres)
    packed = np.packbits(centres.astype(np.uint8), axis=1)
    return [(members[nearest == i], packed[i]) for i in range(len(centres)) if np.any(nearest == i)]


def _k_majority(bits: Bits, candidates: Bits, branching: int, rng: np.random.Generator) -> Bits:
    """Centres (k, 256) of binary k-means: the majority of each bit (Grana et al. 2013)."""
    centres = candidates[rng.choice(len(candidates), branching, replace=False)]
    nearest = _nearest(bits, centres)
    for _ in range(SWEEPS):
        belongs = (nearest == np.arange(branching)[:, None]).astype(np.float32)
        counts, sums = belongs.sum(axis=1, keepdims=True), belongs @ bits
        centres = np.where(counts > 0, (2.0 * sums > counts).astype(np.float32), centres)
        before, nearest = nearest, _nearest(bits, centres)
        if np.array_equal(before, nearest):
            break
    return centres


def _nearest(bits: Bits, centres: Bits) -> Members:
    """Nearest centre (N,) by Hamming distance; sums of whole numbers, exact in any order."""
    nearest: Members = np.argmin(centres.sum(axis=1) - 2.0 * (bits @ centres.T), axis=1)
    return nearest


def _distinct(descriptors: UInt8Array) -> UInt8Array:
    """The distinct descriptors of (N, 32). Each row is viewed as one opaque value, which sorts fast."""
    rows = np.ascontiguousarray(descriptors).view(f"V{DESCRIPTOR_BYTES}").ravel()
    return np.unique(rows).view(np.uint8).reshape(-1, DESCRIPTOR_BYTES)


def _bits(descriptors: UInt8Array) -> Bits:
    return np.unpackbits(descriptors, axis=1).astype(np.float32)
