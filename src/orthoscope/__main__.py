"""`python -m orthoscope` is the command line."""

from orthoscope.cli import main

if __name__ == "__main__":
    main()
