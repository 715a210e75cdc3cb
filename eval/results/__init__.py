"""What is written down: ``results.json`` and the tables made of it.

Begin with ``model.py``, the contract of ``results.json``. ``rows.py`` and ``scenario.py`` make its entries; ``tables.py``
(Table I), ``table_two.py``, ``ratios.py`` and ``fairness.py`` make tables of them, written by ``markdown.py``;
``paper_rows.py`` holds what the paper prints, ``thresholds.py`` a scenario's limits, ``evidence.py`` the trajectories that all
figures can be computed from again.
"""
