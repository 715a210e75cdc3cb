"""Names from files are printed as they are, and command nothing."""

import io

from rich.table import Table

from hippodrome.eval.results.terminal import PlainConsole

EVIL = "[red]a[/] [/b] :smile: \x1b[31m\x07\u202e"


def test_markup_and_escapes_are_text():
    screen = io.StringIO()
    console = PlainConsole(file=screen, width=120, force_terminal=True, color_system=None)
    table = Table(title=EVIL)
    table.add_column(EVIL)
    table.add_row(EVIL)
    console.print(table)
    console.print(EVIL)
    said = screen.getvalue()
    assert said.count("[red]a[/] [/b] :smile:") == 4
    assert not {"\x07", "\u202e"} & set(said) and "\x1b[31m" not in said
