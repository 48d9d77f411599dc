"""`python -m rotfem`."""

from rotfem.cli import main

if __name__ == "__main__":
    main()
