"""``report.html``: all results of a run on one page that needs nothing but itself.

Begin with ``report.py``, the page, and ``sections.py``, the parts of a scenario's section. ``evidence.py`` writes what the
interactive map shows, ``files.py`` reads what lies beside the results, ``markup.py`` makes HTML that cannot be injected into,
and ``map.js`` and ``style.css`` go into the page. ``cover.py`` makes the README's picture and table.
"""
