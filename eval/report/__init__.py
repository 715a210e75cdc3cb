"""``report.html``: all results of a run on one page that needs nothing but itself.

Begin with ``report.py``, the page, and ``sections.py``, the parts of a scenario's section. ``player.py`` is its first screen.
``evidence.py`` writes what the maps show of the first drive, ``belief.py`` what of the second; ``files.py`` reads what
lies beside the results, and ``markup.py`` makes HTML that cannot be injected into. The scripts go into the page with
``style.css``: ``story.js`` says what is told when, ``scene.js``, ``chart.js`` and ``brain.js`` draw a moment of it, ``player.js``
and ``compare.js`` let one town and all play, ``map.js`` is the map to be explored, and ``tabs.js`` opens one town at a time.
``cover.py`` makes the README's picture and table.
"""
