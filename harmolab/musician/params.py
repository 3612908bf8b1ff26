"""Settings of Audio to Body Dynamics. The defaults are those under the captions of its Tables 1 and 2 (violin)."""

from dataclasses import dataclass, replace
from typing import Literal

from harmolab.musician.cleaning import Alignment, Gaps
from harmolab.readers.player_points import INSTRUMENTS
from harmolab.systems.training.features import check_choice, check_settings

Hears = Literal["sound", "notes"]
Tones = Literal["none", "chroma", "semitones"]
Loss = Literal["squared", "huber"]
Validation = Literal["windows", "pieces"]

KEYS = 88  # of a piano: notes as input
LOWEST_KEY = 21  # MIDI number of the first
LOW_TONE, HIGH_TONE = 36, 96  # MIDI numbers of the semitones that are listened to
# Beyond these, settings in a file are not ours: they would only fill the memory.
MOST = {"fps": 240.0, "upsample": 16, "delay": 2.0, "sequence": 4096, "hidden": 4096, "layers": 8}


@dataclass(frozen=True)
class Audio2BodyParams:
    """Sizes, input, schedule.

    Parameters
    ----------
    fps : float, hertz, of points and of the features
    hears : "sound", or "notes": what is played in place of how it sounds, one channel for each key of a piano
    mfcc, mels : int, coefficients, and bands that they are taken of (A2B 5)
    energy_delta : bool
        Whether the log mean energy has a derivative, too: 28 numbers a frame, 27 without (A2B 4).
    tones : "none", or beside these the strength of 12 tones ("chroma") or of every semitone. The paper has none.
    components : int, principal components of the points; or float, the share of the variance to keep (A2B 11)
    upsample : int, steps of the network from each frame to the next (A2B 12)
    delay : float, seconds from what is heard to what is predicted (A2B 13)
    hidden : int, units of the LSTM
    layers : int, of the LSTM; the paper tried more, "which did not show improvement" (Sec. 4)
    dropout : float, on its output
    rate : float, of Adam
    sequence : int, steps of a training window
    carry : int, windows in a row that hand on their state without its gradient; 1: each starts from 0 (A2B 16)
    batch : int, windows
    epochs : int
    loss : "squared" or "huber" (A2B 18)
    reject : bool, whether frames with wrong points are left out (A2B 8)
    gaps : "mask": the loss leaves them out; "interpolate": lines are learnt; "splice": cut out (A2B 9)
    alignment : "recording", one similarity each; "frame"; or "none" (A2B 10)
    even_scale : bool, one scale for all components of the output (A2B 17); else each has its own
    data_share : float, of the training windows
    validation : "windows", a random fifth of them, as in the paper; "pieces" whole pieces (A2B 20)
    bow_phase : bool, the bow's place without its direction is learnt, and its direction alternates. Ours, violin.
    shuffled_sound : bool, every training piece is heard with the sound of another: what is left is no hearing
    shards : int, as in `harmolab.systems.harmogan.params.TrainParams`
    seed : int
    """

    fps: float = 24.0
    hears: Hears = "sound"
    mfcc: int = 13
    mels: int = 40
    energy_delta: bool = True
    tones: Tones = "none"
    components: float = 15
    upsample: int = 4
    delay: float = 0.024
    hidden: int = 200
    layers: int = 1
    dropout: float = 0.15
    rate: float = 2e-3
    sequence: int = 60
    carry: int = 1
    batch: int = 100
    epochs: int = 300
    loss: Loss = "squared"
    reject: bool = True
    gaps: Gaps = "mask"
    alignment: Alignment = "recording"
    even_scale: bool = True
    data_share: float = 1.0
    validation: Validation = "windows"
    bow_phase: bool = False
    shuffled_sound: bool = False
    shards: int = 1
    seed: int = 1

    def __post_init__(self) -> None:
        check_settings(self, not_negative=("delay", "dropout", "epochs", "seed"))
        if self.dropout >= 1 or self.data_share > 1 or self.mfcc > self.mels:
            raise ValueError("dropout and data_share are shares, and there are no more coefficients than bands")
        if self.components > 1 and self.components != int(self.components):
            raise ValueError(f"components are a whole number, or a share of the variance, got {self.components}")
        for name, most in MOST.items():
            if getattr(self, name) > most:
                raise ValueError(f"{name} must be {most:g} at most, got {getattr(self, name)}")

    @classmethod
    def tables(cls, instrument: str = "violin") -> "Audio2BodyParams":
        """As under the captions of Table 1 (violin) or Table 2 (piano); ValueError for another instrument."""
        check_choice("instrument", instrument, INSTRUMENTS)
        return cls() if instrument == "violin" else cls(dropout=0.1, rate=1e-3)

    @classmethod
    def section_4(cls, instrument: str = "violin") -> "Audio2BodyParams":
        """As in the text of Sec. 4."""
        return replace(cls.tables(instrument), sequence=400, delay=5 / 96, dropout=0.4, rate=5e-3, components=10)

    @classmethod
    def recommended(cls, instrument: str = "piano") -> "Audio2BodyParams":
        """Hands move before the note: 125 ms of delay; semitones beside the 28 numbers; a violin's bow alternates."""
        return replace(
            cls.tables(instrument), delay=0.125, tones="semitones", batch=25, rate=2e-3, epochs=40,
            validation="pieces", bow_phase=instrument == "violin",
        )  # fmt: skip

    @property
    def step_rate(self) -> float:
        """Steps of the network a second."""
        return self.fps * self.upsample

    @property
    def delay_steps(self) -> int:
        """The delay in steps."""
        return round(self.delay * self.step_rate)

    @property
    def n_sound(self) -> int:
        """Numbers a frame that the network hears."""
        if self.hears == "notes":
            return KEYS
        tones = {"none": 0, "chroma": 12, "semitones": HIGH_TONE - LOW_TONE + 1}[self.tones]
        return 2 * self.mfcc + 1 + self.energy_delta + tones
