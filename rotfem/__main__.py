"""`python -m rotfem`."""

from rotfem.commands.cli import main

if __name__ == "__main__":
    main()
