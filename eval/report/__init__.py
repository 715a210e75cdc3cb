"""``report.html``: all results of a run on one page that needs nothing but itself.

Begin with ``report.py``, the page, and ``sections.py``, the parts of a scenario's section. ``player.py`` is its first screen.
``evidence.py`` writes what the maps show of the first drive, ``belief.py`` what of the second; ``files.py`` reads what
lies beside the results, and ``markup.py`` makes HTML that cannot be injected into. The scripts go into the page with
``style.css``: ``basics.js`` is what all use; ``story.js`` says what is told when, ``scene.js``, ``chart.js`` and ``brain.js``
draw a moment of it, ``player.js`` and ``compare.js`` let one town and all play; ``mapview.js`` and ``map.js`` are the map to be
explored, ``vector.js`` and ``save.js`` make files of figures, ``tables.js`` makes tables of use, ``tabs.js`` opens one town at a
time. ``pages.py`` makes the pages of the trials, ``versus.py`` that of two runs, ``serve.py`` that of a run which goes on.
``cover.py`` and ``film.py`` make the README's pictures and table.
"""
