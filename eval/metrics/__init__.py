"""Figures of merit, as functions of an estimate and the truth; each is tested against independent software or by hand.

Begin with ``trajectory.py``, APE and RPE. ``association.py`` and ``alignment.py`` are what they rest on; ``localization.py``
scores a localizer's drive, ``mapped_road.py`` splits that score by what the map shows, ``calibration.py`` judges covariances,
and ``map_quality.py`` judges lanes and loop closures.
"""
