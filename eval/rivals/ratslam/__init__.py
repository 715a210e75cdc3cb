"""Classical RatSLAM.

Begin with ``system.py``, which runs its three parts: ``views.py``, ``pose_cells.py``, ``experiences.py``.
"""
