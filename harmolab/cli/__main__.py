"""`python -m harmolab.cli`."""

from harmolab.cli import main

main()
