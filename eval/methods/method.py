"""The table of methods: one row of every results table each, and all that the harness has to know about it.

Nothing else in ``eval`` tells methods apart by their names. A method that joins the comparison is a line of ``METHODS``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TypeAlias

from hippodrome.eval.metrics.alignment import AlignmentName

ScoringFrame: TypeAlias = Literal["own", "network", "metric"]
RefineMode: TypeAlias = Literal["paper", "route"]

ALIGNMENTS: Final[dict[ScoringFrame, AlignmentName]] = {"own": "start", "network": "none", "metric": "se2"}


@dataclass(frozen=True, slots=True)
class Method:
    """One method of the comparison.

    ``frame`` says in what frame its trajectory is, and with it how the trajectory is laid over the truth before its APE is taken:

    * ``own``: a frame and a scale of its own. Its first pose is laid on the true one, without scaling.
    * ``network``: the road network's frame, in metres. It is not moved at all.
    * ``metric``: metres, but in a frame of its own. The best rigid fit moves it.
    """

    key: str  # identifier for programs
    label: str  # what tables and figures call it, and ``method`` of its row in results.json
    frame: ScoringFrame
    stem: str  # its files are named after it: STEM.tum, STEM-ape.png, STEM-localization.tum
    system: str | None = None  # label of the system of which it is a variant, if it is one of several
    map_file: str | None = None  # name of its map in a scenario's folder, if it keeps one there
    mode: RefineMode | None = None  # mode of the refinement, if its map is a refined one
    drawn: bool = True  # whether its trajectory is drawn; not if it would cover another's, whose poses are the same

    @property
    def alignment(self) -> AlignmentName:
        """How its trajectory is laid over the truth before its APE is taken."""
        return ALIGNMENTS[self.frame]

    def map_path(self, folder: Path) -> Path:
        """Its map in a scenario's ``folder``. Only for methods that keep one there."""
        assert self.map_file is not None, f"{self.label} keeps no map"
        return folder / self.map_file


DEAD_RECKONING: Final = Method("dead_reckoning", "dead reckoning", "own", "dead-reckoning")
SEMI_METRIC: Final = Method("semi_metric", "semi-metric", "own", "semi-metric", map_file="semi-metric.pbstream")
RATSLAM: Final = Method("ratslam", "RatSLAM", "own", "RatSLAM", map_file="ratslam.npz")
NO_ATTRACTOR: Final = Method(
    "no_attractor",
    "semi-metric, no attractor",
    "own",
    "semi-metric-no-attractor",
    map_file="semi-metric-no-attractor.pbstream",
    drawn=False,
)
TOPOMETRIC_PAPER: Final = Method(
    "topometric_paper",
    "topometric (paper)",
    "network",
    "topometric-paper",
    map_file="topometric-paper.pbstream",
    mode="paper",
)
TOPOMETRIC: Final = Method(
    "topometric",
    "topometric",
    "network",
    "topometric",
    map_file="topometric-default.pbstream",  # programs have read it by this name since mode ``route`` was called ``default``
    mode="route",
)
ORBSLAM3: Final = Method("orbslam3", "ORB-SLAM3", "metric", "ORB-SLAM3")  # localizing in its saved map, Table II
ORBSLAM3_LIVE: Final = Method("orbslam3_live", "ORB-SLAM3 (live)", "metric", "ORB-SLAM3-live", system="ORB-SLAM3")
ORBSLAM3_FINAL: Final = Method("orbslam3_final", "ORB-SLAM3 (final)", "metric", "ORB-SLAM3-final", system="ORB-SLAM3")

METHODS: Final = (
    DEAD_RECKONING,
    SEMI_METRIC,
    RATSLAM,
    NO_ATTRACTOR,
    TOPOMETRIC_PAPER,
    TOPOMETRIC,
    ORBSLAM3,
    ORBSLAM3_LIVE,
    ORBSLAM3_FINAL,
)
REFINED: Final = (TOPOMETRIC_PAPER, TOPOMETRIC)  # their maps are refined, and a second drive is localized in each
ALWAYS: Final = (*REFINED, SEMI_METRIC, DEAD_RECKONING)  # every evaluation has these rows, so thresholds can speak of them


def method_of(label: str, frame: str | None = None) -> Method:
    """The method of a row, by the label that results files know it by.

    ``frame`` is the one that the row declares; it counts for a method that the table lacks.

    A label that the table lacks, from a results file of another version or another program, gets a method as well: a variant of
    the known method that its label begins with (``topometric (tuned)``), and otherwise one with a frame of its own.
    """
    known = {method.label: method for method in METHODS}
    if label in known:
        return known[label]
    stem = stem_of(label)
    declared = next((known for known in ALIGNMENTS if known == frame), None)
    if declared is not None:
        return Method(stem, label, declared, stem)
    whole = max((name for name in known if label.startswith(name)), key=len, default=None)
    if whole is None:
        return Method(stem, label, "own", stem)
    return Method(stem, label, known[whole].frame, stem, system=known[whole].system or whole)


def stem_of(label: str) -> str:
    """What the files of a method with this label are named after."""
    return label.replace(" (", "-").replace(")", "").replace(",", "").replace(" ", "-")
