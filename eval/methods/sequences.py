"""Sequences of a drive: stretches of a given length, each localized on its own from an unknown start."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from hippodrome.core.types import HippodromeError, Observation
from hippodrome.eval.methods.protocol import StereoObservation
from hippodrome.eval.metrics.trajectory import path_length_m
from hippodrome.sim.episode import Samples
from hippodrome.sim.recording import Recording


class Sampled(Protocol):
    """A recorded drive, whatever its frames are."""

    @property
    def samples(self) -> Samples: ...


def cut(drive: Sampled, number: int, of: int, length_m: float) -> tuple[int, int]:
    """Steps [first, end) of one sequence. The starts of all sequences are spread evenly over the drive.

    Args:
        drive: The drive that is cut.
        number: Number of the sequence, from 1.
        of: How many sequences there are.
        length_m: Length of this sequence.

    Raises:
        HippodromeError: The drive is shorter than the sequence.
    """
    travelled_m = path_length_m(drive.samples.poses_m)
    room_m = float(travelled_m[-1]) - length_m
    if room_m < 0.0:
        raise HippodromeError(f"the localization drive is {travelled_m[-1]:.0f} m long, the sequence {length_m:g} m")
    start_m = room_m * (number - 1) / max(of - 1, 1)
    first, end = np.searchsorted(travelled_m, [start_m, start_m + length_m], side="left")
    return int(first), int(end)


def observations_of(recording: Recording, first: int, end: int) -> Iterator[Observation]:
    """The observations of the steps [first, end). Frames are decoded when their step is reached."""
    for step in range(first, min(end, len(recording.samples.t_s))):
        number = int(recording.samples.frame[step])
        yield recording.samples.observation(step, recording.frame(number) if number >= 0 else None)


def stereo_observations_of(recording: Recording, first: int, end: int) -> Iterator[StereoObservation]:
    """The same with the right image of each pair. Raises HippodromeError where the recording has none."""
    for step, one in enumerate(observations_of(recording, first, end), start=first):
        number = int(recording.samples.frame[step])
        right = recording.frame(number, "r") if number >= 0 else None
        yield StereoObservation(one.t_s, one.dt_s, one.speed, one.yaw_rate_radps, one.frame, right)
