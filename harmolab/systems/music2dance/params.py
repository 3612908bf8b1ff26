"""Settings of Music2Dance (Zhuang et al. 2020): the music that is mapped, the WaveNet, its training, its dancing.

The paper's numbers are those of arXiv 2002.03761, first version. Where it is silent, or its formulas are lost, values
are those of its authors' code for the second version; docs/readings_music2dance.md says which.
"""

from dataclasses import dataclass, fields, replace
from typing import Literal

from harmolab.systems.training.features import check_settings

Representation = Literal["positions", "rotations"]
Features = Literal["attributes", "mel"]
Generator = Literal["wavenet", "lstm"]

PRESETS = ("recommended", "paper")
# Beyond these, settings in a file are not ours: they would only fill the memory.
MOST_REACH, MOST_RATE, MOST_SECONDS = 4096, 240.0, 60.0
MOST_TEMPERATURE = 4.0  # all of the predicted deviation, 1, already shakes


@dataclass(frozen=True)
class SongParams:
    """The music: its features, and the network that maps it (Sec. 4.2, 4.3, 4.4.2).

    Parameters
    ----------
    features : "attributes" or "mel"
        Onset, beat, downbeat and chroma, 15 channels; or a mel spectrogram (Fig. 8's ablation).
    rate : float, hertz, of either
    mels : int, bands of the mel spectrogram
    channels : ints, of the temporal convolutions
    hidden : int, units of the bidirectional LSTM in each direction
    dropout : float, share left out after each convolution
    window, hop : float, seconds
        Length of what the LSTM reads at once, as long as a training window; a longer song is read in windows this far
        apart, which are faded into each other.
    """

    features: Features = "attributes"
    rate: float = 10.0
    mels: int = 80
    channels: tuple[int, ...] = (16, 24, 32)
    hidden: int = 15
    dropout: float = 0.1
    window: float = 8.0
    hop: float = 4.0

    def __post_init__(self) -> None:
        check_settings(self, not_negative=("dropout",))
        if not self.channels or min(self.channels) < 1 or self.dropout >= 1 or self.hop > self.window:
            raise ValueError("a song needs convolutions with channels, a dropout below 1, and a hop within its window")

    @property
    def n_audio(self) -> int:
        """Channels of the features."""
        return 15 if self.features == "attributes" else self.mels


@dataclass(frozen=True)
class Music2DanceParams:
    """Sizes, losses, schedule and dancing; the defaults are the paper's.

    Parameters
    ----------
    song : SongParams
    generator : "wavenet" or "lstm", the paper's baseline
    representation : "rotations" (the paper's: root, joint rotations, end effectors) or "positions" (the motion code)
    end_effectors : bool, of the code of rotations: whether places of feet, head and hands are part of it (Fig. 10)
    mapping : bool
        Whether the WaveNet hears the mapped music; without (Fig. 9's ablation) the features themselves.
    fps : float, hertz, of motion
    window : float, seconds, of a training window
    residual, skip : int, channels of the WaveNet's way through its blocks and beside them
    dilations : ints, of a group of blocks
    groups : int, how often the dilations are gone through
    dance_vector : int, numbers of the learnt vector of a dance
    lstm : int, units of the baseline
    least_sigma : float, standard deviations of a channel
    carry : float
        Share of the frame before in the predicted mean. The paper predicts the pose alone.
    contact_weight : float, lambda of Eq. 11
    noise : float, standard deviations of a channel, on the input
    noisy_target : bool, whether the target has the same noise
    motion_dropout : float, share of the input motion that is left out
    clusters : int, of windows by their poses, each drawn as often as the others; 0 draws all windows alike (Fig. 11)
    first_epochs, second_epochs : int
        Of teacher forcing, and of learning from one's own predictions. An epoch draws as many windows as fit into the
        recordings without overlap.
    first_rate, second_rate : float, of RMSprop; a tenth of it from `first_drop` and `second_drop` of the epochs on
    first_drop, second_drop : float, shares of the epochs
    batch_size : int, windows, over all processes together
    shards : int, as in `harmolab.systems.harmogan.params.TrainParams`
    clip : float, largest norm of a gradient
    temperature : float, share of the predicted standard deviation that is drawn (Eq. 12 draws all of it)
    draw_memory : float, seconds
        Time constant of the draws, an autoregression of the first order with the same spread: the dice of one frame
        still count in the next ones. 0 throws each frame anew, as in Eq. 12.
    smoothing : float, seconds, standard deviation of the Gaussian that the danced code is smoothed by
    start_seconds : float, of movement that a dance goes on from; 0 for one frame
    seed : int
    """

    song: SongParams = SongParams()
    generator: Generator = "wavenet"
    representation: Representation = "rotations"
    end_effectors: bool = True
    mapping: bool = True
    fps: float = 25.0
    window: float = 8.0
    residual: int = 32
    skip: int = 128
    dilations: tuple[int, ...] = (1, 2, 4, 8, 16)
    groups: int = 4
    dance_vector: int = 5
    lstm: int = 256
    least_sigma: float = 0.03
    carry: float = 0.0
    contact_weight: float = 0.1
    noise: float = 0.1
    noisy_target: bool = True
    motion_dropout: float = 0.4
    clusters: int = 60
    first_epochs: int = 1300
    second_epochs: int = 200
    first_rate: float = 4e-4
    second_rate: float = 4e-5
    first_drop: float = 1000 / 1300
    second_drop: float = 0.5
    batch_size: int = 16
    shards: int = 1
    clip: float = 10.0
    temperature: float = 1.0
    draw_memory: float = 0.0
    smoothing: float = 0.0
    start_seconds: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        zeros = [field.name for field in fields(self) if field.name.endswith(("_epochs", "_drop", "_seconds"))]
        zeros += ["carry", "contact_weight", "noise", "motion_dropout", "clusters", "draw_memory", "smoothing", "seed"]
        check_settings(self, not_negative=zeros, free=("temperature",))
        if not self.dilations or min(self.dilations) < 1:
            raise ValueError(f"dilations must be one or more frames, got {self.dilations}")
        if self.song.window != self.window:
            raise ValueError(f"music and motion need windows of one length, got {self.song.window} and {self.window} s")
        rate, seconds = max(self.fps, self.song.rate), max(self.window, self.smoothing)
        if self.reach > MOST_REACH or rate > MOST_RATE or seconds > MOST_SECONDS:
            raise ValueError("dilations, rates, windows and smoothing must be of a size that a dance can have")
        if not 0 <= self.temperature <= MOST_TEMPERATURE:
            raise ValueError(f"temperature must be from 0 to {MOST_TEMPERATURE:g}, got {self.temperature:g}")
        if self.motion_dropout >= 1 or max(self.carry, self.first_drop, self.second_drop) > 1:
            raise ValueError("motion_dropout must leave something; carry and drops are shares, 0 to 1")

    @classmethod
    def paper(cls) -> "Music2DanceParams":
        """As printed, at 25 frames per second."""
        return cls()

    @classmethod
    def recommended(cls) -> "Music2DanceParams":
        """Positions; most of the frame before is carried over; contacts that count; draws that last, and smoothed."""
        return replace(
            cls(), representation="positions", carry=0.9, contact_weight=2.0, noisy_target=False, temperature=0.3,
            draw_memory=0.3, smoothing=0.04, start_seconds=5.0,
        )  # fmt: skip

    @property
    def reach(self) -> int:
        """Frames that the WaveNet sees."""
        return 1 + self.groups * sum(self.dilations)

    @property
    def n_frames(self) -> int:
        """Frames of a training window."""
        return round(self.window * self.fps)
