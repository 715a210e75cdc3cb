"""What our methods are compared with.

Begin with ``rows.py``: RatSLAM (``ratslam/``) and our mapper without its attractor networks (``ablation.py``), which see what
the mapper sees and run in every evaluation. ``orbslam3/`` runs in ``hippodrome baselines`` only, and so does what measures our
methods as it is measured: ``sequences.py`` localizes the sequences of Table II, ``memory.py`` and ``lean.py`` find the peak
memory.
"""
