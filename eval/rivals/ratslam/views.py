"""RatSLAM's local view cells: every frame is compared with all templates, and becomes a new template if it resembles none."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hippodrome.core.types import FloatArray, Frame, UInt8Array
from hippodrome.core.views.config import ViewCellConfig
from hippodrome.core.views.descriptors import Descriptor, describe
from hippodrome.core.views.scoring import QueryMean, best_over_shifts, make_bank, score


@dataclass(frozen=True)
class ViewConfig:
    """Templates and the energy they inject. OpenRatSLAM's values, except where its data sets were tuned one by one."""

    template: ViewCellConfig = field(default_factory=lambda: ViewCellConfig(kind="grey"))  # 60x10, patch normalised
    # A frame matches a template if their mean absolute difference is below this share of the grey range. Published are 0.03 to
    # 0.085, depending on the camera.
    match_threshold: float = 0.05
    column_rad: float = 0.0262  # change of heading per column of shift: 90 deg over 60 columns
    injected_energy: float = 0.1  # by a template that is not tired
    recent: int = 10  # the latest templates, this many, inject nothing, as the vehicle has hardly left them
    active_decay: float = 1.0  # by which a template tires in each frame in which it stays active
    restored: float = 0.04  # by which every template recovers in each frame


@dataclass(frozen=True, slots=True)
class Recognised:
    """The template that a frame was recognised as."""

    template: int
    is_new: bool  # whether the frame has become a template of its own
    heading_rad: float  # of the vehicle, relative to its heading when the template was made


class ViewTemplates:
    """The stored templates, the pose code that each is associated with, and how tired each is."""

    def __init__(self, config: ViewConfig) -> None:
        self._config, self._count, self._active = config, 0, -1
        size = int(np.prod(config.template.shape))
        self._images: UInt8Array = np.zeros((256, size), dtype=np.uint8)
        self._codes: FloatArray = np.zeros((256, 3))
        self._decay: FloatArray = np.full(256, config.active_decay)
        self._no_mean = QueryMean(np.zeros(size, dtype=np.float32), 0)

    @property
    def images(self) -> UInt8Array:
        """All templates (C, D)."""
        return self._images[: self._count].copy()

    def code(self, template: int) -> FloatArray:
        """The pose code (3,) that a template is associated with."""
        code: FloatArray = self._codes[template].copy()
        return code

    def recognise(self, frame: Frame, code: FloatArray) -> Recognised:
        """The most similar template below the threshold, or a new one associated with the present pose ``code`` (3,)."""
        config = self._config
        image = describe(frame, config.template)
        bank = make_bank("grey", config.template.shape, self._images[: self._count], self._no_mean.mean)
        shifts, best = np.zeros(0, dtype=np.int32), -1
        if self._count:
            scores = score(bank, image, self._no_mean, config.template)
            similarity, shifts = best_over_shifts(scores, config.template.max_shift)
            best = int(np.argmax(similarity))
            if similarity[best] >= -255.0 * config.match_threshold:
                return Recognised(best, False, -float(shifts[best]) * config.column_rad)
        return Recognised(self._append(image, code), True, 0.0)

    def energy(self, seen: Recognised) -> float:
        """The energy that the active template injects, less the longer it stays active. Then all templates recover a little."""
        config, energy = self._config, 0.0
        if not seen.is_new and seen.template < self._count - config.recent:
            if seen.template == self._active:
                self._decay[seen.template] += config.active_decay
            tired = float(np.exp(1.2 * min(self._decay[seen.template], 10.0)))  # from a decay of 2.8 on, the energy is zero
            energy = max(0.0, config.injected_energy * (30.0 - tired) / 30.0)
        self._decay = np.maximum(self._decay - config.restored, config.active_decay)
        self._active = seen.template
        return energy

    def _append(self, image: Descriptor, code: FloatArray) -> int:
        if self._count == len(self._images):
            self._images = np.concatenate([self._images, np.zeros_like(self._images)])
            self._codes = np.concatenate([self._codes, np.zeros_like(self._codes)])
            self._decay = np.concatenate([self._decay, np.full_like(self._decay, self._config.active_decay)])
        self._images[self._count], self._codes[self._count] = image, code
        self._count += 1
        return self._count - 1
