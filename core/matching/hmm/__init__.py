"""Map matching of a metric map with a hidden Markov model, as Li et al. 2025 describe it (mode ``paper`` of the refinement).

Begin with ``match.py``, which puts the three parts together: ``emission`` (Eq. 8: how well a position on a lane explains a
vertex), ``transition`` (Eq. 9: how well a drive explains the motion between two vertices) and ``viterbi``, a search that knows
nothing of roads.
"""
