"""`python -m rotfem`, and the command `rotfem`."""

import sys

from rotfem.commands.interrupts import importing


def main() -> None:
    """Run the command line; Ctrl-C waits until all that it is made of is there.

    Typer is imported without rich, which takes longer than all the rest and puts backslashes into the helps.
    """
    try:
        with importing():
            sys.modules["rich"] = None  # type: ignore[assignment]
            import typer  # noqa: F401

            del sys.modules["rich"]
            from rotfem.commands.cli import main as command
    except KeyboardInterrupt:
        print("rotfem: interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    command()


if __name__ == "__main__":
    main()
