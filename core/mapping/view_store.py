"""The views that the mapper has stored, as a bank that grows by one view at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from hippodrome.core.types import ViewCells
from hippodrome.core.views.config import ViewCellConfig
from hippodrome.core.views.descriptors import Descriptor
from hippodrome.core.views.scoring import ViewCellBank, make_bank, template_mean

FIRST_ROOM = 64  # templates that there is room for at first; the room doubles when it is full


class ViewStore:
    """Stored templates in one block, which doubles when full, and the ``bank`` to score queries against.

    The mean that scoring subtracts changes with every view. Renewing it changes the norms of all templates, so that it is
    renewed only when the number of templates has grown by a quarter since the last time: a constant cost per view on average.
    """

    def __init__(self, config: ViewCellConfig) -> None:
        dtype: type[np.integer[Any]] = np.int8 if config.kind == "gradient" else np.uint8
        self._config, self._count, self._renew_at = config, 0, 1
        self._templates = np.zeros((FIRST_ROOM, int(np.prod(config.shape))), dtype=dtype)
        no_mean = np.zeros(self._templates.shape[1], dtype=np.float32)
        self.bank = make_bank(config.kind, config.shape, self._templates[:0], no_mean)

    def append(self, descriptor: Descriptor) -> None:
        """Store one more view (D,), and bring the bank up to date."""
        if self._count == len(self._templates):
            self._templates = np.concatenate([self._templates, np.zeros_like(self._templates)])
        self._templates[self._count] = descriptor
        self._count += 1
        stored, kind, shape = self._templates[: self._count], self._config.kind, self._config.shape
        if self._count >= self._renew_at:
            self._renew_at = self._count + max(1, self._count // 4)
            self.bank = make_bank(kind, shape, stored, template_mean(kind, stored))
            return
        newest = make_bank(kind, shape, stored[-1:], self.bank.mean)
        inverse_norm = np.concatenate([self.bank.inverse_norm, newest.inverse_norm])
        self.bank = ViewCellBank(kind, shape, stored, self.bank.mean, inverse_norm)

    def finished(self) -> ViewCells:
        """The stored views as the view cells of the finished map, with the mean of all of them."""
        kind, templates = self._config.kind, self.bank.templates
        return ViewCells(kind, templates.copy(), template_mean(kind, templates), self._config.shape)
