"""The algorithms: numbers in, numbers out. Nothing here knows a simulator, a file or a command.

What travels between the rooms is in ``types``; rigid motions in the plane are in ``se2``. Reading along a drive:

- ``mapping``: observations in, a semi-metric cognitive map out. Begin with ``mapping.mapper``.
- ``refinement``: that map and a road network in, a topometric map out. Begin with ``refinement.refine``; it asks ``matching``
  which roads were driven.
- ``localization``: a topometric map and the observations of a later drive in, a pose after each of them out. Begin with
  ``localization.localizer``.

These three are built from ``views`` (what a frame tells), ``attractors`` (head-direction and grid cells), ``roads`` (lanes, their
geometry and how they join) and ``solvers`` (least squares). The paper throughout is Li, Zeng, Si 2025; "Eq." is one of its
equations.
"""
