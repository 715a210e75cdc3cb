"""Refinement, Section III.B of Li et al. 2025 (RC-HMM): a semi-metric map and a road network in, a topometric map out.

``refine.refine`` is the front of this room; begin there. It has two modes:

- ``route`` (the default) goes beyond the paper: start and scale are unknown. ``route`` asks ``matching.search`` for the route,
  then ``solver`` refines all poses along it, in rounds: ``residuals`` are the factors, ``noise`` estimates their standard
  deviations from the data, ``covariance`` says how sure the result is.
- ``paper``: align (``alignment``), match (``matching.hmm``), optimise (``paper``), from a known start pose.
"""
