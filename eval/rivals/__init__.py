"""What our methods are compared with.

Begin with ``rows.py``: RatSLAM (``ratslam/``) and our mapper without its attractor networks (``ablation.py``), which see what
the mapper sees and run in every evaluation. ``orbslam3/`` takes part where it is asked for, as in ``hippodrome baselines``.
``sequences.py`` localizes the sequences of Table II, ``memory.py`` and ``lean.py`` find the peak memory of our methods.
"""
