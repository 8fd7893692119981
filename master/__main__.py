"""`python -m master` is `kitecosim`."""

from master.cli import main

main()
