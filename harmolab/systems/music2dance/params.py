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
    """Settings of Music2Dance: sizes, losses, schedule of the training, and dancing; the defaults are the paper's.

    Parameters
    ----------
    song : SongParams
        Of the network that maps the music.
    generator : "wavenet" or "lstm"
        The WaveNet, or the paper's baseline.
    representation : "rotations" or "positions"
        The code of a pose: the paper's (root, joint rotations, end effectors), or places of the joints.
    end_effectors : bool
        Whether places of feet, head and hands are part of the code of rotations (Fig. 10).
    mapping : bool
        Whether the WaveNet gets the mapped music; else (ablation of Fig. 9) the music features themselves.
    fps : float, frames per second
        Of the motion.
    window : float, seconds
        Length of a training window.
    residual, skip : int
        Channels of the WaveNet through its blocks, and beside them.
    dilations : tuple of int, frames
        Dilations of the blocks of a group.
    groups : int
        Times that the dilations are gone through.
    dance_vector : int
        Numbers in the learnt vector of a dance.
    lstm : int
        Units of the baseline.
    least_sigma : float
        Smallest standard deviation that is predicted, in standard deviations of a channel.
    carry : float
        Share of the frame before in the predicted mean. The paper predicts the pose alone (0).
    contact_weight : float
        Weight lambda of the foot contacts in Eq. 11.
    noise : float
        Noise on the input motion, in standard deviations of a channel.
    noisy_target : bool
        Whether the target has the same noise.
    motion_dropout : float
        Share of the input motion that is left out, below 1.
    clusters : int
        Clusters of windows by their poses, each of which is drawn equally often (Fig. 11). 0 draws all windows alike.
    first_epochs, second_epochs : int
        Epochs with the recorded frames as input (teacher forcing), then with the network's own predictions. An epoch
        draws as many windows as fit into the recordings without overlap.
    first_rate, second_rate : float
        Learning rates of RMSprop in both.
    first_drop, second_drop : float
        Shares of the epochs after which these fall to a tenth.
    batch_size : int
        Windows, over all processes together.
    shards : int
        As in `TrainParams`.
    clip : float
        Largest norm of a gradient.
    temperature : float from 0 to 4
        Share of the predicted standard deviation that is drawn; 1 draws all of it, as Eq. 12.
    draw_memory : float, seconds
        Time over which draws of neighbouring frames are alike (an autoregression of the first order with the same
        spread). 0 draws each frame anew, as in Eq. 12.
    smoothing : float, seconds
        Standard deviation of the Gaussian that smooths the danced code.
    start_seconds : float
        Length of the movement that a dance goes on from; 0 for one frame.
    seed : int
        Of weights, batches and draws.

    Raises
    ------
    ValueError
        For a value out of range or of another kind.
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
        """The paper's settings, as printed, at 25 frames per second."""
        return cls()

    @classmethod
    def recommended(cls) -> "Music2DanceParams":
        """The settings that we advise.

        Poses are places of joints, and most of the frame before is carried over. Contacts weigh more. Draws have less
        spread and last for some frames, and the dance is smoothed.
        """
        return replace(
            cls(), representation="positions", carry=0.9, contact_weight=2.0, noisy_target=False, temperature=0.3,
            draw_memory=0.3, smoothing=0.04, start_seconds=5.0,
        )  # fmt: skip

    @property
    def reach(self) -> int:
        """Number of frames that the WaveNet sees at once."""
        return 1 + self.groups * sum(self.dilations)

    @property
    def n_frames(self) -> int:
        """Number of frames in a training window."""
        return round(self.window * self.fps)
