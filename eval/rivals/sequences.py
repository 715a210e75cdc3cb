"""Our localizer on the ten sequences of Table II, in every map that the evaluation of a scenario left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hippodrome.core.localization.localizer import Localizer
from hippodrome.core.types import CognitiveMap, HippodromeError, Trajectory
from hippodrome.eval.methods.materials import Materials
from hippodrome.eval.methods.method import REFINED
from hippodrome.eval.methods.sequences import cut, observations_of
from hippodrome.eval.methods.stages import Localization, localize_recording
from hippodrome.eval.methods.warm_up import warm_up
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.results.paper_rows import SEQUENCE_LENGTH_M
from hippodrome.eval.results.table_two import LocalizedSequence, SequenceRow, failed_sequence, localized_sequence
from hippodrome.proto.codec import load_map

WARM_UP_STEPS: Final = 200  # about 20 s of driving


def localize_sequences(materials: Materials, lengths_m: Sequence[float] = SEQUENCE_LENGTH_M) -> list[LocalizedSequence]:
    """Every sequence in every refined map of the scenario's folder. A map that is missing fails its sequences."""
    warm_up()
    found = []
    for method in REFINED:
        path = method.map_path(materials.folder)
        cognitive_map = load_map(path)[0] if path.exists() else None
        if cognitive_map is not None:  # caches grow with the map: without a warm-up, the first sequence would pay for all
            _localized(cognitive_map, materials, 0, WARM_UP_STEPS)
        for number, length_m in enumerate(lengths_m, start=1):
            row = SequenceRow(method=method.label, number=number, length_m=length_m)
            found.append(_sequence(row, len(lengths_m), cognitive_map, materials))
    return found


def _sequence(row: SequenceRow, of: int, cognitive_map: CognitiveMap | None, materials: Materials) -> LocalizedSequence:
    """The sequence of ``row``, one ``of`` so many, localized and scored."""
    if cognitive_map is None:
        return failed_sequence(row, "no map: the refinement failed")
    samples = materials.drive.samples
    try:
        first, end = cut(materials.drive, row.number, of, row.length_m)
        run = _localized(cognitive_map, materials, first, end)
        truth = Trajectory(samples.t_s[first:end], samples.poses_m[first:end])
        score = score_localization(run.estimates, truth, run.step_s)
    except HippodromeError as error:
        return failed_sequence(row, str(error))
    return localized_sequence(row, first, run.declared(), score, materials.folder)


def _localized(cognitive_map: CognitiveMap, materials: Materials, first: int, end: int) -> Localization:
    """The second drive's steps [first, end), localized from an unknown start."""
    localizer = Localizer(cognitive_map, materials.roads, materials.scenario.localizer)
    return localize_recording(observations_of(materials.drive, first, end), localizer)
