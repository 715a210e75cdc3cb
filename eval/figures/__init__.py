"""Pictures of results, after the figures of Li et al. 2025.

Begin with ``scenario.py``, all pictures of one evaluation. Every other module draws one kind, with the colours, axes and
writing of ``style.py``: ``maps.py``, ``errors.py``, ``localization.py``, ``frames.py``, ``preview.py``, ``stress.py``.
"""
