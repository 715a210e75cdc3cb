"""Which addresses of a scheduler are safe to use without a word."""

import pytest

from hippodrome.eval.sweep.executors import is_guarded


@pytest.mark.parametrize(("address", "safe"), [
    ("tcp://127.0.0.1:8786", True), ("127.0.0.1:8786", True), ("tcp://localhost:8786", True), ("tcp://[::1]:8786", True),
    ("tls://cluster.example.org:8786", True), ("tcp://10.0.0.7:8786", False), ("tcp://cluster:8786", False),
    ("cluster:8786", False),
    ("tcp://0.0.0.0:8786", False), ("tcp://127.0.0.1.example.org:8786", False),
])  # fmt: skip
def test_loopback_and_tls_are_safe(address, safe):
    assert is_guarded(address) is safe
