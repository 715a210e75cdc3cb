"""Methods beside ours in the trials: their maps made once, then stretches of second drives localized in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from hippodrome._folders import temporary_folder
from hippodrome.core.types import HippodromeError, Trajectory
from hippodrome.eval.contest.calls import Drawn, draw_all, localize
from hippodrome.eval.contest.entry import Entry, entries_of
from hippodrome.eval.contest.perform import sampled, scored_times
from hippodrome.eval.methods.materials import Materials
from hippodrome.eval.methods.protocol import MethodError
from hippodrome.eval.methods.sequences import cut
from hippodrome.eval.methods.stages import Localization
from hippodrome.eval.metrics.localization import score_localization
from hippodrome.eval.results.table_two import LocalizedSequence, SequenceRow, failed_sequence, localized_sequence
from hippodrome.sim.recording import Recording
from hippodrome.sim.scenario import Scenario


@dataclass(frozen=True, slots=True, eq=False)
class Localizer:
    """A method with its map of the mapping drive, ready for second drives."""

    entry: Entry
    materials: Materials
    drawn: Drawn
    folder: Path

    def localize(self, drive: Recording, stretch: tuple[int, int]) -> Localization:
        """The steps [first, end) of a drive, from an unknown start. Raises HippodromeError."""
        return localize(self.entry, self.materials, self.drawn.mapped, self.folder, drive, stretch)


def added_methods(scenario: Scenario, does: str) -> list[Entry]:
    """The methods beside ours that a scenario names and that do one of ``map``, ``localize`` and ``describe``."""
    return [entry for entry in entries_of(scenario) if entry.source != "hippodrome" and does in entry.does]


def with_bases(entry: Entry, entries: Sequence[Entry]) -> list[Entry]:
    """What a method builds on, the lowest first, and the method."""
    found = [entry]
    while found[0].builds_on is not None and len(found) <= len(entries):
        found.insert(0, next(other for other in entries if other.method.key == found[0].builds_on))
    return found


@contextmanager
def localizer_of(entry: Entry, materials: Materials) -> Iterator[Localizer]:
    """A method that localizes, once it has mapped the mapping drive. Raises HippodromeError if it has no map."""
    needed = with_bases(entry, entries_of(materials.scenario))
    with ExitStack() as stack:
        folders = {one.method.key: stack.enter_context(temporary_folder()) for one in needed}
        for one in needed:
            stack.callback(one.close)
        drawn = draw_all(materials, needed, folders)[entry.method.key]
        if isinstance(drawn, str):
            raise MethodError(drawn)
        yield Localizer(entry, materials, drawn, folders[entry.method.key])


def map_alone(entry: Entry, materials: Materials) -> tuple[Trajectory, float]:
    """A method's trajectory of the mapping drive at the scored times, and the CPU seconds it took. Raises HippodromeError."""
    needed = with_bases(entry, entries_of(materials.scenario))
    with ExitStack() as stack:
        folders = {one.method.key: stack.enter_context(temporary_folder()) for one in needed}
        for one in needed:
            stack.callback(one.close)
        drawn = draw_all(materials, needed, folders)[entry.method.key]
    if isinstance(drawn, str):
        raise MethodError(drawn)
    return sampled(drawn.mapped.trajectory, scored_times(materials, None))[0], drawn.whole_s


def localize_added(materials: Materials, lengths_m: Sequence[float]) -> list[LocalizedSequence]:
    """Table II of the methods beside ours: every sequence, of all that localize. Those without a map fail their sequences."""
    found = []
    for entry in added_methods(materials.scenario, "localize"):
        rows = [SequenceRow(method=entry.method.label, number=i, length_m=one) for i, one in enumerate(lengths_m, start=1)]
        try:
            with localizer_of(entry, materials) as localizer:
                found += [_sequence(localizer, row, len(rows)) for row in rows]
        except HippodromeError as error:
            found += [failed_sequence(row, f"no map: {error}") for row in rows]
    return found


def _sequence(localizer: Localizer, row: SequenceRow, of: int) -> LocalizedSequence:
    """The sequence of ``row``, one ``of`` so many, localized and scored."""
    materials = localizer.materials
    samples = materials.drive.samples
    try:
        first, end = cut(materials.drive, row.number, of, row.length_m)
        run = localizer.localize(materials.drive, (first, end))
        truth = Trajectory(samples.t_s[first:end], samples.poses_m[first:end])
        score = score_localization(run.estimates, truth, run.step_s)
    except HippodromeError as error:
        return failed_sequence(row, str(error))
    return localized_sequence(row, first, run.declared(), score, materials.folder)
