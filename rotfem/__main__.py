"""`python -m rotfem`, and the command `rotfem`."""

import gc
import os
import signal
import sys


def main() -> None:
    """Run the command line.

    Ctrl-C ends the process at once until there is a result folder: in the middle of an import an exception becomes any
    other. No garbage is collected until then, as what is imported stays. Pydantic takes schemas as they are, and looks
    for no plugins. Typer is imported without rich, which takes longer than all the rest and puts backslashes into the
    helps.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # which a background job has not
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.disable()
    os.environ |= {"PYDANTIC_SKIP_VALIDATING_CORE_SCHEMAS": "1", "PYDANTIC_DISABLE_PLUGINS": "__all__"}
    sys.modules["rich"] = None  # type: ignore[assignment]
    import typer  # noqa: F401

    del sys.modules["rich"]
    from rotfem.commands.cli import main as command

    command()


if __name__ == "__main__":
    main()
