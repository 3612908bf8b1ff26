"""Settings: of scoring (`scoring`), of what a generator hears and how it is trained (`learning`)."""

from harmolab.params.scoring import CHOICES as CHOICES
from harmolab.params.scoring import DANCES as DANCES
from harmolab.params.scoring import BarPattern as BarPattern
from harmolab.params.scoring import Dance as Dance
from harmolab.params.scoring import HarmonyParams as HarmonyParams
