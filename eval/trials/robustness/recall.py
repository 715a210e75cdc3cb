"""Precision and recall of place recognition: a threshold on the score gives one point of a recogniser's curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Final

import numpy as np

from hippodrome.core.types import FloatArray
from hippodrome.eval.metrics.places import MAPPED_M, SAME_M
from hippodrome.eval.trials.robustness.place_recognition import STRUCK, Answers

PRECISION: Final = 0.99  # the recall at this precision is the figure of the tables
DEFINITION: Final = (
    f"recall at {100 * PRECISION:g} % precision of the looks of the localization drive; {100 * STRUCK:g} % of the places, those "
    f"farthest west, are struck from the map. A look is mapped if a place lies within {MAPPED_M:g} m, facing the same way; an "
    f"answer is right within {SAME_M:g} m (strict: {MAPPED_M:g} m). RatSLAM's template match is judged by its difference, and by "
    "the margin over the best place elsewhere, as ours is."
)


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Precision (K,) and recall (K,) as the threshold on the score falls."""

    precision: FloatArray
    recall: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PlaceResult:
    """The answers of all recognisers under one condition."""

    condition: str
    answers: tuple[Answers, ...]
    failed: Mapping[str, str] = field(default_factory=dict)  # labels of the methods without answers, and why

    def summary(self) -> dict[str, Any]:
        """How many queries there were and, for each recogniser, its figures or why it has none; as plain data."""
        mapped = self.answers[0].mapped
        return {
            "condition": self.condition,
            "looks": len(mapped),
            "mapped": int(mapped.sum()),
            "recognisers": {one.method: _figures(one) for one in self.answers},
            **({"failed_methods": dict(self.failed)} if self.failed else {}),
        }


def recogniser_names(results: Sequence[PlaceResult]) -> list[str]:
    """All recognisers, those that failed under some conditions or under all of them included, in the order of the tables."""
    answered = [one.method for result in results for one in result.answers]
    return list(dict.fromkeys([*answered, *(label for result in results for label in result.failed)]))


def curve(answers: Answers, strict: bool = False) -> Curve:
    """Precision over all answers above the threshold, recall over the mapped queries; equal scores fall together.

    ``strict`` takes an answer for right only within ``MAPPED_M``.
    """
    right = answers.near if strict else answers.right
    order = np.argsort(-answers.score, kind="stable")
    last = np.append(np.diff(answers.score[order]) != 0.0, True)
    accepted, correct = np.arange(1, len(order) + 1), np.cumsum(right[order])
    recalled = np.cumsum((right & answers.mapped)[order])
    return Curve((correct / accepted)[last], (recalled / max(int(answers.mapped.sum()), 1))[last])


def recall_at(found: Curve, precision: float = PRECISION) -> float:
    """The largest recall at a precision of at least ``precision``; 0 when no threshold reaches it."""
    return float(np.max(found.recall, where=found.precision >= precision, initial=0.0))


def side_by_side(results: Sequence[PlaceResult]) -> PlaceResult:
    """One condition's answers in several towns as if all had been given in one, so that one threshold holds for all.

    A method that failed in one of the towns has failed in all together.
    """
    failed = {label: f"in town {number}: {why}" for number, one in enumerate(results, 1) for label, why in one.failed.items()}
    by_method = zip(*([one for one in result.answers if one.method not in failed] for result in results), strict=True)
    return PlaceResult(results[0].condition, tuple(map(_concatenated, by_method)), failed)


def _concatenated(answers: Sequence[Answers]) -> Answers:
    """One recogniser's answers in all towns."""
    arrays = {
        one.name: np.concatenate([getattr(part, one.name) for part in answers]) for one in fields(Answers) if one.name != "method"
    }
    return Answers(answers[0].method, **arrays)


def _figures(answers: Answers) -> dict[str, float]:
    """Recall, recall by the strict limit, and the share of mapped queries whose best match is right."""
    return {
        "recall": recall_at(curve(answers)),
        "recall_strict": recall_at(curve(answers, strict=True)),
        "best_is_right": float(answers.right[answers.mapped].mean()) if answers.mapped.any() else 0.0,
    }
