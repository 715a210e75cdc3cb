import pytest

from hippodrome.eval.cli import main
from hippodrome.eval.commands.arguments import DONE
from tests.eval.exchange.results import make_run


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="session")
def exported(run, tmp_path_factory):
    """The run in every format, made once each."""
    root, done = tmp_path_factory.mktemp("exported"), {}

    def export(to):
        if to not in done:
            assert main(["export", str(run.root), "--to", to, "--out", str(root / to)]) == DONE
            done[to] = root / to
        return done[to]

    return export
