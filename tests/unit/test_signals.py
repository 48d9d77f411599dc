"""Ctrl-C and SIGTERM where what they raise would be lost."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from rotfem.commands.interrupts import SIGNALS, importing

#: Runs the command line with Ctrl-C in the middle of its imports.
INTERRUPTED = """
import signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # which a background job has not

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "rotfem.commands.console":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Finder())
from rotfem.__main__ import main
main()
"""


@pytest.mark.parametrize("number", SIGNALS)
def test_signals_wait_for_the_end_of_what_they_would_spoil(number: signal.Signals) -> None:
    def obey(*_: object) -> None:
        raise KeyboardInterrupt

    went_on = []

    def collect() -> None:
        with importing():
            signal.raise_signal(number)
            went_on.append(True)

    before = signal.signal(number, obey)
    try:
        with pytest.raises(KeyboardInterrupt):
            collect()
        assert signal.getsignal(number) is obey
    finally:
        signal.signal(number, before)
    assert went_on


def test_ctrl_c_waits_for_the_imports() -> None:
    """Exceptions in the middle of an import become others, as of modules that are half there."""
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "rotfem: interrupted\n")
