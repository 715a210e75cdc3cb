"""Continuous attractor networks of head-direction and grid cells, Eqs. (1)-(7) and (13)-(16) of Li et al. 2025.

A network holds two beliefs about one angle: that of its *integrator* cells, which self-motion moves, and that of its
*calibration* cells, which recognised views feed. Both beliefs are Gaussians on a circle, so that a network is four numbers: two
means and two reliabilities (1/sigma^2).

- ``attractor``: the equations, one function each. Begin here.
- ``head_direction``: one network on a ring, for the heading.
- ``grid_cells``: networks on tori of several periods, for the position; ``grid_decoding`` tells it from their phases.

The mapper (``mapping.networks``) and two of the localizer's beliefs (``localization.beliefs``) are built from them.
"""
