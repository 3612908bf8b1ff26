"""Lee et al. 2019, "Dancing to Music", built anew from what is known of it: a rival to compare with."""

from harmolab.systems.lee2019.train import Lee2019

__all__ = ["Lee2019"]
