"""Systems that dance; `harmolab.systems.contract` is the one door to all of them."""

from harmolab.systems.contract import System, find, load, names

__all__ = ["System", "find", "load", "names"]
