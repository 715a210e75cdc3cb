"""Formats to export to, one module each.

Each has ``CONVENTIONS``, which says frames, units and precision, and ``write(drives, folder)``, which fills an empty folder.
Begin with ``tum``, the shortest; ``export.FORMATS`` lists them all.
"""
