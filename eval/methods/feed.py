"""Observations handed to a method one by one, and what the method spends on each: CPU, and time until it asks for the next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from time import perf_counter, process_time

import numpy as np

from hippodrome.core.types import FloatArray, Observation


class Feed:
    """Iterates over observations and takes the time between handing one out and being asked for the next.

    Decoding a frame is the simulator's part: its CPU time is kept apart, in ``decoding_s``.
    """

    def __init__(self, observations: Iterable[Observation]) -> None:
        self._source = iter(observations)
        self._handed: tuple[float, float] | None = None
        self._step_cpu_s: list[float] = []
        self._step_s: list[float] = []
        self.decoding_s = 0.0
        self.last_t_s: float | None = None

    def __iter__(self) -> Iterator[Observation]:
        return self

    def __next__(self) -> Observation:
        self.settle()
        began = process_time()
        try:
            observation = next(self._source)
        finally:
            self.decoding_s += process_time() - began
        self.last_t_s = observation.t_s
        self._handed = process_time(), perf_counter()
        return observation

    def settle(self) -> None:
        """The method has done with the observation that it was handed last."""
        if self._handed is not None:
            cpu_s, clock_s = self._handed
            self._step_cpu_s.append(process_time() - cpu_s)
            self._step_s.append(perf_counter() - clock_s)
            self._handed = None

    @property
    def step_cpu_s(self) -> FloatArray:
        """CPU seconds (N,) of this process that each observation took."""
        return np.array(self._step_cpu_s)

    @property
    def step_s(self) -> FloatArray:
        """Seconds (N,) from handing out each observation until the method was done with it."""
        return np.array(self._step_s)
