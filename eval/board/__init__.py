"""The board: methods x scenarios of any number of result folders, on one page that needs no server.

``entries.py`` sorts results into cells; ``page.py`` writes the page.
"""
