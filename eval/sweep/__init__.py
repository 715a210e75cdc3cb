"""``hippodrome sweep``: a grid of scenarios, seeds and parameters, run here or on a cluster, and merged.

Begin with ``run``. ``grid`` makes the cells, ``cell`` evaluates one in whatever process it runs, ``executors`` runs them and
tells failures apart, ``table`` pools the samples.
"""
