"""``hippodrome stress``: the refinement under errors of self-motion, loop closures and roads.

Begin with ``run``, which runs the cases over scenarios and seeds and writes the results. ``cases`` lists what may go wrong,
``perturbations`` does it to maps and networks, ``trial`` refines and scores one case, ``rows`` and ``table`` hold the results.
"""
